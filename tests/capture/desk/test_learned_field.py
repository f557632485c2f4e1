"""The learned desk field: two answers, what the network sees of them, and what it may do to them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array
from relit_camera.base.errors import CaptureError
from relit_camera.base.images.color import luminance
from relit_camera.capture.desk.person import learned_field
from relit_camera.capture.desk.person.learned_field import (
    BELIEVED,
    LearnedField,
    TwoAnswers,
    input_signs,
    learned_network,
    mixture,
    two_answers,
    with_learned_field,
)
from relit_camera.capture.desk.person.patch_light import place_patches
from relit_camera.capture.instant.response.learned_response import LEAST_SHARE
from relit_camera.lab.evaluate.desk_simulation import MONITOR
from relit_camera.subject.reflectance_field import texel_vectors
from tests.capture.instant.canonical_person import canonical_landmarks, canonical_pose, person_matte

SIDE = 64
COLOR = np.array([0.4, 0.25, 0.2], np.float32)
TOWARD = place_patches(MONITOR).directions
LANDMARKS = canonical_landmarks(canonical_pose(SIDE, pixels_per_cm=1.5), SIDE)
MATTE = person_matte(SIDE, 1.5)


@dataclass(frozen=True)
class FlatField:
    """A field of pixels that all answer alike, most to light from before them."""

    color: Float32Array = field(default_factory=lambda: COLOR)
    size: tuple[int, int] = (SIDE, SIDE)

    def at(self, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Float32Array:
        """R of row-major pixels (some,) under unit vectors (count, 3): (count, some, 3)."""
        seen = (1 + directions[:, 2]) / 2
        return np.asarray(seen[:, None, None] * np.broadcast_to(self.color, (len(pixels), 3)), np.float32)

    def dense(self, start: int, stop: int) -> Float32Array:
        """R of the pixels [start, stop): (stop − start, 2048, 3)."""
        return self.at(texel_vectors(), np.arange(start, stop)).transpose(1, 0, 2)


@lru_cache(maxsize=1)
def answers() -> TwoAnswers:
    return two_answers(FlatField(), TOWARD, LANDMARKS, MATTE)


def learned(share: float, harmonic: float, monkeypatch: pytest.MonkeyPatch) -> LearnedField:
    """The field by a network that says the same everywhere: a logit, and an amount of the first harmonic."""
    known = learned_network()
    weights, _ = known.layers[-1]
    said = np.zeros(10, np.float32)
    said[0], said[-1] = harmonic, share
    steady = replace(known, layers=(*known.layers[:-1], (0 * weights, said)))
    monkeypatch.setattr(learned_field, "learned_network", lambda: steady)
    return with_learned_field(FlatField(), TOWARD, LANDMARKS, np.ones((SIDE, SIDE), np.float32), MATTE)


def inside() -> Any:
    """Some pixels in a row of the person."""
    rows = np.flatnonzero(MATTE.ravel() > 0.9)
    return rows[rows // SIDE == SIDE // 2]


def test_the_painted_head_is_as_bright_as_what_was_measured() -> None:
    found = answers()
    nearest = (TOWARD @ texel_vectors().T).argmax(axis=1)
    weights = np.zeros((2048, len(TOWARD)), np.float32)
    weights[nearest, np.arange(len(TOWARD))] = 1 / len(TOWARD)
    level = FlatField().at(TOWARD, np.array([0])).mean()
    sent = found.painted.answer(np.full(len(found.pixels), level, np.float32), weights).sum(axis=1)
    lit = found.painted.front > 0.1
    assert lit.mean() > 0.8
    np.testing.assert_allclose(sent[lit], level, rtol=1e-3)


def test_the_network_sees_both_answers_and_no_color() -> None:
    seen = answers().inputs
    assert seen.shape == (len(answers().pixels), len(input_signs()))
    # The first harmonic of (1 + z) / 2, over what it is under the patches.
    under_patches = ((1 + TOWARD[:, 2]) / 2).mean()
    np.testing.assert_allclose(seen[:, 12], np.sqrt(4 * np.pi) / 2 / under_patches, rtol=0.01)
    np.testing.assert_allclose(seen[:, 21], 0, atol=1e-5)
    assert np.unique(np.sign(input_signs())).tolist() == [-1, 1]


def test_the_color_of_skin_is_not_seen() -> None:
    gray = np.full(3, luminance(COLOR[None])[0], np.float32)
    np.testing.assert_allclose(
        two_answers(FlatField(gray), TOWARD, LANDMARKS, MATTE).inputs, answers().inputs, atol=1e-4
    )


def test_the_mirrored_person_is_seen_with_left_and_right_changed() -> None:
    """The generic head is nearly the same on both sides, but not to the pixel."""
    landmarks = canonical_landmarks(canonical_pose(SIDE, pixels_per_cm=1.5, yaw_deg=8), SIDE)
    mirrored = canonical_landmarks(canonical_pose(SIDE, pixels_per_cm=1.5, yaw_deg=-8), SIDE)
    seen, other = (two_answers(FlatField(), TOWARD, each, MATTE) for each in (landmarks, mirrored))
    half = SIDE // 2
    y, x = np.divmod(seen.painted.response.pixels, half)
    place = {pixel: row for row, pixel in enumerate(other.painted.response.pixels.tolist())}
    pairs = [(row, place[q]) for row, q in enumerate((y * half + half - 1 - x).tolist()) if q in place]
    ours, theirs = np.array(pairs).T
    odd = input_signs() < 0
    ours, theirs = seen.inputs[ours][:, odd], other.inputs[theirs][:, odd]
    for place_or_harmonic in range(3):  # to the right; of degree 1 and 2 of the painted head
        one, another = ours[:, place_or_harmonic], theirs[:, place_or_harmonic]
        assert np.median(np.abs(one + another)) < 0.3 * np.median(np.abs(one))


def test_half_of_what_the_network_says_is_done() -> None:
    told, said = mixture(answers().inputs), learned_network().outputs(answers().inputs)
    np.testing.assert_allclose(told.added, said[:, :-1] / 2, atol=1e-6)
    np.testing.assert_allclose(told.share, (1 + 1 / (1 + np.exp(-said[:, -1]))) / 2, atol=1e-6)


def test_a_picture_without_skin_or_half_is_refused() -> None:
    with pytest.raises(CaptureError, match="no bare skin"):
        two_answers(FlatField(0 * COLOR), TOWARD, LANDMARKS, MATTE)
    with pytest.raises(ValueError, match="no half size"):
        two_answers(FlatField(), TOWARD, LANDMARKS, MATTE[:, :-1])


def test_where_it_trusts_the_measured_field_and_adds_nothing_that_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    same = learned(30.0, 0.0, monkeypatch)
    pixels = inside()
    found = same.dense(pixels[0], pixels[-1] + 1)[pixels - pixels[0]]
    np.testing.assert_allclose(found, FlatField().at(texel_vectors(), pixels).transpose(1, 0, 2), atol=1e-5)


def test_where_it_does_not_half_of_the_painted_head_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    mixed = learned(-30.0, 0.0, monkeypatch)
    pixel = int(inside()[len(inside()) // 2])
    painted = mixed.painted.rows(np.array([pixel]))
    half = painted + (1 - BELIEVED) * (FlatField().dense(pixel, pixel + 1) - painted)
    np.testing.assert_allclose(mixed.dense(pixel, pixel + 1), half, atol=1e-5)


def test_what_it_takes_away_is_never_all(monkeypatch: pytest.MonkeyPatch) -> None:
    dark = learned(30.0, -50.0, monkeypatch)
    pixels = inside()
    found = dark.dense(pixels[0], pixels[-1] + 1)[pixels - pixels[0]]
    measured = FlatField().at(texel_vectors(), pixels).transpose(1, 0, 2)
    np.testing.assert_allclose(found, LEAST_SHARE * measured, atol=1e-5)


def test_what_is_no_skin_stays_as_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    learned(-30.0, 3.0, monkeypatch)
    found = with_learned_field(FlatField(), TOWARD, LANDMARKS, np.zeros((SIDE, SIDE), np.float32), MATTE)
    shirt = int(np.flatnonzero(MATTE.ravel() > 0.9)[-SIDE // 2])
    np.testing.assert_allclose(found.dense(shirt, shirt + 1), FlatField().dense(shirt, shirt + 1), atol=1e-5)
    face = SIDE // 2 * SIDE + SIDE // 2
    assert np.abs(found.dense(face, face + 1) - FlatField().dense(face, face + 1)).max() > 0.05
