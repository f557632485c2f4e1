"""The sizes and rates of a webcam, as its driver lists them."""

from __future__ import annotations

import errno
from collections.abc import Sequence
from pathlib import Path
from struct import Struct
from typing import Any

import pytest

from relit_camera.devices import v4l2
from relit_camera.devices.webcam_formats import FrameSize, list_frame_sizes

MJPG, YUYV = 1, 2
SIZES = {MJPG: [(1280, 720), (640, 480)], YUYV: [(640, 480)]}
INTERVALS = {
    (MJPG, (1280, 720)): [(1, 30), (1, 15)],
    (MJPG, (640, 480)): [(1, 30)],
    (YUYV, (640, 480)): [(1, 30), (2, 15), (1001, 30000)],
}
STEPWISE = 3


class Driver:
    """Answers as the UVC driver does; `fails` is raised in place of any answer."""

    def __init__(self) -> None:
        self.fails: OSError | None = None
        self.kind = v4l2.DISCRETE

    def __call__(self, descriptor: int, request: int, argument: bytearray) -> int:
        if self.fails is not None:
            raise self.fails
        if request == v4l2.VIDIOC_ENUM_FMT:
            index, *_ = v4l2.V4L2_FMTDESC.unpack(argument)
            argument[:] = v4l2.V4L2_FMTDESC.pack(index, 1, 0, b"", self._at([MJPG, YUYV], index))
        elif request == v4l2.VIDIOC_ENUM_FRAMESIZES:
            index, pixel_format, *_ = v4l2.V4L2_FRMSIZEENUM.unpack(argument)
            argument[:] = v4l2.V4L2_FRMSIZEENUM.pack(
                index, pixel_format, self.kind, *self._at(SIZES[pixel_format], index)
            )
        else:
            assert request == v4l2.VIDIOC_ENUM_FRAMEINTERVALS
            index, pixel_format, width, height, *_ = v4l2.V4L2_FRMIVALENUM.unpack(argument)
            found = self._at(INTERVALS[pixel_format, (width, height)], index)
            argument[:] = v4l2.V4L2_FRMIVALENUM.pack(index, pixel_format, width, height, self.kind, *found)
        return 0

    def _at(self, listed: Sequence[Any], index: int) -> Any:
        if index >= len(listed):
            raise OSError(errno.EINVAL, "Invalid argument")
        return listed[index]


@pytest.fixture
def driver(monkeypatch: pytest.MonkeyPatch) -> Driver:
    driver = Driver()
    monkeypatch.setattr("relit_camera.devices.v4l2.fcntl.ioctl", driver)
    return driver


@pytest.fixture
def node(tmp_path: Path) -> str:
    (tmp_path / "video0").touch()
    return str(tmp_path / "video0")


def test_each_size_is_listed_once_with_the_rates_of_all_formats(driver: Driver, node: str) -> None:
    assert list_frame_sizes(node) == (
        FrameSize(1280, 720, (30.0, 15.0)),
        FrameSize(640, 480, (30.0, 29.97, 7.5)),
    )


def test_ranges_are_left_out(driver: Driver, node: str) -> None:
    driver.kind = STEPWISE
    assert list_frame_sizes(node) == ()


@pytest.mark.parametrize("number", [errno.ENODEV, errno.EINVAL, errno.ENOTTY])
def test_one_that_is_unplugged_or_lists_nothing_has_none(driver: Driver, node: str, number: int) -> None:
    driver.fails = OSError(number, "no")
    assert list_frame_sizes(node) == ()


def test_a_node_that_is_gone_has_none(tmp_path: Path) -> None:
    assert list_frame_sizes(str(tmp_path / "video9")) == ()


@pytest.mark.parametrize(
    ("request_number", "struct"),
    [
        (v4l2.VIDIOC_ENUM_FMT, v4l2.V4L2_FMTDESC),
        (v4l2.VIDIOC_ENUM_FRAMESIZES, v4l2.V4L2_FRMSIZEENUM),
        (v4l2.VIDIOC_ENUM_FRAMEINTERVALS, v4l2.V4L2_FRMIVALENUM),
    ],
)
def test_the_structures_are_as_long_as_the_kernel_s(request_number: int, struct: Struct) -> None:
    assert struct.size == request_number >> 16 & 0x3FFF  # a request's number holds the length of its structure
