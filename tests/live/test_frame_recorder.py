"""Recording frames beside the camera, in virtual time."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.images.image_types import Frame
from relit_camera.live.frame_recorder import FrameRecorder
from tests.virtual_clock import VirtualClock

FPS = 30.0
SIDE_PX = 64


@pytest.fixture
def clock() -> VirtualClock:
    return VirtualClock()


@pytest.fixture
def recorder(clock: VirtualClock) -> FrameRecorder:
    """A recorder that is offered thirty frames a second."""
    recorder = FrameRecorder(clock)
    indices = iter(range(1_000_000))

    def frame() -> None:
        recorder.offer(Frame(np.zeros((2, 2, 3), np.uint8), next(indices), clock.now(), 0.0))

    clock.every(1 / FPS, frame)
    return recorder


def test_it_takes_so_many_frames_so_far_apart(recorder: FrameRecorder, clock: VirtualClock) -> None:
    began = clock.now()
    frames = recorder.record(10, 0.1, 5.0)
    times = np.array([frame.captured_at for frame in frames])
    assert len(frames) == 10
    assert (np.diff(times) >= 0.1 - 1e-9).all()
    assert clock.now() - began == pytest.approx(9 * 4 / FPS, abs=0.1)


def test_time_that_is_up_ends_it_with_fewer(recorder: FrameRecorder) -> None:
    assert len(recorder.record(100, 0.0, 1.0)) == pytest.approx(FPS, abs=1)


def test_it_ends_soon_after_it_shall_not_go_on(recorder: FrameRecorder, clock: VirtualClock) -> None:
    began = clock.now()
    assert recorder.record(1000, 0.0, 60.0, lambda: clock.now() < began + 2.0)
    assert 2.0 <= clock.now() - began < 2.5


def test_without_frames_it_gives_none(clock: VirtualClock) -> None:
    assert FrameRecorder(clock).record(3, 0.0, 1.0) == []


def test_nothing_is_kept_while_nobody_records(recorder: FrameRecorder, clock: VirtualClock) -> None:
    recorder.record(3, 0.0, 1.0)
    clock.sleep(1.0)
    first = recorder.record(1, 0.0, 1.0)[0]
    assert first.captured_at > clock.now() - 0.1


def test_larger_frames_are_kept_reduced(recorder: FrameRecorder, clock: VirtualClock) -> None:
    large = FrameRecorder(clock)
    clock.every(1 / FPS, lambda: large.offer(Frame(np.full((90, 160, 3), 7, np.uint8), 0, clock.now(), 0.0)))
    [frame] = large.record(1, 0.0, 1.0, longest_side_px=SIDE_PX)
    assert frame.image.shape == (36, SIDE_PX, 3)
    assert (frame.image == 7).all()
    assert recorder.record(1, 0.0, 1.0, longest_side_px=SIDE_PX)[0].image.shape == (2, 2, 3)
