from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import av
import numpy as np
import pytest

from relit_camera.base.errors import VideoError
from relit_camera.base.images.image_files import encode_display
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.video import video_readers
from relit_camera.base.video.jpeg_packets import decode_jpeg_packet
from relit_camera.base.video.video_readers import VideoReader

WIDTH, HEIGHT, COUNT = 96, 64, 6


def picture(index: int) -> DisplayImage:
    """Smooth colors from black to white, so that chroma at half resolution says all."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return np.stack([255 * x / (WIDTH - 1), 255 * y / (HEIGHT - 1), (x + y + 20 * index) % 256], axis=2).astype(
        np.uint8
    )


def motion_jpeg(path: Path, change: Callable[[bytes, int], bytes] = lambda data, _: data) -> Path:
    """A film of pictures, of whose bytes each is changed by its index."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mjpeg", rate=25)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuvj420p"
        for index in range(COUNT):
            packet = av.Packet(change(encode_display(picture(index), ".jpg", 95), index))
            packet.stream, packet.pts, packet.dts, packet.duration = stream, index, index, 1
            container.mux(packet)
    return path


@pytest.fixture
def packets(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Grows by the size of each packet that OpenCV decodes."""
    sizes: list[int] = []

    def counted(packet: av.Packet) -> list[object] | None:
        sizes.append(packet.size)
        return decode_jpeg_packet(packet)  # type: ignore[return-value]

    monkeypatch.setattr(video_readers, "decode_jpeg_packet", counted)
    return sizes


@pytest.mark.parametrize("suffix", [".mov", ".avi", ".mkv"])
def test_motion_jpeg_is_read_as_exactly_by_opencv_as_by_ffmpeg(tmp_path: Path, packets: list[int], suffix: str) -> None:
    path = motion_jpeg(tmp_path / f"film{suffix}")
    with VideoReader(path) as accurate:
        expected = list(accurate)
    assert not packets
    with VideoReader(path, accurate=False) as fast:
        got = list(fast)
    assert sum(size > 0 for size in packets) == COUNT - 1  # the first by FFmpeg, for what it says of the file
    assert [frame.time_s for frame in got] == [frame.time_s for frame in expected]
    for one, other in zip(got[1:], expected[1:], strict=True):
        difference = one.image.astype(int) - other.image
        assert np.abs(difference).max() <= 4  # where chroma is interpolated otherwise
        assert np.abs(difference.mean(axis=(0, 1))).max() < 0.3
        assert not one.image.flags.writeable


def test_a_picture_without_its_end_is_damage(tmp_path: Path, packets: list[int]) -> None:
    path = motion_jpeg(tmp_path / "film.mov", lambda data, index: data[: len(data) // 2] if index == 3 else data)
    with VideoReader(path, accurate=False) as video, pytest.raises(VideoError, match=r"5 frames could be read, 1 not"):
        list(video)
    assert packets


def test_what_is_no_picture_is_damage(tmp_path: Path, packets: list[int]) -> None:
    path = motion_jpeg(tmp_path / "film.mov", lambda data, index: b"none\xff\xd9" if index == 3 else data)
    with VideoReader(path, accurate=False) as video, pytest.raises(VideoError, match=r"5 frames could be read, 1 not"):
        list(video)
    assert packets


def test_zeros_after_a_picture_are_no_damage(tmp_path: Path, packets: list[int]) -> None:
    path = motion_jpeg(tmp_path / "film.mov", lambda data, _: data + bytes(100))
    with VideoReader(path, accurate=False) as video:
        assert len(list(video)) == COUNT
    assert packets


@pytest.mark.parametrize("behind", [b"\0" * 700, b"\xff\xff", b"made by a camera"])
def test_what_stands_behind_a_picture_does_no_harm(tmp_path: Path, behind: bytes) -> None:
    path = motion_jpeg(tmp_path / "film.mov", lambda data, index: data + behind)
    with VideoReader(path, accurate=False) as video:
        assert len(list(video)) == COUNT
