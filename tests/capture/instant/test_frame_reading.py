"""Frames for an instant subject: evenly from files and webcams, and a busy webcam named."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import av
import numpy as np
import pytest

from relit_camera.base.config.settings import SourceSettings
from relit_camera.base.errors import DeviceError, VideoError
from relit_camera.base.images.image_files import write_display
from relit_camera.base.images.image_types import Frame
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.base.video.video_writer import VideoWriter
from relit_camera.capture.instant import frame_reading
from relit_camera.capture.instant.frame_reading import TUNABLES, read_frames
from relit_camera.devices.sources.source import Source, SourceInfo, SourceState


class FakeCamera:
    """Gives the frames of an iterator; None where no frame comes in time."""

    def __init__(self, frames: Iterator[Frame | None], reason: str = "") -> None:
        self.reason, self.closed, self._frames = reason, False, frames
        self.state = SourceState.RUNNING

    def read(self, timeout_s: float) -> Frame | None:
        return next(self._frames)

    def describe(self) -> SourceInfo:
        return SourceInfo("webcam", "usb-camera", (8, 6), 30)

    def close(self) -> None:
        self.closed = True


def picture(value: int) -> np.ndarray:
    return np.full((6, 8, 3), value % 256, np.uint8)


def at_rate(fps: float, silent: int = 0) -> Iterator[Frame | None]:
    """Frames whose brightness counts them, after some reads without any."""
    yield from [None] * silent
    index = 0
    while True:
        yield Frame(picture(index), index, index / fps, index / fps)
        index += 1


def read_from(camera: FakeCamera) -> frame_reading.ReadFrames:
    def opened(settings: SourceSettings) -> Source:
        assert settings.source == "usb-camera"
        return camera

    return read_frames("usb-camera", SourceSettings(), open_live=opened)


@pytest.mark.parametrize("fps", [5, 30, 60])
def test_a_webcam_is_watched_for_seconds_after_it_has_settled(fps: float) -> None:
    camera = FakeCamera(at_rate(fps, silent=10))
    read = read_from(camera)
    assert camera.closed
    assert read.source == "usb-camera"
    indices = [int(frame[0, 0, 0]) for frame in read.frames]
    assert indices[0] >= TUNABLES.settling_s * fps
    assert indices == sorted(set(indices))
    expected = min(TUNABLES.most, TUNABLES.webcam_s * fps)
    assert 0.45 * expected <= len(indices) <= TUNABLES.most + 1


def test_a_webcam_without_pictures_is_named_and_freed() -> None:
    camera = FakeCamera(iter([None] * 1000), "Webcam C920 cannot be opened: another program may be using it")
    with pytest.raises(DeviceError, match="another program may be using it; close the program"):
        read_from(camera)
    assert camera.closed


def test_a_webcam_that_stops_is_named_too() -> None:
    def stops() -> Iterator[Frame | None]:
        good = at_rate(30)
        yield from (next(good) for _ in range(40))
        yield from [None] * 1000

    with pytest.raises(DeviceError, match="usb-camera gives no pictures"):
        read_from(FakeCamera(stops()))


def test_a_picture_is_one_frame_and_large_ones_are_reduced(tmp_path: Path) -> None:
    write_display(tmp_path / "me.png", np.zeros((900, 2600, 3), np.uint8))
    read = read_frames(str(tmp_path / "me.png"), SourceSettings())
    assert read.source == "me.png"
    assert [frame.shape for frame in read.frames] == [(443, 1280, 3)]


def test_of_a_video_frames_are_taken_evenly(tmp_path: Path) -> None:
    path = tmp_path / "me.mp4"
    with VideoWriter(path, (64, 48), 30, threads=1) as writer:
        for index in range(200):
            writer.write(np.full((48, 64, 3), index, np.uint8), index / 30)
    frames = read_frames(str(path), SourceSettings()).frames
    levels = np.array([frame.mean() for frame in frames])
    assert 30 <= len(levels) <= TUNABLES.most
    assert levels[-1] > 180
    np.testing.assert_allclose(np.diff(levels), np.diff(levels).mean(), atol=3)


def test_damage_after_the_frames_that_are_taken_does_not_matter(tmp_path: Path) -> None:
    path = tmp_path / "me.avi"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mjpeg", rate=30, width=64, height=48, pix_fmt="yuvj420p")
        for index in range(300):
            picture = av.VideoFrame.from_ndarray(np.full((48, 64, 3), index % 256, np.uint8), format="rgb24")
            for packet in stream.encode(picture):
                if index == 298:
                    packet = av.Packet(bytes(packet.size))
                    packet.stream, packet.pts = stream, index
                container.mux(packet)
    with pytest.raises(VideoError, match="damaged"), VideoReader(path) as reader:
        list(reader)
    assert len(read_frames(str(path), SourceSettings()).frames) == TUNABLES.most


def test_a_file_that_is_not_there_is_named() -> None:
    with pytest.raises(VideoError, match="there is no file"):
        read_frames("nowhere.mp4", SourceSettings())
