"""The virtual camera as sink, through pyvirtualcam."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

from relit_camera.errors import DeviceError, InputError
from relit_camera.space.images import DisplayImage, check_image
from relit_camera.stream.devices import (
    OWN_LABEL,
    SYSTEM,
    DeviceTree,
    find_virtual_camera,
    load_command,
    negotiated_size,
)
from relit_camera.stream.sinks.base import SinkInfo
from relit_camera.stream.sinks.claim import Claim
from relit_camera.stream.sinks.loopback import revive

OpenCamera = Callable[..., Any]
"""`pyvirtualcam.Camera` or a stand-in: (width, height, fps, device=node) → object with `send` and `close`."""


CHECK_S = 1.0
"""How often the device is asked whether it still has our format: pyvirtualcam says nothing of a failed write."""


class CameraSink:
    """Shows pictures as the virtual camera of one label, at one fixed size.

    A device that a reader still holds keeps its old size whatever is asked for; then pictures are scaled to it.
    The device is claimed, so that no second Relit Camera can write to it. After a failed write the next one opens the
    device again.
    """

    def __init__(
        self,
        size: tuple[int, int],
        fps: float,
        label: str = OWN_LABEL,
        *,
        device: str | None = None,
        tree: DeviceTree = SYSTEM,
        open_camera: OpenCamera | None = None,
    ) -> None:
        """Open the device.

        Args:
            size: width and height of the pictures that will come, both even.
            fps: frames a second, a hint for some systems' virtual cameras.
            label: name of the device (Linux).
            device: node such as /dev/video10, instead of the label.
            tree: where devices are looked for.
            open_camera: `pyvirtualcam.Camera` if not given.

        Raises:
            InputError: an odd size: readers of the camera would get no picture.
            DeviceError: there is no such device, or it is in use; the cure says what to run.
        """
        if size[0] % 2 or size[1] % 2:
            raise InputError(f"a virtual camera cannot be {size[0]}x{size[1]}", "use an even width and height")
        self._size, self._fps, self._label, self._device, self._tree = size, fps, label, device, tree
        self._by_node = sys.platform.startswith("linux") or tree is not SYSTEM
        self._open_camera = open_camera or _pyvirtualcam
        self._camera: Any = None
        self._camera_size = size
        self._size_is_known = False
        self._node = ""
        self._claim: Claim | None = None
        self._check_at = 0.0
        self._open()

    def write(self, image: DisplayImage) -> None:
        """Show a picture, uint8 sRGB RGB (height, width, 3).

        Raises:
            DeviceError: the device is gone or in use.
            ImageError: the array is no picture.
        """
        check_image(image, np.uint8, "picture to show")
        if self._camera is None:
            self._open()
        if (image.shape[1], image.shape[0]) != self._camera_size:
            image = cv2.resize(image, self._camera_size, interpolation=cv2.INTER_AREA)
        try:
            self._camera.send(np.ascontiguousarray(image))
        except (RuntimeError, OSError) as error:
            self.close()
            raise DeviceError(f"the virtual camera {self._node} takes no pictures: {error}") from error
        if not self._size_is_known:  # some versions of the driver tell it only once a picture was written
            self._follow_device_size()
        elif self._by_node and time.monotonic() >= self._check_at:
            self._check_device()

    def describe(self) -> SinkInfo:
        """Say what the sink is."""
        return SinkInfo("camera", self._node, self._camera_size)

    def close(self) -> None:
        """Let go of the device."""
        self._close_camera()
        claim, self._claim = self._claim, None
        if claim is not None:
            claim.release()

    def _close_camera(self) -> None:
        camera, self._camera = self._camera, None
        if camera is not None:
            camera.close()

    def _open(self) -> None:
        node = None
        if self._by_node:
            node = self._device or find_virtual_camera(self._tree, self._label).node
            if not os.access(node, os.R_OK | os.W_OK):
                cure = 'run: sudo usermod -aG video "$USER", and log in again'
                raise DeviceError(f"no permission to write to {node}", cure)
            self._claim = Claim(node)
        try:
            self._open_at(self._size, node)
            self._node = node or str(getattr(self._camera, "device", ""))
            self._size_is_known = node is None
            self._follow_device_size()
        except BaseException:
            self.close()
            raise

    def _check_device(self) -> None:
        """Notice that the driver has dropped what is written, or changed its format.

        Raises:
            DeviceError: it has; the next `write` opens the device anew.
        """
        self._check_at = time.monotonic() + CHECK_S
        actual = negotiated_size(self._node, self._tree)
        if actual != self._camera_size:
            self.close()
            now = f"is {actual[0]}x{actual[1]} now" if actual else "was taken away or reset"
            raise DeviceError(f"the virtual camera {self._node} takes no pictures: it {now}")

    def _follow_device_size(self) -> None:
        """Open the device anew at the size that it really has, where it kept another than was asked for."""
        actual = negotiated_size(self._node, self._tree)
        if self._size_is_known or actual is None:
            return
        if actual != self._camera_size:
            self._close_camera()
            self._open_at(actual, self._node)
        self._size_is_known = True

    def _open_at(self, size: tuple[int, int], node: str | None) -> None:
        if node is not None:
            revive(node, self._tree)
        try:
            self._camera = self._open_camera(*size, self._fps, device=node)
        except ImportError as error:
            raise DeviceError(f"pyvirtualcam cannot be used: {error}", "run: pip install pyvirtualcam") from error
        except RuntimeError as error:
            raise self._explained(str(error), node) from error
        self._camera_size = size

    def _explained(self, message: str, node: str | None) -> DeviceError:
        if node is None:
            return DeviceError(
                f"there is no virtual camera: {message}", "install OBS Studio and start its virtual camera once"
            )
        if "output device" in message or "in use" in message or "busy" in message.lower():
            what = f"{node} is in use: another program publishes to it, or an application still shows it"
            reload = f"sudo modprobe -r v4l2loopback && {load_command(self._label)}"
            return DeviceError(what, f"stop that program or switch its camera off; if there is none, run: {reload}")
        return DeviceError(f"{node} cannot be opened: {message}", f"run: {load_command(self._label)}")


def _pyvirtualcam(width: int, height: int, fps: float, device: str | None) -> Any:
    import pyvirtualcam

    return pyvirtualcam.Camera(width, height, fps, device=device)
