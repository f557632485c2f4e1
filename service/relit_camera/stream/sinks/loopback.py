"""A v4l2loopback device, written to by the kernel's own interface.

pyvirtualcam, which serves other systems, tells neither which format the device took nor that a write has failed.

v4l2loopback 0.12 (Debian 12) has a fault besides: with `exclusive_caps=1` it takes the output capability away at the
first written frame and gives it back only when an opener that had called VIDIOC_STREAMON closes the device. A writer by
`write` never calls it; `revive` does, on an open of its own.
"""

from __future__ import annotations

import contextlib
import errno
import os
import struct
import sys
from pathlib import Path

from relit_camera.space.images import DisplayImage
from relit_camera.stream.devices import DeviceTree
from relit_camera.stream.holders import holders, maps
from relit_camera.stream.sinks.i420 import i420

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
FORMAT = struct.Struct("=I4x7I172x")
"""v4l2_format: the buffers' type, then of v4l2_pix_format width, height, layout, field, bytes a line and a picture,
colour space; the rest is zero."""


Format = tuple[tuple[int, int], int]
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
        planes = i420(image)
        written = os.write(self._descriptor, planes.data)
        if written != planes.size:
            raise OSError(errno.EIO, f"{written} of {planes.size} bytes were taken")

    def close(self) -> None:
        """Let go. Harmless when repeated."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)

    def _agree(self, size: tuple[int, int]) -> Format:
        """Ask for a size. While a reader holds another, 0.12 and 0.15 answer with that, and 0.13 refuses."""
        try:
            return self._format(VIDIOC_S_FMT, size)
        except OSError as error:
            if error.errno != errno.EBUSY:
                raise
        kept, _ = self._format(VIDIOC_G_FMT, size)
        return self._format(VIDIOC_S_FMT, kept)

    def _format(self, request: int, size: tuple[int, int]) -> Format:
        import fcntl

        width, height = size
        asked = (BUF_TYPE_VIDEO_OUTPUT, width, height, YU12, FIELD_NONE, width, width * height * 3 // 2)
        answer = bytearray(FORMAT.pack(*asked, COLORSPACE_SRGB))
        fcntl.ioctl(self._descriptor, request, answer)
        _, actual_width, actual_height, layout, *_ = FORMAT.unpack(answer)
        return (actual_width, actual_height), layout


def revive(node: str, tree: DeviceTree) -> bool:
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
            others = holders(node)
            if not others or not all(maps(holder, node) for holder in others):
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
