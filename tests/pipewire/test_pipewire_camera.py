"""The camera in a real PipeWire session: found, read with the right pixels, left and read again, restarted, killed."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.devices.sources.pattern_source import draw_pattern
from tests.pipewire.conftest import PatternCamera
from tests.pipewire.session import Session, wait_for
from tests.vm.guest.pattern_number import read_number
from tests.vm.readers import difference

LABEL = "Relit Camera"
SIZE = (320, 180)
LARGE = (1280, 720)
WITHIN = 4
"""How far colours may be off, of 255: rounding to limited range and back, away from edges."""

StartCamera = Callable[..., PatternCamera]
Notes = Callable[[str, tuple[str, ...]], None]


def found(session: Session) -> dict[str, Any] | None:
    """Our camera as pw-dump tells of it; None while it does not."""
    return next((camera for camera in session.cameras() if camera.get("node.name") == LABEL), None)


def gstreamer(caps: str, file: Path, count: int | None = None, convert: str = "") -> list[str]:
    """GStreamer's command that reads pictures into a file, until so many are there or it is ended."""
    source = ["pipewiresrc", f"target-object={LABEL}", *([] if count is None else [f"num-buffers={count}"])]
    steps = [source, [caps], *([convert.split(" ! ")] if convert else []), ["filesink", f"location={file}"]]
    line = [word for step in steps for word in ("!", *step)][1:]
    return ["gst-launch-1.0", "-q", *line, "buffer-mode=unbuffered"]


def read(session: Session, caps: str, file: Path, count: int = 8) -> NDArray[np.uint8]:
    """Bytes of so many pictures as GStreamer reads them."""
    answer = session.run(*gstreamer(caps, file, count))
    assert answer.returncode == 0, answer.stderr.decode()
    return np.fromfile(file, np.uint8)


def rgb_of_i420(data: NDArray[np.uint8], size: tuple[int, int]) -> list[NDArray[np.uint8]]:
    """Pictures of bytes in I420."""
    frames = data.reshape(-1, size[1] * 3 // 2, size[0])
    return [np.asarray(cv2.cvtColor(frame, cv2.COLOR_YUV2RGB_I420), np.uint8) for frame in frames]


def numbers_of(images: list[NDArray[np.uint8]]) -> list[int]:
    """The numbers of pictures of the pattern; each must have one."""
    numbers = [read_number(image) for image in images]
    assert None not in numbers
    return [number for number in numbers if number is not None]


def worst_of(image: NDArray[np.uint8]) -> int:
    """How far the colours of a picture of the pattern are from those that were sent."""
    number = read_number(image)
    assert number is not None
    return difference(image, draw_pattern((image.shape[1], image.shape[0]), number))


@pytest.fixture
def reading(session: Session, tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen[bytes]]]:
    """Starts a reader that ends with the test."""
    started: list[subprocess.Popen[bytes]] = []

    def start(caps: str = "video/x-raw,format=I420", name: str = "reader") -> subprocess.Popen[bytes]:
        started.append(session.spawn(*gstreamer(caps, tmp_path / name)))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.communicate()


def test_the_session_finds_a_camera_with_our_name(session: Session, camera: StartCamera) -> None:
    camera()
    properties = wait_for(lambda: found(session), "the camera in pw-dump")
    assert properties["media.class"] == "Video/Source"
    assert properties["media.role"] == "Camera"
    assert properties["node.description"] == LABEL
    formats = properties["params"]["EnumFormat"]
    assert [each["format"] for each in formats] == ["I420", "BGRx"]
    for each in formats:
        assert each["size"] == {"width": SIZE[0], "height": SIZE[1]}
        assert each["framerate"] == {"num": 30, "denom": 1}
        assert {"colorRange", "colorMatrix", "transferFunction", "colorPrimaries"} <= each.keys()


@pytest.mark.parametrize("size", [SIZE, LARGE], ids=["small", "large"])
def test_gstreamer_reads_the_right_pixels(
    session: Session, camera: StartCamera, tmp_path: Path, size: tuple[int, int], suite: str, note_row: Notes
) -> None:
    camera("--width", size[0], "--height", size[1])
    wait_for(lambda: found(session), "the camera in pw-dump")
    planar = rgb_of_i420(read(session, "video/x-raw,format=I420", tmp_path / "i420"), size)
    assert all(after > before for before, after in pairwise(numbers_of(planar)))
    packed = read(session, "video/x-raw,format=BGRx", tmp_path / "bgrx").reshape(-1, size[1], size[0], 4)
    images = [np.ascontiguousarray(image[..., 2::-1]) for image in packed]
    assert len(planar) == len(images) == 8
    worst = max(map(worst_of, planar)), max(map(worst_of, images))
    assert worst[0] <= WITHIN
    assert worst[1] == 0
    width, height = size
    row = (suite, f"GStreamer, {width}x{height}", f"I420 {worst[0]}, BGRx {worst[1]}")
    note_row("readers of the camera in PipeWire", row)


def test_a_reader_leaves_and_another_comes(
    session: Session, camera: StartCamera, reading: Callable[..., subprocess.Popen[bytes]], tmp_path: Path
) -> None:
    shown = camera()
    shown.wait_for("nobody reads", readers=0, wanted=False)
    wait_for(lambda: found(session), "the camera in pw-dump")
    process = reading()
    told = shown.wait_for("one reads", readers=1, wanted=True)
    assert any("gst" in name for name in told["names"]), told
    process.send_signal(signal.SIGINT)
    shown.wait_for("nobody reads", readers=0)
    shown.wait_for("the webcam is let go of", wanted=False)
    # After five seconds without a reader the session manager has taken the buffers away.
    assert max(map(worst_of, rgb_of_i420(read(session, "video/x-raw,format=I420", tmp_path / "again"), SIZE))) <= WITHIN
    shown.wait_for("nobody reads", readers=0)


def test_two_read_at_once_and_one_that_stops_holds_up_nobody(
    session: Session, camera: StartCamera, reading: Callable[..., subprocess.Popen[bytes]], tmp_path: Path
) -> None:
    shown = camera()
    wait_for(lambda: found(session), "the camera in pw-dump")
    stopped = reading(name="stopped")
    shown.wait_for("one reads", readers=1)
    wait_for(lambda: (tmp_path / "stopped").stat().st_size > 0, "its first picture")
    stopped.send_signal(signal.SIGSTOP)
    number = shown.last["number"]
    wait_for(lambda: shown.last["number"] > number + 30, "the camera to go on")
    assert not shown.last["error"]
    stopped.send_signal(signal.SIGCONT)
    reading("video/x-raw", name="second")
    shown.wait_for("two read", readers=2)
    wait_for(lambda: (tmp_path / "second").exists() and (tmp_path / "second").stat().st_size > 10**6, "its pictures")


def test_the_session_restarts_and_the_camera_comes_back(session: Session, camera: StartCamera, tmp_path: Path) -> None:
    shown = camera()
    shown.wait_for("published", readers=0)
    session.stop()
    told = wait_for(lambda: shown.last if shown.last["error"] else None, "the end of the session")
    assert told is not None
    assert "PipeWire session" in told["error"]
    assert told["sink"] == "camera"
    session.start()
    shown.wait_for("published again", error=None, sink="camera PipeWire")
    wait_for(lambda: found(session), "the camera in pw-dump")
    assert len(numbers_of(rgb_of_i420(read(session, "video/x-raw,format=I420", tmp_path / "after"), SIZE))) == 8


def test_a_camera_that_is_killed_is_gone_and_another_takes_its_place(
    session: Session, camera: StartCamera, reading: Callable[..., subprocess.Popen[bytes]], tmp_path: Path
) -> None:
    first = camera()
    wait_for(lambda: found(session), "the camera in pw-dump")
    reading()
    first.wait_for("one reads", readers=1)
    first.process.kill()
    wait_for(lambda: found(session) is None, "the killed camera to go")
    camera("--sink", "camera").wait_for("published", sink="camera PipeWire", error=None)
    wait_for(lambda: found(session), "the second camera in pw-dump")
    read(session, "video/x-raw,format=BGRx", tmp_path / "second")
