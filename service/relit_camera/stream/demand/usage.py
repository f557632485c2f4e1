"""Whether anybody takes pictures from a v4l2loopback device.

From version 0.13 on the driver says so itself, by an event of its own (V4L2_EVENT_PRI_CLIENT_USAGE, added by pull
request 516): whoever subscribes is told at once, and at each change, how many take pictures. 0.12 (Debian 12) has
nothing of the kind; there only the programs that have the node open can be counted, and of those only one's own.
"""

from __future__ import annotations

import errno
import os
import struct
import sys
from collections.abc import Callable
from pathlib import Path

from relit_camera.stream.holders import PROC, holders

# linux/videodev2.h, and v4l2loopback's own event
VIDIOC_DQEVENT, VIDIOC_SUBSCRIBE_EVENT = 0x80885659, 0x4020565A
EVENT_BYTES, PAYLOAD_OFFSET = 136, 8
CLIENT_USAGE = 0x08000000 + 0x08E00000 + 1
SEND_INITIAL = 1

NOT_OFFERED = (errno.EINVAL, errno.ENOTTY)


class Unanswerable(Exception):  # noqa: N818 - a finding, no fault
    """The driver does not tell who takes pictures: it is too old, or no v4l2loopback."""


Usage = Callable[[str], bool]
"""(node) → whether anybody takes pictures from it."""


def driver_says(node: str) -> bool:
    """Ask the driver whether anybody takes pictures from `node`.

    A fresh subscription each time: its first event is the present state, so that no lost event can mislead for good.

    Raises:
        Unanswerable: the driver has no such event.
        OSError: the node is gone, or has as many openers as it takes; ask again later.
    """
    if not sys.platform.startswith("linux"):
        raise Unanswerable
    import fcntl

    device = os.open(node, os.O_RDONLY | os.O_NONBLOCK)
    try:
        fcntl.ioctl(device, VIDIOC_SUBSCRIBE_EVENT, struct.pack("=8I", CLIENT_USAGE, 0, SEND_INITIAL, *[0] * 5))
        event = bytearray(EVENT_BYTES)
        fcntl.ioctl(device, VIDIOC_DQEVENT, event)
    except OSError as error:
        if error.errno in NOT_OFFERED:
            raise Unanswerable from error
        raise
    finally:
        os.close(device)
    (count,) = struct.unpack_from("=I", event, PAYLOAD_OFFSET)
    return bool(count)


def somebody_has_it_open(node: str, proc: Path = PROC) -> bool:
    """Whether another program of ours (any, for root) has `node` open, be it to take pictures or not."""
    return bool(holders(node, proc))
