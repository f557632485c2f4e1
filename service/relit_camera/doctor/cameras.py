"""The webcam that is read and the virtual camera that is written to."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from relit_camera.config.settings import OutputSettings, SourceSettings
from relit_camera.doctor.findings import Finding, fine, problem, problem_from, warning
from relit_camera.doctor.host import Host
from relit_camera.errors import DeviceError
from relit_camera.stream.devices import (
    OWN_LABEL,
    DeviceTree,
    find_virtual_camera,
    find_webcam,
    list_virtual_cameras,
    list_webcams,
    load_command,
)

JOIN_GROUP = 'run: sudo usermod -aG {group} "$USER", and log in again'
NO_DEVICE_SOURCES = ("pattern",)

Access = Callable[[str, int], bool]
"""`os.access` or a stand-in: (path, mode) → whether this user may."""


def check_webcam(
    settings: SourceSettings, host: Host, access: Access = os.access, own_label: str = OWN_LABEL
) -> Finding:
    """The camera that the settings name: there, readable, free, and not our own virtual one, called `own_label`."""
    tree = host.tree
    topic, found = "webcam", list_webcams(tree)
    names = ", ".join(f"{webcam.id} ({webcam.node})" for webcam in found) or "none"
    if settings.source in NO_DEVICE_SOURCES or Path(settings.source).expanduser().is_file():
        return fine(topic, f"not needed: the source is '{settings.source}'; there are: {names}")
    try:
        webcam = find_webcam(settings.source, tree, own_label)
    except DeviceError as error:
        return problem_from(topic, error)
    if Path(webcam.node).exists() and not access(webcam.node, os.R_OK | os.W_OK):
        group = _group(webcam.node)
        return problem(topic, f"{webcam.name} at {webcam.node} may only be read by group {group}", _join(group))
    users = host.holders(webcam.node)
    foreign = [str(holder) for holder in users if not holder.is_relit]
    if foreign:
        who = f"{webcam.name} at {webcam.node} is in use by {', '.join(foreign)}"
        return warning(topic, who, "close it there: a webcam serves one program at a time")
    others = f", read by {', '.join(map(str, users))}" if users else ""
    others += f"; all: {names}" if len(found) > 1 else ""
    return fine(topic, f"{webcam.name} at {webcam.node}{others}")


def check_virtual_camera(settings: OutputSettings, host: Host, access: Access = os.access) -> Finding:
    """The virtual camera that the settings name: module, label, rights, and that browsers will list it."""
    topic, tree = "virtual camera", host.tree
    if settings.sink != "camera" and not settings.sink.startswith(str(tree.dev / "video")):
        return fine(topic, f"not needed: the sink is '{settings.sink}'")
    if not host.is_linux:
        return fine(topic, "OBS Studio's is used here; it shows when the camera starts")
    cameras = list_virtual_cameras(tree, settings.label)
    named = next((camera for camera in cameras if camera.node == settings.sink), None)
    if named is None and settings.sink != "camera":
        known = ", ".join(f"{camera.node} ('{camera.label}')" for camera in cameras)
        cure = f"choose one of {known}" if known else f"run: {load_command(settings.label)}"
        return problem(topic, f"{settings.sink} is no virtual camera", cure)
    if not cameras:
        what = f"there is no '{settings.label}': the kernel module v4l2loopback is not loaded"
        return problem(topic, what, f"once it is installed (see kernel module), run: {load_command(settings.label)}")
    try:
        camera = named or find_virtual_camera(tree, settings.label)
    except DeviceError as error:
        return problem_from(topic, error)
    if not access(camera.node, os.R_OK | os.W_OK):
        group = _group(camera.node)
        return problem(topic, f"'{camera.label}' at {camera.node} may only be used by group {group}", _join(group))
    exclusive = _exclusive_caps(tree)
    place = cameras.index(camera)
    if place < len(exclusive) and not exclusive[place]:
        cure = f"run: sudo modprobe -r v4l2loopback && {load_command(settings.label)}"
        return warning(
            topic, f"'{camera.label}' at {camera.node} without exclusive_caps: Chrome does not list it", cure
        )
    use = f", in use at {camera.size[0]}x{camera.size[1]}" if camera.size else ""
    openers = ", ".join(map(str, host.holders(camera.node)))
    use += f", opened by {openers}" if openers else ""
    return fine(topic, f"'{camera.label}' at {camera.node}{use}")


def _exclusive_caps(tree: DeviceTree) -> list[bool]:
    """The module's parameter for each of its devices, in their order; empty where it is not told."""
    text = tree.read(tree.sys / "module" / "v4l2loopback" / "parameters" / "exclusive_caps")
    return [value.strip() in ("Y", "1") for value in text.split(",")] if text else []


def _group(node: str) -> str:
    try:
        return Path(node).group()
    except (KeyError, OSError, NotImplementedError):  # a group without a name, as in containers
        return "video"


def _join(group: str) -> str:
    return JOIN_GROUP.format(group=group)


def groups_to_join(tree: DeviceTree, access: Access = os.access) -> tuple[str, ...]:
    """The groups that own video devices which this user may not use."""
    nodes = [str(tree.dev / folder.name) for folder in tree.nodes]
    shut = [node for node in nodes if Path(node).exists() and not access(node, os.R_OK | os.W_OK)]
    return tuple(sorted({_group(node) for node in shut}))
