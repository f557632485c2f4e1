"""Lists the webcams and virtual cameras of this machine from Linux's /sys and /dev, without opening any.

Other systems give no names without opening devices: there a webcam is named by its index, and the virtual camera is the
default of the program that provides it.
"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass
from pathlib import Path

from relit_camera.base.errors import DeviceError

VIRTUAL_CAMERA_LABEL = "Relit Camera"
FIRST_WEBCAM = "webcam"
"""The id that means the first real webcam."""


@dataclass(frozen=True)
class DeviceFolders:
    """The folders in which devices are found; tests use folders of their own.

    Attributes:
        sys: the root of sysfs.
        dev: the root of device nodes.
    """

    sys: Path = Path("/sys")
    dev: Path = Path("/dev")

    @property
    def nodes(self) -> list[Path]:
        """The sysfs folder of each video device, by number."""
        folder = self.sys / "class" / "video4linux"
        found = [path for path in _inside(folder, "video*") if path.name[5:].isdigit()]
        return sorted(found, key=lambda path: int(path.name[5:]))

    def read(self, path: Path) -> str:
        """Text of a sysfs file, empty if it cannot be read."""
        try:
            return path.read_text(encoding="utf-8", errors="replace").strip()
        except OSError:
            return ""


SYSTEM_FOLDERS = DeviceFolders()


@dataclass(frozen=True)
class Webcam:
    """A camera to take pictures from.

    Attributes:
        id: the same after a restart, or when cameras are plugged in in another order: udev's by-id name where there is
            one, else USB path and name.
        name: the name given by its maker.
        node: the present device file, such as /dev/video0.
    """

    id: str
    name: str
    node: str


@dataclass(frozen=True)
class VirtualCamera:
    """A v4l2loopback device.

    Attributes:
        label: the name that call apps show.
        node: the device file.
        ours: whether the label is the one that is published to.
        size: width and height while somebody publishes, else None.
    """

    label: str
    node: str
    ours: bool
    size: tuple[int, int] | None


def list_webcams(tree: DeviceFolders = SYSTEM_FOLDERS) -> list[Webcam]:
    """All real capture devices, USB ones first, each once though it may have several nodes."""
    links = _links_by_node(tree)
    webcams = []
    for folder in tree.nodes:
        if _is_virtual(folder) or tree.read(folder / "index") not in ("", "0"):
            continue  # a further node of the same camera: metadata, or a second stream
        name = tree.read(folder / "name") or folder.name
        device = folder.resolve().parents[1]
        bus = "usb-" if "/usb" in device.as_posix() else ""
        fallback = bus + re.sub(r"[^A-Za-z0-9:._-]+", "_", f"{device.name}-{name}")
        webcams.append(Webcam(links.get(folder.name, fallback), name, str(tree.dev / folder.name)))
    return sorted(webcams, key=lambda webcam: not webcam.id.startswith("usb-"))


def list_virtual_cameras(
    tree: DeviceFolders = SYSTEM_FOLDERS, label: str = VIRTUAL_CAMERA_LABEL
) -> list[VirtualCamera]:
    """All v4l2loopback devices; the one with this label is marked as the program's own."""
    cameras = []
    for folder in tree.nodes:
        if _is_virtual(folder):
            name = tree.read(folder / "name")
            node = str(tree.dev / folder.name)
            cameras.append(VirtualCamera(name, node, name == label, negotiated_size(node, tree)))
    return cameras


def find_webcam(text: str, tree: DeviceFolders = SYSTEM_FOLDERS, label: str = VIRTUAL_CAMERA_LABEL) -> Webcam:
    """Find a camera by id, name, node or node number; `webcam` is the first one.

    Virtual cameras of other programs are found by name or node. The program's own, which has this label, never is: it
    would film itself.

    Raises:
        DeviceError: there is none; the cure lists the cameras.
    """
    if not sys.platform.startswith("linux") and tree is SYSTEM_FOLDERS:
        return _by_index(text)
    webcams = list_webcams(tree)
    if text == FIRST_WEBCAM and webcams:
        return webcams[0]
    virtual = list_virtual_cameras(tree, label)
    others = [Webcam(camera.label, camera.label, camera.node) for camera in virtual if not camera.ours]
    for webcam in webcams + others:
        if text in (webcam.id, webcam.name, webcam.node) or str(tree.dev / f"video{text}") == webcam.node:
            return webcam
    if any(text in (camera.label, camera.node) for camera in virtual):
        raise DeviceError(f"'{text}' is our own virtual camera: it would film itself", "choose another source")
    known = ", ".join(f"{webcam.id} ({webcam.name})" for webcam in webcams)
    if text == FIRST_WEBCAM:
        raise DeviceError("there is no webcam", "plug one in, or use --source FILE or --source pattern")
    raise DeviceError(f"there is no webcam '{text}'", f"there are: {known}" if known else "there is none at all")


def find_virtual_camera(tree: DeviceFolders = SYSTEM_FOLDERS, label: str = VIRTUAL_CAMERA_LABEL) -> VirtualCamera:
    """Find the v4l2loopback device of that label.

    Raises:
        DeviceError: the module is not loaded, or has no such device; the cure is the command that loads it.
    """
    cameras = list_virtual_cameras(tree, label)
    for camera in cameras:
        if camera.ours:
            return camera
    load = modprobe_command(label)
    if cameras:
        labels = ", ".join(f"'{camera.label}'" for camera in cameras)
        what = f"no virtual camera is called '{label}' (there are {labels})"
        raise DeviceError(what, f"run: sudo modprobe -r v4l2loopback && {load}")
    what = f"there is no virtual camera '{label}': the kernel module v4l2loopback is not loaded"
    raise DeviceError(what, f"run: {load}; if it is not installed, `relit doctor` says how to install it")


def modprobe_command(label: str = VIRTUAL_CAMERA_LABEL) -> str:
    """The shell command that creates the virtual camera; with `exclusive_caps` Chrome lists it."""
    return f"sudo modprobe v4l2loopback {module_options(label)}"


def module_options(label: str = VIRTUAL_CAMERA_LABEL) -> str:
    """The module's options for one device of that label, as modprobe and its configuration files take them."""
    return f'devices=1 video_nr=10 exclusive_caps=1 card_label="{label}"'


def negotiated_size(node: str, tree: DeviceFolders = SYSTEM_FOLDERS) -> tuple[int, int] | None:
    """The present width and height of a loopback device; None while no program publishes to it."""
    text = tree.read(tree.sys / "class" / "video4linux" / Path(node).name / "format")  # such as YU12:640x480@30
    found = re.fullmatch(r".{4}:(\d+)x(\d+)(@.*)?", text)
    return (int(found[1]), int(found[2])) if found else None


def _is_virtual(folder: Path) -> bool:
    return "/devices/virtual/" in folder.resolve().as_posix()


def _links_by_node(tree: DeviceFolders) -> dict[str, str]:
    """Stable names by udev: node name → name in /dev/v4l/by-id."""
    return {link.resolve().name: link.name for link in _inside(tree.dev / "v4l" / "by-id", "*")}


def _inside(folder: Path, pattern: str) -> list[Path]:
    try:
        return list(folder.glob(pattern))
    except OSError:  # it disappears with the last camera
        return []


def _by_index(text: str) -> Webcam:
    index = "0" if text == FIRST_WEBCAM else text
    if not index.isdigit():
        raise DeviceError(f"there is no webcam '{text}'", "give its index here: 0 is the first")
    return Webcam(index, f"camera {index}", index)
