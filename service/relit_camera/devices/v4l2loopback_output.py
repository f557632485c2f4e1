"""A v4l2loopback device as output: pictures are written to its node, and a stuck device is reset.

It needs no library beyond Python's own: the keeper, which is to stay small, writes by it too. pyvirtualcam, which
serves the other systems, reports neither which format the device took nor that a write failed.
"""

from __future__ import annotations

import contextlib
import errno
import os
import sys
from pathlib import Path

from relit_camera.devices.device_discovery import DeviceFolders
from relit_camera.devices.device_users import find_device_users, has_mapped_buffers
from relit_camera.devices.v4l2 import (
    CAP_VIDEO_CAPTURE,
    CAP_VIDEO_OUTPUT,
    YU12,
    OutputFormat,
    get_output_format,
    query_capabilities,
    set_output_format,
    start_output_stream,
)


class LoopbackDevice:
    """Shows pictures through a device node, in I420.

    Attributes:
        node: the device file.
        size: width and height that the device has: those asked for, or those that a program still reading it has.
    """

    def __init__(self, size: tuple[int, int], node: str) -> None:
        """Open the device and agree on a format.

        Args:
            size: width and height asked for, both even.
            node: such as /dev/video10.

        Raises:
            OSError: it cannot be opened, or is no V4L2 device. EBUSY: another program writes to it, or one still reads
                it in another pixel format.
        """
        self._descriptor = os.open(node, os.O_RDWR)
        try:
            if not query_capabilities(self._descriptor) & CAP_VIDEO_OUTPUT:
                raise OSError(errno.EBUSY, "another program publishes to it, or still shows it")
            actual, pixel_format = self._agree(size)
            if pixel_format != YU12:
                name = pixel_format.to_bytes(4, "little").decode(errors="replace")
                raise OSError(errno.EBUSY, f"a program still shows it in the layout {name}")
        except BaseException:
            self.close()
            raise
        self.node, self.size = node, actual

    def send_planes(self, planes: memoryview) -> None:
        """Show a picture of `size` in I420: as bytes, its planes Y, U and V.

        Raises:
            OSError: the device did not take all of it.
        """
        written = os.write(self._descriptor, planes)
        if written != planes.nbytes:
            raise OSError(errno.EIO, f"{written} of {planes.nbytes} bytes were taken")

    def close(self) -> None:
        """Close the device. Harmless when repeated."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)

    def _agree(self, size: tuple[int, int]) -> OutputFormat:
        """Ask for a size. While a reader has another, versions 0.12 and 0.15 answer with that one, and 0.13 refuses."""
        try:
            return set_output_format(self._descriptor, size)
        except OSError as error:
            if error.errno != errno.EBUSY:
                raise
        kept, _ = get_output_format(self._descriptor)
        return set_output_format(self._descriptor, kept)


def reset_stuck_device(node: str, tree: DeviceFolders) -> bool:
    """Make a stuck device writable again; the caller holds its `DeviceLock`. Returns whether it was stuck.

    v4l2loopback 0.12 (Debian 12) has a fault: with `exclusive_caps=1` it takes the output capability away at the first
    written frame, and gives it back only when a program that had called VIDIOC_STREAMON closes the device. Writing by
    `write` never calls it, so it is called here, on a descriptor opened for it. Newer versions, which have a `state`
    file, have no such fault.

    While another program writes, the call would let two mix their pictures. It is therefore made only if every other
    program that has the device open is seen to have the device's buffers mapped, as readers have and most writers have
    not. Programs of other users cannot be seen, so nothing is done where none is seen.
    """
    folder = tree.sys / "class" / "video4linux" / Path(node).name
    if not sys.platform.startswith("linux") or (folder / "state").exists():
        return False
    try:
        device = os.open(node, os.O_RDWR | os.O_NONBLOCK)
    except OSError:
        return False  # opening it to publish reports the reason
    try:
        capabilities = query_capabilities(device)
        if capabilities & CAP_VIDEO_OUTPUT:
            return False
        if capabilities & CAP_VIDEO_CAPTURE:
            users = find_device_users(node)
            if not users or not all(has_mapped_buffers(user, node) for user in users):
                return False
        with contextlib.suppress(OSError):  # it usually answers EINVAL, and has its effect all the same
            start_output_stream(device)
        return True
    except OSError:
        return False  # no V4L2 device
    finally:
        os.close(device)
