"""From pictures to I420, the layout that every reader of a virtual camera understands.

One Relit Camera a device: the driver itself lets two of them write into each other's picture, in some versions.

The claim is a lock (flock) on the device node: nothing to clean up, it ends with the process however that ends, and it
holds between users. Programs that are not ours take no notice of it.

A v4l2loopback device, written to by the kernel's own interface.

pyvirtualcam, which serves other systems, tells neither which format the device took nor that a write has failed.

v4l2loopback 0.12 (Debian 12) has a fault besides: with `exclusive_caps=1` it takes the output capability away at the
first written frame and gives it back only when an opener that had called VIDIOC_STREAMON closes the device. A writer by
`write` never calls it; `reset_stuck_device` does, on an open of its own.
"""

from __future__ import annotations

import contextlib
import errno
import os
import struct
import sys
from pathlib import Path

import cv2
import numpy as np

from relit_camera.base.errors import DeviceError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.devices.device_users import find_device_users, has_mapped_buffers
from relit_camera.devices.video_devices import DeviceTree

# ITU-R BT.601, limited range: U and V of R, G, B from 0 to 255.
CHROMA_MATRIX = np.array(
    [[-37.797, -74.203, 112.0, 128 * 255], [112.0, -93.786, -18.214, 128 * 255]], dtype=np.float32
) / np.float32(255)


def rgb_to_i420(image: DisplayImage) -> np.ndarray:
    """Convert uint8 sRGB RGB (height, width, 3), both even, to uint8 (height · width · 3/2,): planes Y, U, V.

    Colour is the mean of each two by two pixels: OpenCV's own conversion takes every second pixel's, which frays edges.
    """
    height, width = image.shape[:2]
    planes: np.ndarray = cv2.cvtColor(image, cv2.COLOR_RGB2YUV_I420).reshape(-1)
    half = cv2.resize(image, (width // 2, height // 2), interpolation=cv2.INTER_AREA)
    chroma = cv2.transform(half, CHROMA_MATRIX)
    planes[height * width :].reshape(2, height // 2, width // 2)[:] = chroma.transpose(2, 0, 1)
    return planes


class DeviceLock:
    """Holds a device node until it is released."""

    def __init__(self, node: str) -> None:
        """Take the claim.

        Args:
            node: such as /dev/video10.

        Raises:
            DeviceError: another Relit Camera has it, or the node cannot be opened.
        """
        self._descriptor = -1
        if not sys.platform.startswith("linux"):
            return
        import fcntl

        try:
            self._descriptor = os.open(node, os.O_RDONLY | os.O_NONBLOCK)
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.release()
            what = f"another Relit Camera publishes to {node} already"
            cure = "stop that one (relit doctor names its process), or give this one a device of its own"
            raise DeviceError(what, cure) from None
        except OSError as error:
            self.release()
            what = f"{node} cannot be opened: {error.strerror}"
            raise DeviceError(what, "see what holds it: relit doctor") from error

    def release(self) -> None:
        """Let go. Harmless when repeated."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)


# linux/videodev2.h
VIDIOC_QUERYCAP = 0x80685600
VIDIOC_G_FMT = 0xC0D05604
VIDIOC_S_FMT = 0xC0D05605
VIDIOC_STREAMON = 0x40045612
CAPABILITY_BYTES, DEVICE_CAPS_OFFSET = 104, 88
CAP_VIDEO_CAPTURE, CAP_VIDEO_OUTPUT = 0x1, 0x2
BUF_TYPE_VIDEO_OUTPUT = 2
FIELD_NONE, COLORSPACE_SRGB = 1, 8
YU12 = int.from_bytes(b"YU12", "little")
V4L2_FORMAT = struct.Struct("=I4x7I172x")
"""v4l2_format: the buffers' type, then of v4l2_pix_format width, height, layout, field, bytes a line and a picture,
colour space; the rest is zero."""


FrameFormat = tuple[tuple[int, int], int]
"""Width and height, and the layout, such as `YU12`."""


class LoopbackDevice:
    """Shows pictures through a device node, in I420.

    Attributes:
        node: the device file.
        size: width and height that the device really has: those it was asked for, or those that a reader still holds.
    """

    def __init__(self, size: tuple[int, int], node: str) -> None:
        """Open the device and agree on a format.

        Args:
            size: width and height asked for, both even.
            node: such as /dev/video10.

        Raises:
            OSError: it cannot be opened, or is no such device; EBUSY: another program writes to it, or one still reads
                what another wrote in another layout.
        """
        self._descriptor = os.open(node, os.O_RDWR)
        try:
            if not _capabilities(self._descriptor) & CAP_VIDEO_OUTPUT:
                raise OSError(errno.EBUSY, "another program publishes to it, or still shows it")
            actual, layout = self._agree(size)
            if layout != YU12:
                name = layout.to_bytes(4, "little").decode(errors="replace")
                raise OSError(errno.EBUSY, f"a program still shows it in the layout {name}")
        except BaseException:
            self.close()
            raise
        self.node, self.size = node, actual

    def send(self, image: DisplayImage) -> None:
        """Show a picture of `size`, uint8 sRGB RGB.

        Raises:
            OSError: the device did not take all of it.
        """
        planes = rgb_to_i420(image)
        written = os.write(self._descriptor, planes.data)
        if written != planes.size:
            raise OSError(errno.EIO, f"{written} of {planes.size} bytes were taken")

    def close(self) -> None:
        """Let go. Harmless when repeated."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)

    def _agree(self, size: tuple[int, int]) -> FrameFormat:
        """Ask for a size. While a reader holds another, 0.12 and 0.15 answer with that, and 0.13 refuses."""
        try:
            return self._format(VIDIOC_S_FMT, size)
        except OSError as error:
            if error.errno != errno.EBUSY:
                raise
        kept, _ = self._format(VIDIOC_G_FMT, size)
        return self._format(VIDIOC_S_FMT, kept)

    def _format(self, request: int, size: tuple[int, int]) -> FrameFormat:
        import fcntl

        width, height = size
        asked = (BUF_TYPE_VIDEO_OUTPUT, width, height, YU12, FIELD_NONE, width, width * height * 3 // 2)
        answer = bytearray(V4L2_FORMAT.pack(*asked, COLORSPACE_SRGB))
        fcntl.ioctl(self._descriptor, request, answer)
        _, actual_width, actual_height, layout, *_ = V4L2_FORMAT.unpack(answer)
        return (actual_width, actual_height), layout


def reset_stuck_device(node: str, tree: DeviceTree) -> bool:
    """Set a stuck device free, which the caller has claimed. Returns whether it was stuck; others are left alone.

    While another writer is at work the call would let two mix their pictures. Another of ours cannot be, for the device
    is claimed; another program may be one unless it has the device's buffers mapped, as readers have and most writers
    have not. Programs of other users cannot be seen, so where none is seen nothing is done. Newer versions, which have
    a `state` file, have no need of it.
    """
    folder = tree.sys / "class" / "video4linux" / Path(node).name
    if not sys.platform.startswith("linux") or (folder / "state").exists():
        return False
    import fcntl

    try:
        device = os.open(node, os.O_RDWR | os.O_NONBLOCK)
    except OSError:
        return False  # opening it to publish will say why
    try:
        capabilities = _capabilities(device)
        if capabilities & CAP_VIDEO_OUTPUT:
            return False
        if capabilities & CAP_VIDEO_CAPTURE:
            others = find_device_users(node)
            if not others or not all(has_mapped_buffers(holder, node) for holder in others):
                return False
        with contextlib.suppress(OSError):  # EINVAL is its usual answer, and it has worked all the same
            fcntl.ioctl(device, VIDIOC_STREAMON, struct.pack("=i", BUF_TYPE_VIDEO_OUTPUT))
        return True
    except OSError:
        return False  # no V4L2 device
    finally:
        os.close(device)


def _capabilities(descriptor: int) -> int:
    import fcntl

    answer = bytearray(CAPABILITY_BYTES)
    fcntl.ioctl(descriptor, VIDIOC_QUERYCAP, answer)
    found: int = struct.unpack_from("=I", answer, DEVICE_CAPS_OFFSET)[0]
    return found
