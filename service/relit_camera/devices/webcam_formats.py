"""The sizes and rates that a webcam films in, as its driver lists them."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass

from relit_camera.devices.v4l2 import enumerate_frame_rates


@dataclass(frozen=True)
class FrameSize:
    """A size of frames that a webcam gives."""

    width: int
    height: int
    rates: tuple[float, ...]
    """Frames a second at that size, the highest first; empty where the driver does not tell."""


def list_frame_sizes(node: str) -> tuple[FrameSize, ...]:
    """The sizes of a webcam, the largest first; none where its driver does not list them, or it cannot be opened.

    The node is opened, but no frame is asked for: the webcam's light stays as it is.
    """
    if not sys.platform.startswith("linux"):
        return ()
    try:
        descriptor = os.open(node, os.O_RDWR | os.O_NONBLOCK)
    except OSError:  # unplugged meanwhile, or not ours to open
        return ()
    try:
        found = enumerate_frame_rates(descriptor)
    except OSError:  # unplugged meanwhile
        return ()
    finally:
        os.close(descriptor)
    sizes = sorted(found, key=lambda size: (size[0] * size[1], size), reverse=True)
    return tuple(
        FrameSize(width, height, tuple(sorted({round(rate, 2) for rate in found[width, height]}, reverse=True)))
        for width, height in sizes
    )
