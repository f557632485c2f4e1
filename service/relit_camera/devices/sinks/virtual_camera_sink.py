"""The virtual camera as sink: on Linux a v4l2loopback device, on other systems the one that pyvirtualcam finds."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from relit_camera.base.errors import DeviceError, InputError
from relit_camera.base.images.image_types import DisplayImage, check_image
from relit_camera.base.images.resize import crop_to_fill
from relit_camera.devices.device_discovery import (
    SYSTEM_FOLDERS,
    VIRTUAL_CAMERA_LABEL,
    DeviceFolders,
    find_virtual_camera,
    modprobe_command,
)
from relit_camera.devices.device_lock import DeviceLock
from relit_camera.devices.sinks.sink import SinkInfo
from relit_camera.devices.v4l2loopback_output import LoopbackDevice, reset_stuck_device


class VirtualCameraOutput(Protocol):
    """An open virtual camera.

    Attributes:
        node: the device file, or the system's name for it.
        size: width and height that it takes.
    """

    node: str
    size: tuple[int, int]

    def send(self, image: DisplayImage) -> None:
        """Show a picture of that size. Raises OSError or RuntimeError."""
        ...

    def close(self) -> None:
        """Close the device."""
        ...


OpenOutput = Callable[[tuple[int, int], float, str], VirtualCameraOutput]
"""(size asked for, frames a second, node or empty) → the open device."""


class VirtualCameraSink:
    """Publishes pictures as the virtual camera of one label, at one fixed size.

    A device that another program still reads keeps its size, whatever is asked for; then pictures are scaled and
    cropped to it. The device is locked (`DeviceLock`), so that no second Relit Camera can write to it. After a failed
    write the next one opens the device again.
    """

    def __init__(
        self,
        size: tuple[int, int],
        fps: float,
        label: str = VIRTUAL_CAMERA_LABEL,
        *,
        device: str | None = None,
        tree: DeviceFolders = SYSTEM_FOLDERS,
        open_output: OpenOutput | None = None,
    ) -> None:
        """Open the device.

        Args:
            size: width and height of the pictures, both even.
            fps: frames a second, a hint for the virtual cameras of some systems.
            label: name of the device (Linux).
            device: node such as /dev/video10, instead of the label.
            tree: the folders in which devices are found.
            open_output: opens the device; `LoopbackDevice` on Linux and pyvirtualcam elsewhere, if not given.

        Raises:
            InputError: the size is odd: readers of the camera would get no picture.
            DeviceError: there is no such device, or it is in use; the cure is the command to run.
        """
        if size[0] % 2 or size[1] % 2:
            raise InputError(f"a virtual camera cannot be {size[0]}x{size[1]}", "use an even width and height")
        self._size, self._fps, self._label, self._device, self._tree = size, fps, label, device, tree
        self._by_node = sys.platform.startswith("linux") or tree is not SYSTEM_FOLDERS
        self._open_output = open_output or (_open_loopback if self._by_node else _PyVirtualCam)
        self._output: VirtualCameraOutput | None = None
        self._info = SinkInfo("camera", "", size)
        self._lock: DeviceLock | None = None
        self._open()

    def write(self, image: DisplayImage) -> None:
        """Show a picture, uint8 sRGB RGB (height, width, 3).

        Raises:
            DeviceError: the device is gone or in use.
            ImageError: the array is no picture.
        """
        check_image(image, np.uint8, "picture to show")
        output = self._output or self._open()
        if (image.shape[1], image.shape[0]) != output.size:
            image = crop_to_fill(image, output.size)
        try:
            output.send(np.ascontiguousarray(image))
        except (RuntimeError, OSError) as error:
            self.close()
            raise DeviceError(f"the virtual camera {output.node} takes no pictures: {error}") from error

    def describe(self) -> SinkInfo:
        """Facts about the sink."""
        return self._info

    def close(self) -> None:
        """Close the device. Harmless when repeated."""
        output, self._output = self._output, None
        lock, self._lock = self._lock, None
        try:
            if output is not None:
                output.close()
        finally:
            if lock is not None:
                lock.release()

    def _open(self) -> VirtualCameraOutput:
        node = ""
        if self._by_node:
            node = self._device or find_virtual_camera(self._tree, self._label).node
            if not os.access(node, os.R_OK | os.W_OK):
                cure = 'run: sudo usermod -aG video "$USER", and log in again'
                raise DeviceError(f"no permission to write to {node}", cure)
            self._lock = DeviceLock(node)
        try:
            if node:
                reset_stuck_device(node, self._tree)
            self._output = output = self._open_output(self._size, self._fps, node)
        except Exception as error:
            self.close()
            raise self._explained(error, node) from error
        self._info = SinkInfo("camera", output.node, output.size)
        return output

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


def _open_loopback(size: tuple[int, int], fps: float, node: str) -> VirtualCameraOutput:
    return LoopbackDevice(size, node)  # the driver states 30 frames a second, whatever is written


class _PyVirtualCam:
    """The virtual camera of systems other than Linux."""

    def __init__(self, size: tuple[int, int], fps: float, node: str) -> None:
        import pyvirtualcam

        self._camera: Any = pyvirtualcam.Camera(*size, fps, device=node or None)
        self.node, self.size = str(self._camera.device), size

    def send(self, image: DisplayImage) -> None:
        self._camera.send(image)

    def close(self) -> None:
        self._camera.close()
