"""What is shown in every state: of the mode that was chosen, and as filmed only where that is allowed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import pytest

from relit_camera.base.config.look import Mode
from relit_camera.live.publishing.what_is_shown import FacePresence, Rendering, Shown, Situation, what_is_shown

KINDS = {
    Mode.LIVE: {Shown.RELIT, Shown.LAST_LIGHT, Shown.PLACE_TINT, Shown.HELD, Shown.PLACEHOLDER, Shown.FILMED},
    Mode.PORTRAIT: {Shown.RELIT, Shown.AT_REST, Shown.HELD, Shown.PLACEHOLDER, Shown.FILMED},
}


def situations() -> Iterator[Situation]:
    either = (False, True)
    for state in product(Mode, FacePresence, either, either, either, Rendering, either, either, either):
        yield Situation(*state)


@pytest.mark.parametrize("mode", list(Mode))
def test_nothing_of_the_other_mode_is_ever_shown(mode: Mode) -> None:
    assert {what_is_shown(now) for now in situations() if now.mode is mode} == KINDS[mode]


def test_as_filmed_is_shown_only_where_it_is_allowed() -> None:
    filmed = [now for now in situations() if what_is_shown(now) is Shown.FILMED]
    assert filmed
    assert all(now.filmed_allowed for now in filmed)
    assert not any(now.has_subject and now.rendering is not Rendering.HAS_FAILED for now in filmed)


def test_somebody_elses_portrait_is_shown_only_where_that_is_allowed() -> None:
    """Not even at rest, held, or exchanged for the picture as filmed; in mode live nobody wears another's face."""
    for now in situations():
        known = replace(now, other_person=True, avatar_allowed=False)
        if now.mode is Mode.PORTRAIT and now.has_subject:
            assert what_is_shown(known) is Shown.PLACEHOLDER
        else:
            assert what_is_shown(known) is what_is_shown(replace(known, other_person=False))
        allowed = replace(now, other_person=True, avatar_allowed=True)
        unknown = replace(now, other_person=False, avatar_allowed=False)
        assert what_is_shown(allowed) is what_is_shown(unknown)


def test_that_it_is_allowed_changes_nothing_while_pictures_come() -> None:
    for now in situations():
        if now.has_subject and now.rendering is Rendering.WORKS:
            assert what_is_shown(now) is what_is_shown(replace(now, filmed_allowed=False))


def test_a_picture_that_can_be_relit_is_preferred_to_one_that_is_held_and_that_to_none() -> None:
    portrait = Situation(Mode.PORTRAIT, rendering=Rendering.FAILS)
    assert what_is_shown(replace(portrait, can_rest=True)) is Shown.AT_REST
    assert what_is_shown(portrait) is Shown.HELD
    assert what_is_shown(replace(portrait, rendering=Rendering.HAS_FAILED)) is Shown.PLACEHOLDER
    assert what_is_shown(replace(portrait, rendering=Rendering.HAS_FAILED, can_rest=True)) is Shown.AT_REST
