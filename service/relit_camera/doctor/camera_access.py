"""Checks of access to cameras: the webcam, the virtual camera, and the PipeWire session."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from relit_camera.base.config.settings import OutputSettings, SourceSettings
from relit_camera.base.errors import DeviceError
from relit_camera.devices.device_discovery import (
    VIRTUAL_CAMERA_LABEL,
    DeviceFolders,
    find_virtual_camera,
    find_webcam,
    list_virtual_cameras,
    list_webcams,
    modprobe_command,
)
from relit_camera.devices.sinks.pipewire.pipewire_library import LIBRARY
from relit_camera.devices.sources.source_factory import SOURCES
from relit_camera.doctor.host import Host
from relit_camera.doctor.kernel_module import needs_module
from relit_camera.doctor.report import Finding, ok, problem, problem_from_error, warning

JOIN_GROUP_CURE = 'run: sudo usermod -aG {group} "$USER", and log in again'

AccessCheck = Callable[[str, int], bool]
"""(path, mode) → whether this user may access it: `os.access`, or a test's own."""


def check_webcam(
    settings: SourceSettings, host: Host, access: AccessCheck = os.access, own_label: str = VIRTUAL_CAMERA_LABEL
) -> Finding:
    """Check the webcam in the settings: it exists, is readable, free, and not the virtual camera named `own_label`."""
    tree = host.tree
    topic, found = "webcam", list_webcams(tree)
    names = ", ".join(f"{webcam.id} ({webcam.node})" for webcam in found) or "none"
    name, _, argument = settings.source.partition(":")
    is_plugin = SOURCES.has(name) and name != "webcam"
    if is_plugin or Path(settings.source).expanduser().is_file():
        return ok(topic, f"not needed: the source is '{settings.source}'; there are: {names}")
    try:
        webcam = find_webcam((name == "webcam" and argument) or settings.source, tree, own_label)
    except DeviceError as error:
        return problem_from_error(topic, error)
    if Path(webcam.node).exists() and not access(webcam.node, os.R_OK | os.W_OK):
        group = _owning_group(webcam.node)
        return problem(
            topic, f"{webcam.name} at {webcam.node} may only be read by group {group}", _join_group_cure(group)
        )
    users = host.find_device_users(webcam.node)
    foreign = [str(user) for user in users if not user.is_relit_camera]
    if foreign:
        who = f"{webcam.name} at {webcam.node} is in use by {', '.join(foreign)}"
        return warning(topic, who, "close it there: a webcam serves one program at a time")
    others = f", read by {', '.join(map(str, users))}" if users else ""
    others += f"; all: {names}" if len(found) > 1 else ""
    return ok(topic, f"{webcam.name} at {webcam.node}{others}")


def check_virtual_camera(settings: OutputSettings, host: Host, access: AccessCheck = os.access) -> Finding:
    """Check the virtual camera in the settings: module, label, permissions, and that browsers will list it."""
    topic, tree = "virtual camera", host.tree
    if settings.sink != "camera" and not settings.sink.startswith(str(tree.dev / "video")):
        return ok(topic, f"not needed: the sink is '{settings.sink}'")
    if not needs_module(settings, host) and host.is_linux:
        return ok(topic, f"'{settings.label}' in PipeWire, and no device")
    if not host.is_linux:
        cure = "if the camera does not start, install OBS Studio, and start and stop its virtual camera once"
        return ok(topic, f"OBS Studio's is used here; {cure}")
    cameras = list_virtual_cameras(tree, settings.label)
    named = next((camera for camera in cameras if camera.node == settings.sink), None)
    if named is None and settings.sink != "camera":
        known = ", ".join(f"{camera.node} ('{camera.label}')" for camera in cameras)
        cure = f"choose one of {known}" if known else f"run: {modprobe_command(settings.label)}"
        return problem(topic, f"{settings.sink} is no virtual camera", cure)
    if not cameras:
        what = f"there is no '{settings.label}': the kernel module v4l2loopback is not loaded"
        return problem(
            topic, what, f"once it is installed (see kernel module), run: {modprobe_command(settings.label)}"
        )
    try:
        camera = named or find_virtual_camera(tree, settings.label)
    except DeviceError as error:
        return problem_from_error(topic, error)
    if not access(camera.node, os.R_OK | os.W_OK):
        group = _owning_group(camera.node)
        return problem(
            topic, f"'{camera.label}' at {camera.node} may only be used by group {group}", _join_group_cure(group)
        )
    exclusive = _exclusive_caps(tree)
    place = cameras.index(camera)
    if place < len(exclusive) and not exclusive[place]:
        cure = f"run: sudo modprobe -r v4l2loopback && {modprobe_command(settings.label)}"
        return warning(
            topic, f"'{camera.label}' at {camera.node} without exclusive_caps: Chrome does not list it", cure
        )
    use = f", in use at {camera.size[0]}x{camera.size[1]}" if camera.size else ""
    openers = ", ".join(map(str, host.find_device_users(camera.node)))
    use += f", opened by {openers}" if openers else ""
    return ok(topic, f"'{camera.label}' at {camera.node}{use}")


PIPEWIRE_PACKAGES = {
    "debian": "sudo apt install pipewire wireplumber",
    "fedora": "sudo dnf install pipewire wireplumber",
    "arch": "sudo pacman -S pipewire wireplumber",
}
START_COMMAND = "systemctl --user start pipewire wireplumber"
SESSION_MANAGERS = {"wireplumber", "pipewire-media-"}
"""Names of processes, of which the kernel keeps fifteen characters."""


def check_pipewire(settings: OutputSettings, host: Host) -> Finding:
    """Check that the camera can be published in a PipeWire session: library, session, and a session manager.

    It is a problem where the camera can be nowhere else.
    """
    topic = "pipewire"
    if settings.sink not in ("camera", "pipewire") or not host.is_linux:
        return ok(topic, f"not used: the sink is '{settings.sink}'")
    loopback = settings.sink == "camera" and any(
        camera.ours for camera in list_virtual_cameras(host.tree, settings.label)
    )
    install = PIPEWIRE_PACKAGES.get(host.family, "# install PipeWire 0.3.48 or newer, and WirePlumber")
    if not host.can_load(LIBRARY):
        seen, cure = "it is not installed: with it no kernel module is needed", f"run: {install}; then log in again"
    elif host.socket is None or not os.path.exists(host.socket):  # noqa: PTH110 - False where the folder may not be entered
        where = f"there is no {host.socket}" if host.socket else "XDG_RUNTIME_DIR is not set"
        seen, cure = f"no session runs for this user: {where}", f"run: {START_COMMAND}; or log in to a desktop"
    elif not any(name.startswith(tuple(SESSION_MANAGERS)) for name in host.find_processes()):
        seen = f"a session runs at {host.socket}, without a session manager: programs that look for a camera get none"
        return warning(topic, seen, f"run: {install} && {START_COMMAND}")
    else:
        return ok(topic, f"'{settings.label}' can be published at {host.socket}")
    return ok(topic, f"{seen}; '{settings.label}' is a device alone") if loopback else problem(topic, seen, cure)


def _exclusive_caps(tree: DeviceFolders) -> list[bool]:
    """The module's parameter for each of its devices, in their order; empty where the module does not show it."""
    text = tree.read(tree.sys / "module" / "v4l2loopback" / "parameters" / "exclusive_caps")
    return [value.strip() in ("Y", "1") for value in text.split(",")] if text else []


def _owning_group(node: str) -> str:
    try:
        return Path(node).group()
    except (KeyError, OSError, NotImplementedError):  # a group without a name, as in containers
        return "video"


def _join_group_cure(group: str) -> str:
    return JOIN_GROUP_CURE.format(group=group)


def groups_to_join(tree: DeviceFolders, access: AccessCheck = os.access) -> tuple[str, ...]:
    """The groups that own video devices which this user may not use."""
    nodes = [str(tree.dev / folder.name) for folder in tree.nodes]
    denied = [node for node in nodes if Path(node).exists() and not access(node, os.R_OK | os.W_OK)]
    return tuple(sorted({_owning_group(node) for node in denied}))
