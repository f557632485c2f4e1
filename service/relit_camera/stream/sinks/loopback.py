"""A cure for v4l2loopback 0.12 (Debian 12): after its first writer the device is of no use until it is set free.

With `exclusive_caps=1` that version takes the output capability away at the first written frame and gives it back only
when an opener that had called VIDIOC_STREAMON closes the device; a plain writer never calls it. So one call of it on an
open file, and closing that, gives the capability back. While another writer is at work the call would let two writers
mix their frames. Another of ours cannot be, for the device is claimed before; another program may be one unless it has
the device's buffers mapped, as readers have and writers by `write` have not. Where a `state` file shows a newer version
there is no need of the call.
"""

from __future__ import annotations

import contextlib
import os
import struct
import sys
from pathlib import Path

from relit_camera.stream.devices import DeviceTree
from relit_camera.stream.holders import holders, maps

# linux/videodev2.h
VIDIOC_QUERYCAP = 0x80685600
VIDIOC_STREAMON = 0x40045612
CAPABILITY_BYTES, DEVICE_CAPS_OFFSET = 104, 88
CAP_VIDEO_CAPTURE, CAP_VIDEO_OUTPUT = 0x1, 0x2
BUF_TYPE_VIDEO_OUTPUT = 2


def revive(node: str, tree: DeviceTree) -> bool:
    """Set a stuck device free, which the caller has claimed. Returns whether it was stuck; others are left alone."""
    folder = tree.sys / "class" / "video4linux" / Path(node).name
    if not sys.platform.startswith("linux") or (folder / "state").exists():
        return False
    import fcntl

    try:
        device = os.open(node, os.O_RDWR | os.O_NONBLOCK)
    except OSError:
        return False  # opening it to publish will say why
    try:
        answer = bytearray(CAPABILITY_BYTES)
        fcntl.ioctl(device, VIDIOC_QUERYCAP, answer)
        (capabilities,) = struct.unpack_from("=I", answer, DEVICE_CAPS_OFFSET)
        if capabilities & CAP_VIDEO_OUTPUT:
            return False
        if capabilities & CAP_VIDEO_CAPTURE and not all(maps(holder, node) for holder in holders(node)):
            return False  # not only readers have it open: one may be writing
        with contextlib.suppress(OSError):  # EINVAL is its usual answer, and it has worked all the same
            fcntl.ioctl(device, VIDIOC_STREAMON, struct.pack("=i", BUF_TYPE_VIDEO_OUTPUT))
        return True
    except OSError:
        return False  # no V4L2 device
    finally:
        os.close(device)
