"""Checks of access to cameras: the webcam, the virtual camera, and browsers whose sandbox hides cameras."""

from __future__ import annotations

import configparser
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
from relit_camera.devices.sources.source_factory import SOURCES
from relit_camera.doctor.host import Host
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


FLATPAK_APPS = (
    "org.mozilla.firefox",
    "org.chromium.Chromium",
    "com.google.Chrome",
    "com.brave.Browser",
    "com.microsoft.Edge",
    "us.zoom.Zoom",
)
SNAP_APPS = ("firefox", "chromium", "brave", "zoom-client")
FLATPAK_ROOTS = ("var/lib/flatpak", "{home}/.local/share/flatpak")


def check_browsers(host: Host, home: Path | None = None) -> Finding:
    """Check for Flatpak browsers without access to devices, and for Snap browsers that may have to be connected.

    A Flatpak's own metadata and the overrides of user and system are read; a portal may still give it a camera.
    """
    topic, home = "browsers", home or Path.home()
    installations = [host.root / path.format(home=str(home).lstrip("/")) for path in FLATPAK_ROOTS]
    denied = [app for app in FLATPAK_APPS if _lacks_device_access(app, installations, host)]
    if denied:
        cure = " && ".join(f"flatpak override --user --device=all {app}" for app in denied)
        return warning(topic, f"the Flatpak {', '.join(denied)} is given no devices", f"run: {cure}")
    snaps = [name for name in SNAP_APPS if (host.root / "snap" / name).is_dir()]
    if snaps:
        lines = ", ".join(f"sudo snap connect {name}:camera" for name in snaps)
        return ok(topic, f"Snaps need their camera connected (if one lists no camera: {lines})")
    return ok(topic, "none in a sandbox that hides cameras")


def _lacks_device_access(app: str, installations: list[Path], host: Host) -> bool:
    """Whether a Flatpak is installed and neither it nor an override gives it all devices."""
    metadata = [folder / "app" / app / "current/active/metadata" for folder in installations]
    if not any(path.is_file() for path in metadata):
        return False
    overrides = [folder / "overrides" / name for folder in installations for name in (app, "global")]
    return not any("all" in _devices(host.tree.read(path)) for path in metadata + overrides)


def _devices(text: str) -> list[str]:
    parser = configparser.ConfigParser(interpolation=None, strict=False)
    try:
        parser.read_string(text)
    except configparser.Error:
        return []
    return parser.get("Context", "devices", fallback="").split(";")
