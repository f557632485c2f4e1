"""The V4L2 calls (ioctl) that Relit Camera makes, on an open device; all of them are here.

Names, numbers and structures are those of linux/videodev2.h, but for the event of v4l2loopback. The Python libraries
for V4L2 are under the GPL, so the calls are written out. They raise OSError as the kernel answers.
"""

from __future__ import annotations

import errno
import struct
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from relit_camera.base.errors import UnsupportedByDriverError

if sys.platform != "win32":
    import fcntl

VIDIOC_QUERYCAP = 0x80685600
VIDIOC_G_FMT = 0xC0D05604
VIDIOC_S_FMT = 0xC0D05605
VIDIOC_STREAMON = 0x40045612
VIDIOC_SUBSCRIBE_EVENT = 0x4020565A
VIDIOC_DQEVENT = 0x80885659

VIDIOC_ENUM_FMT = 0xC0405602
VIDIOC_ENUM_FRAMESIZES = 0xC02C564A
VIDIOC_ENUM_FRAMEINTERVALS = 0xC034564B

VIDIOC_QUERYCTRL = 0xC0445624
VIDIOC_G_CTRL = 0xC008561B
VIDIOC_S_CTRL = 0xC008561C

CAPABILITY_BYTES, DEVICE_CAPS_OFFSET = 104, 88
CAP_VIDEO_CAPTURE, CAP_VIDEO_OUTPUT = 0x1, 0x2
BUF_TYPE_VIDEO_CAPTURE, BUF_TYPE_VIDEO_OUTPUT = 1, 2
FIELD_NONE, COLORSPACE_SRGB = 1, 8
YU12 = int.from_bytes(b"YU12", "little")
"""The pixel format I420: planes Y, U, V, the last two of half width and height."""
V4L2_FORMAT = struct.Struct("=I4x7I172x")
"""v4l2_format: the buffers' type, then of v4l2_pix_format width, height, pixel format, field, bytes a line and a
picture, color space; the rest is zero."""

EVENT_BYTES, EVENT_DATA_OFFSET = 136, 8
EVENT_CLIENT_USAGE = 0x08000000 + 0x08E00000 + 1
"""V4L2_EVENT_PRI_CLIENT_USAGE of v4l2loopback 0.13 and newer (pull request 516): how many clients stream from it."""
EVENT_SUB_FL_SEND_INITIAL = 1
"""A subscription's first event is the present state, not the next change."""

V4L2_QUERYCTRL = struct.Struct("=II32siiiiI8x")
"""v4l2_queryctrl: id, type, name, minimum, maximum, step, default, flags."""
V4L2_CONTROL = struct.Struct("=Ii")
"""v4l2_control: id and value."""
CTRL_FLAG_DISABLED, CTRL_FLAG_READ_ONLY = 0x1, 0x4

V4L2_FMTDESC = struct.Struct("=III32sI16x")
"""v4l2_fmtdesc: index, the buffers' type, flags, description, pixel format."""
V4L2_FRMSIZEENUM = struct.Struct("=IIIII24x")
"""v4l2_frmsizeenum: index, pixel format, type, and of a discrete size width and height."""
V4L2_FRMIVALENUM = struct.Struct("=IIIIIII24x")
"""v4l2_frmivalenum: index, pixel format, width, height, type, and of a discrete interval its seconds as a fraction."""
DISCRETE = 1
MAX_ENUMERATED = 256
"""A driver that never says that its list is over is not asked for more."""

OutputFormat = tuple[tuple[int, int], int]
"""Width and height, and the pixel format, such as `YU12`."""


def query_capabilities(descriptor: int) -> int:
    """The capabilities of the opened node (`device_caps`), a sum of `CAP_` bits."""
    answer = bytearray(CAPABILITY_BYTES)
    fcntl.ioctl(descriptor, VIDIOC_QUERYCAP, answer)
    found: int = struct.unpack_from("=I", answer, DEVICE_CAPS_OFFSET)[0]
    return found


def get_output_format(descriptor: int) -> OutputFormat:
    """The format that the device has for pictures written to it."""
    return _exchange_format(descriptor, VIDIOC_G_FMT, (0, 0))


def set_output_format(descriptor: int, size: tuple[int, int]) -> OutputFormat:
    """Ask for I420 pictures of `size` (width, height), both even. Returns the format that the device took instead."""
    return _exchange_format(descriptor, VIDIOC_S_FMT, size)


def start_output_stream(descriptor: int) -> None:
    """Start streaming output."""
    fcntl.ioctl(descriptor, VIDIOC_STREAMON, struct.pack("=i", BUF_TYPE_VIDEO_OUTPUT))


def count_readers(descriptor: int) -> int:
    """How many programs take pictures from the v4l2loopback device.

    Each call subscribes anew, so `descriptor` must be freshly opened: the subscription's first event is the present
    state, and a lost event cannot mislead for good.

    Raises:
        UnsupportedByDriverError: the driver has no such event: v4l2loopback 0.12, or another driver.
        OSError: the device is gone.
    """
    subscription = struct.pack("=8I", EVENT_CLIENT_USAGE, 0, EVENT_SUB_FL_SEND_INITIAL, *[0] * 5)
    event = bytearray(EVENT_BYTES)
    try:
        fcntl.ioctl(descriptor, VIDIOC_SUBSCRIBE_EVENT, subscription)
        fcntl.ioctl(descriptor, VIDIOC_DQEVENT, event)
    except OSError as error:
        if error.errno in (errno.EINVAL, errno.ENOTTY):
            what = "this v4l2loopback does not report its readers"
            raise UnsupportedByDriverError(what, "use version 0.13 or newer") from error
        raise
    count: int = struct.unpack_from("=I", event, EVENT_DATA_OFFSET)[0]
    return count


def enumerate_frame_rates(descriptor: int) -> dict[tuple[int, int], set[float]]:
    """The sizes that the device films in, in any pixel format, and the frames a second of each.

    Sizes and rates that a driver gives as a range are left out: webcams have lists.
    """
    found: dict[tuple[int, int], set[float]] = {}
    formats = _enumerated(
        descriptor, VIDIOC_ENUM_FMT, lambda index: V4L2_FMTDESC.pack(index, BUF_TYPE_VIDEO_CAPTURE, 0, b"", 0)
    )
    for pixel_format in [V4L2_FMTDESC.unpack(answer)[4] for answer in formats]:
        for size in _sizes(descriptor, pixel_format):
            found.setdefault(size, set()).update(_rates(descriptor, pixel_format, *size))
    return found


def _sizes(descriptor: int, pixel_format: int) -> Iterator[tuple[int, int]]:
    answers = _enumerated(
        descriptor, VIDIOC_ENUM_FRAMESIZES, lambda index: V4L2_FRMSIZEENUM.pack(index, pixel_format, 0, 0, 0)
    )
    for _, _, kind, width, height in map(V4L2_FRMSIZEENUM.unpack, answers):
        if kind == DISCRETE:
            yield width, height


def _rates(descriptor: int, pixel_format: int, width: int, height: int) -> Iterator[float]:
    answers = _enumerated(
        descriptor,
        VIDIOC_ENUM_FRAMEINTERVALS,
        lambda index: V4L2_FRMIVALENUM.pack(index, pixel_format, width, height, 0, 0, 0),
    )
    for *_, kind, numerator, denominator in map(V4L2_FRMIVALENUM.unpack, answers):
        if kind == DISCRETE and numerator:
            yield denominator / numerator


def _enumerated(descriptor: int, request: int, question: Callable[[int], bytes]) -> list[bytes]:
    """What the driver answers to a question for the indices 0, 1, … until it says that there are no more."""
    answers: list[bytes] = []
    for index in range(MAX_ENUMERATED):
        answer = bytearray(question(index))
        try:
            fcntl.ioctl(descriptor, request, answer)
        except OSError as error:
            if error.errno in (errno.EINVAL, errno.ENOTTY):
                break
            raise
        answers.append(bytes(answer))
    return answers


@dataclass(frozen=True)
class ControlRange:
    """The values that a control of a device may have.

    Attributes:
        name: as the driver calls it.
        least, most, step: of its values.
        default: the driver's.
    """

    name: str
    least: int
    most: int
    step: int
    default: int


def query_control(descriptor: int, control: int) -> ControlRange | None:
    """The range of a control; None where the device has no such one, or it cannot be set."""
    answer = bytearray(V4L2_QUERYCTRL.pack(control, 0, b"", 0, 0, 0, 0, 0))
    try:
        fcntl.ioctl(descriptor, VIDIOC_QUERYCTRL, answer)
    except OSError as error:
        if error.errno in (errno.EINVAL, errno.ENOTTY):
            return None
        raise
    _, _, name, least, most, step, default, flags = V4L2_QUERYCTRL.unpack(answer)
    if flags & (CTRL_FLAG_DISABLED | CTRL_FLAG_READ_ONLY):
        return None
    return ControlRange(name.split(b"\0")[0].decode(errors="replace"), least, most, max(step, 1), default)


def get_control(descriptor: int, control: int) -> int:
    """The present value of a control."""
    answer = bytearray(V4L2_CONTROL.pack(control, 0))
    fcntl.ioctl(descriptor, VIDIOC_G_CTRL, answer)
    value: int = V4L2_CONTROL.unpack(answer)[1]
    return value


def set_control(descriptor: int, control: int, value: int) -> None:
    """Set a control; the driver takes the nearest value that it can."""
    fcntl.ioctl(descriptor, VIDIOC_S_CTRL, bytearray(V4L2_CONTROL.pack(control, value)))


def _exchange_format(descriptor: int, request: int, size: tuple[int, int]) -> OutputFormat:
    width, height = size
    asked = (BUF_TYPE_VIDEO_OUTPUT, width, height, YU12, FIELD_NONE, width, width * height * 3 // 2)
    answer = bytearray(V4L2_FORMAT.pack(*asked, COLORSPACE_SRGB))
    fcntl.ioctl(descriptor, request, answer)
    _, actual_width, actual_height, pixel_format, *_ = V4L2_FORMAT.unpack(answer)
    return (actual_width, actual_height), pixel_format
