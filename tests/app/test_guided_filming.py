"""Filming expression stills with prompts: what is asked, what is kept, and every way that it can end."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from relit_camera.app.captures.expression_capture import LIGHT_FRAMES
from relit_camera.app.captures.expressions.guided_filming import FilmedStills, FilmingState, GuidedFilming
from relit_camera.base.errors import CaptureError, DeviceError
from relit_camera.base.images.image_types import Frame
from relit_camera.capture.expressions.live_prompts import NEUTRAL, PROMPTS, TUNABLES
from relit_camera.capture.expressions.still_selection import COVERAGE
from relit_camera.live.frame_recorder import FrameRecorder
from relit_camera.subject.expression_stills import MAX_STILLS
from tests.capture.expressions.obedient_person import PersonTracker, picture
from tests.virtual_clock import VirtualClock


class Webcam:
    """A webcam at 30 frames a second before a person, in virtual time, and what was told."""

    def __init__(self, does: Callable[[str], str | None] = lambda asked: asked, brightness: int = 150) -> None:
        """`does` says what the person does when they are asked for something; None where they are away."""
        self.clock = VirtualClock()
        self.began = self.clock.now()
        self.recorder = FrameRecorder(self.clock)
        self.canceled = threading.Event()
        self.told: list[FilmingState] = []
        self.frame = Frame(picture(brightness), 7, 0.0, 0.0)
        self.clock.every(1 / 30, self._offer)
        self.filming = GuidedFilming(
            self.recorder, new_tracker=lambda: PersonTracker(lambda: does(self.asked)), clock=self.clock
        )

    @property
    def asked(self) -> str:
        return self.told[-1].prompt if self.told else NEUTRAL

    @property
    def seconds(self) -> float:
        return self.clock.now() - self.began

    def _offer(self) -> None:
        self.recorder.offer(replace(self.frame, captured_at=self.clock.now()))

    def film(self) -> FilmedStills:
        return self.filming.film(self.canceled, self.told.append)


def test_who_does_what_is_asked_is_done_in_half_a_minute_and_all_is_covered() -> None:
    webcam = Webcam()
    filmed = webcam.film()
    assert filmed.selection.covered == tuple(item.name for item in COVERAGE)
    assert webcam.seconds < 30
    asked = list(dict.fromkeys(state.prompt for state in webcam.told if state.prompt))
    assert asked[0] == NEUTRAL
    assert asked == [name for name in PROMPTS if name in asked]
    assert all(state.say == PROMPTS.get(state.prompt, "") for state in webcam.told)
    assert webcam.told[-1].covered == (NEUTRAL, *filmed.selection.covered)
    assert [state.progress for state in webcam.told] == sorted(state.progress for state in webcam.told)


def test_only_the_frames_that_stills_are_made_of_are_kept() -> None:
    filmed = Webcam().film()
    assert {face.index for face in filmed.selection.faces} <= set(filmed.frames)
    assert len(filmed.frames) <= MAX_STILLS + LIGHT_FRAMES < len(filmed.film.faces)
    assert list(filmed.frames) == sorted(filmed.frames)


def test_what_somebody_cannot_do_is_asked_for_some_seconds_and_passed_over() -> None:
    webcam = Webcam(lambda asked: NEUTRAL if asked == "jaw dropped" else asked)
    filmed = webcam.film()
    assert set(PROMPTS) - {NEUTRAL, *filmed.selection.covered} == {"jaw dropped"}
    assert filmed.selection.missing == ("open your mouth wide",)
    assert webcam.seconds < 30 + TUNABLES.longest_s


@pytest.mark.slow
def test_who_does_nothing_is_told_what_to_do() -> None:
    webcam = Webcam(lambda asked: NEUTRAL)
    with pytest.raises(CaptureError, match="does too little") as caught:
        webcam.film()
    assert "open your mouth wide" in caught.value.cure
    assert webcam.seconds < len(PROMPTS) * (TUNABLES.longest_s + 1)


def test_nobody_before_the_webcam_ends_it_soon_but_not_at_once() -> None:
    webcam = Webcam(lambda asked: None)
    with pytest.raises(CaptureError, match="no face is seen"):
        webcam.film()
    assert 5 < webcam.seconds < 15, "they may still be sitting down"
    assert not any(state.face for state in webcam.told)


def test_who_is_away_for_a_moment_is_not_counted_as_asked() -> None:
    webcam = Webcam()
    webcam.filming = GuidedFilming(
        webcam.recorder,
        new_tracker=lambda: PersonTracker(lambda: None if 5 < webcam.seconds < 13 else webcam.asked),
        clock=webcam.clock,
    )
    assert webcam.film().selection.covered == tuple(item.name for item in COVERAGE)
    assert not all(state.face for state in webcam.told)


@pytest.mark.parametrize(("brightness", "words"), [(8, "too dark")])
def test_a_face_that_cannot_be_used_is_told_at_once(brightness: int, words: str) -> None:
    webcam = Webcam(brightness=brightness)
    with pytest.raises(CaptureError, match=words):
        webcam.film()
    assert webcam.seconds < 5


def test_it_ends_when_it_is_canceled() -> None:
    webcam = Webcam()
    webcam.clock.at(4.0, webcam.canceled.set)
    with pytest.raises(CaptureError, match="canceled"):
        webcam.film()
    assert webcam.seconds < 5


def test_a_webcam_that_gives_nothing_is_told() -> None:
    clock = VirtualClock()
    filming = GuidedFilming(FrameRecorder(clock), new_tracker=lambda: PersonTracker(lambda: None), clock=clock)
    with pytest.raises(DeviceError, match="gives no frames"):
        filming.film(threading.Event(), lambda state: None)


def test_a_picture_of_another_size_ends_it() -> None:
    webcam = Webcam()
    other = replace(webcam.frame, image=np.zeros((240, 320, 3), np.uint8))
    webcam.clock.at(4.0, lambda: setattr(webcam, "frame", other))
    with pytest.raises(CaptureError, match="size"):
        webcam.film()
