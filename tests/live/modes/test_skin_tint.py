"""How a person's skin differs from that of the head that is nobody's."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.images.color import uint8_from_linear
from relit_camera.capture.instant.anyone import anyone
from relit_camera.face.skin_prior import skin_of_luminance
from relit_camera.live.modes.face_lighting import LOOK_S, TINT_S, SkinTint
from tests.live.people import face_of

LIGHT = 0.7
"""On the face, of a picture that is exposed to a mid gray."""


def tint() -> SkinTint:
    return SkinTint(anyone(), face_of(anyone()))


def seen(level: float, count: int = 300) -> np.ndarray:
    """Linear values of skin of that luminance."""
    return (LIGHT * skin_of_luminance(level)).astype(np.float32)[None].repeat(count, axis=0)


def room(level: float = 0.18) -> np.ndarray:
    return uint8_from_linear(np.full((90, 160, 3), level, np.float32))


def factor(made: SkinTint, level: float, time_s: float = 0.0) -> float:
    return float(made.update(room(), seen(level), time_s).mean())


def test_darker_skin_has_a_smaller_factor_by_about_as_much() -> None:
    light, dark = factor(tint(), 0.4), factor(tint(), 0.06)
    assert light > 1 > dark
    assert dark / light == pytest.approx(0.06 / 0.4, rel=0.7)


def test_a_cast_of_the_light_is_hardly_taken_for_the_skin_s() -> None:
    red = seen(0.2) * np.array([1.6, 1.0, 0.6], np.float32)
    plain, cast = (tint().update(room(), each, 0.0) for each in (seen(0.2), red))
    assert np.abs(np.log(cast / plain)).max() < 0.35


def test_it_is_eased_and_the_first_look_counts_at_once() -> None:
    made = tint()
    before = factor(made, 0.4)
    assert before == pytest.approx(factor(tint(), 0.4))
    goal = factor(tint(), 0.06)
    soon, late = factor(made, 0.06, LOOK_S), 0.0
    for step in range(2, int(5 * TINT_S / LOOK_S)):
        late = factor(made, 0.06, step * LOOK_S)
    assert abs(np.log(soon / before)) < 0.2 * abs(np.log(goal / before))
    assert late == pytest.approx(goal, rel=0.05)


def test_a_hidden_face_changes_nothing() -> None:
    made = tint()
    np.testing.assert_array_equal(made.update(room(), seen(0.06, 3), 0.0), np.ones(3))
    before = factor(made, 0.4, 1.0)
    assert float(made.update(room(), seen(0.06, 3), 9.0).mean()) == before
