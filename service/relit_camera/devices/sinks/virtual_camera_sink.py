"""The virtual camera as sink: on Linux a v4l2loopback device, on other systems the one that pyvirtualcam finds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import DeviceError
from relit_camera.base.images.color import rgb_to_i420
from relit_camera.base.images.image_types import DisplayImage, check_image
from relit_camera.base.images.resize import crop_to_fill
from relit_camera.devices.device_discovery import SYSTEM_FOLDERS, VIRTUAL_CAMERA_LABEL, DeviceFolders
from relit_camera.devices.sinks.camera_device import CameraDevice, OpenedCamera, OpenOutput
from relit_camera.devices.sinks.sink import SinkInfo
from relit_camera.devices.v4l2loopback_output import LoopbackDevice


class VirtualCameraOutput(OpenedCamera, Protocol):
    """An open virtual camera that takes pictures."""

    def send(self, image: DisplayImage) -> None:
        """Show a picture of `size`, uint8 sRGB RGB. Raises OSError or RuntimeError."""
        ...


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
            open_output: opens the device; `LoopbackCamera` on Linux and pyvirtualcam elsewhere, if not given.

        Raises:
            InputError: the size is odd: readers of the camera would get no picture.
            DeviceError: there is no such device, or it is in use; the cure is the command to run.
        """
        self._camera = CameraDevice(size, fps, open_output or _open_output, label, device, tree)
        self._info = SinkInfo("camera", "", size)
        self._open()

    def write(self, image: DisplayImage) -> None:
        """Show a picture, uint8 sRGB RGB (height, width, 3).

        Raises:
            DeviceError: the device is gone or in use.
            ImageError: the array is no picture.
        """
        check_image(image, np.uint8, "picture to show")
        output: VirtualCameraOutput = self._camera.output or self._open()
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
        self._camera.close()

    def _open(self) -> VirtualCameraOutput:
        output: VirtualCameraOutput = self._camera.open()
        self._info = SinkInfo("camera", output.node, output.size)
        return output


class LoopbackCamera(LoopbackDevice):
    """A v4l2loopback device that takes pictures."""

    def __init__(
        self, size: tuple[int, int], node: str, convert: Callable[[DisplayImage], NDArray[np.uint8]] = rgb_to_i420
    ) -> None:
        """`convert` makes I420 of pictures; else as `LoopbackDevice`."""
        super().__init__(size, node)
        self._convert = convert

    def send(self, image: DisplayImage) -> None:
        """Show a picture of `size`, uint8 sRGB RGB. Raises OSError."""
        self.send_planes(self._convert(image).data)


def _open_output(size: tuple[int, int], fps: float, node: str) -> VirtualCameraOutput:
    if not node:
        return _PyVirtualCam(size, fps)
    return LoopbackCamera(size, node)  # the driver states 30 frames a second, whatever is written


class _PyVirtualCam:
    """The virtual camera of systems other than Linux."""

    def __init__(self, size: tuple[int, int], fps: float) -> None:
        import pyvirtualcam

        self._camera: Any = pyvirtualcam.Camera(*size, fps, device=None)
        self.node, self.size = str(self._camera.device), size

    def send(self, image: DisplayImage) -> None:
        self._camera.send(image)

    def close(self) -> None:
        self._camera.close()
