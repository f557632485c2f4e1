"""The device of the virtual camera: found, locked, opened, and if it cannot be, why not, and what to do about it."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable
from typing import Any, Protocol

from relit_camera.base.errors import DeviceError, InputError
from relit_camera.devices.device_discovery import (
    SYSTEM_FOLDERS,
    VIRTUAL_CAMERA_LABEL,
    DeviceFolders,
    find_virtual_camera,
    modprobe_command,
)
from relit_camera.devices.device_lock import DeviceLock
from relit_camera.devices.v4l2loopback_output import reset_stuck_device


class OpenedCamera(Protocol):
    """An open virtual camera.

    Attributes:
        node: the device file, or the system's name for it.
        size: width and height that it takes.
    """

    node: str
    size: tuple[int, int]

    def close(self) -> None:
        """Close the device."""
        ...


OpenOutput = Callable[[tuple[int, int], float, str], Any]
"""(size asked for, frames a second, node or empty) → the open device, an `OpenedCamera`."""


class CameraDevice:
    """The virtual camera of one label, at one fixed size: locked (`DeviceLock`) while it is open.

    So no second Relit Camera can write to it. Only Python's own library is needed, unless `open_output` needs more.

    Attributes:
        output: what `open_output` gave; None while it is closed.
        by_node: whether this system has device nodes.
    """

    def __init__(
        self,
        size: tuple[int, int],
        fps: float,
        open_output: OpenOutput,
        label: str = VIRTUAL_CAMERA_LABEL,
        device: str | None = None,
        tree: DeviceFolders = SYSTEM_FOLDERS,
    ) -> None:
        """Set up; nothing is opened.

        Args:
            size: width and height of the pictures, both even.
            fps: frames a second, a hint for the virtual cameras of some systems.
            open_output: opens the device.
            label: name of the device (Linux).
            device: node such as /dev/video10, instead of the label.
            tree: the folders in which devices are found.

        Raises:
            InputError: the size is odd: readers of the camera would get no picture.
        """
        if size[0] % 2 or size[1] % 2:
            raise InputError(f"a virtual camera cannot be {size[0]}x{size[1]}", "use an even width and height")
        self._size, self._fps, self._label, self._device, self._tree = size, fps, label, device, tree
        self.by_node = sys.platform.startswith("linux") or tree is not SYSTEM_FOLDERS
        self._open_output = open_output
        self.output: Any = None
        self._lock: DeviceLock | None = None

    def open(self) -> Any:
        """Open the device. Returns `output`.

        Raises:
            DeviceError: there is no such device, or it is in use; the cure is the command to run.
        """
        node = ""
        if self.by_node:
            node = self._device or find_virtual_camera(self._tree, self._label).node
            if not os.access(node, os.R_OK | os.W_OK):
                cure = 'run: sudo usermod -aG video "$USER", and log in again'
                raise DeviceError(f"no permission to write to {node}", cure)
            self._lock = DeviceLock(node)
        try:
            if node:
                reset_stuck_device(node, self._tree)
            self.output = self._open_output(self._size, self._fps, node)
        except Exception as error:
            self.close()
            raise self._explained(error, node) from error
        return self.output

    def close(self) -> None:
        """Close the device. Harmless when repeated."""
        output, self.output = self.output, None
        lock, self._lock = self._lock, None
        try:
            if output is not None:
                output.close()
        finally:
            if lock is not None:
                lock.release()

    def _explained(self, error: Exception, node: str) -> Exception:
        if isinstance(error, ImportError):
            return DeviceError(f"pyvirtualcam cannot be used: {error}", "`relit doctor` says how to install it")
        if isinstance(error, OSError) and error.errno == errno.EBUSY:
            what = f"{node} is in use: {error.strerror}"
            reload = f"sudo modprobe -r v4l2loopback && {modprobe_command(self._label)}"
            return DeviceError(what, f"stop that program or switch its camera off; if there is none, run: {reload}")
        if isinstance(error, OSError):
            return DeviceError(f"{node} cannot be opened: {error.strerror}", f"run: {modprobe_command(self._label)}")
        if isinstance(error, RuntimeError):
            return DeviceError(f"there is no virtual camera: {error}", "`relit doctor` says how to get one here")
        return error
