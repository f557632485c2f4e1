"""What is asked for before the webcam: in its order, until it is covered or for some seconds."""

from __future__ import annotations

import pytest

from relit_camera.base.images.image_types import Frame
from relit_camera.capture.expressions.film_tracking import FaceCollection
from relit_camera.capture.expressions.live_prompts import NEUTRAL, PROMPTS, TUNABLES, LiveCoverage, PromptSequence
from relit_camera.capture.expressions.still_selection import COVERAGE
from tests.capture.expressions.obedient_person import PersonTracker, picture


def test_everything_that_stills_may_show_is_asked_for() -> None:
    assert list(PROMPTS) == [NEUTRAL, *(item.name for item in COVERAGE)]
    assert all(PROMPTS.values())


def test_a_prompt_is_over_when_what_it_asks_for_is_covered() -> None:
    prompts = PromptSequence()
    prompts.update(0.0, [])
    assert prompts.name == NEUTRAL
    prompts.update(0.1, [NEUTRAL])
    assert prompts.name == COVERAGE[0].name
    prompts.update(0.2, [NEUTRAL, COVERAGE[0].name, COVERAGE[1].name])
    assert prompts.name == COVERAGE[2].name
    assert prompts.share == 3 / len(PROMPTS)


def test_a_prompt_is_over_after_some_seconds_in_which_a_face_was_there() -> None:
    prompts = PromptSequence()
    prompts.update(0.0, [])
    prompts.update(100.0, [])  # nobody was there meanwhile
    assert prompts.name == NEUTRAL
    for index in range(round(10 * TUNABLES.longest_s) + 1):
        prompts.update(100 + index / 10, [])
    assert prompts.name == COVERAGE[0].name


def test_all_are_over_in_the_end() -> None:
    prompts = PromptSequence()
    prompts.update(0.0, list(PROMPTS))
    assert prompts.name is None
    assert prompts.share == 1


def test_what_turns_out_not_to_be_covered_is_asked_for_again() -> None:
    prompts = PromptSequence()
    prompts.update(0.0, list(PROMPTS)[:3])
    assert prompts.name == list(PROMPTS)[3]
    prompts.update(0.1, list(PROMPTS)[:2])
    assert prompts.name == list(PROMPTS)[2]


@pytest.mark.slow
def test_what_is_covered_is_judged_anew_when_the_neutral_face_is_known_better() -> None:
    """Whoever looks aside while they are asked to look ahead is not turned when they do."""
    doing = "turned right"
    tracker = PersonTracker(lambda: doing)
    faces = FaceCollection(tracker.scheme, "talk")
    coverage = LiveCoverage(faces)

    def see(first: int, count: int) -> None:
        for index in range(first, first + count):
            frame = Frame(picture(), index, index / 10, index / 10)
            face = faces.add(frame, tracker.track(frame))
            assert face is not None
            coverage.update(face, neutral_due=True)

    see(0, 30)
    doing = NEUTRAL
    see(30, 5)
    assert "turned left" in coverage.covered  # from where they looked first
    see(35, 60)
    assert "turned left" not in coverage.covered
    assert "turned right" in coverage.covered
