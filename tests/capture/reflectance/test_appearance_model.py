"""The per-pixel appearance model: it finds again what it is made of, whatever else is in the pictures."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.capture.reflectance.appearance_model import (
    SPECULAR_TERMS,
    TERM_COUNT,
    SpecularEstimate,
    appearance_terms,
    distant_terms,
    fit_appearance,
)
from tests.lab.lit_sphere import cap, lambert

LIGHTS = 60
PIXELS = 40


def as_float32(values: NDArray[np.float64]) -> NDArray[np.float32]:
    return values.astype(np.float32)


@pytest.fixture
def terms() -> NDArray[np.float32]:
    random = np.random.default_rng(3)
    normals = random.normal(size=(PIXELS, 3)) + [0, 0, 4]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    directions = cap(LIGHTS - 16, 70)
    halves = directions + [0, 0, 1]
    halves /= np.linalg.norm(halves, axis=1, keepdims=True)
    margins = random.uniform(-0.5, 1.5, (len(directions), PIXELS))
    cosines, half_cosines = normals @ directions.T, normals @ halves.T
    return appearance_terms(
        as_float32(cosines), as_float32(half_cosines), as_float32(margins.T), as_float32(directions[:, 2])
    )


def test_amounts_are_found_again(terms: NDArray[np.float32]) -> None:
    amounts = np.random.default_rng(5).uniform(0.05, 0.5, (PIXELS, 3, TERM_COUNT)).astype(np.float32)
    amounts[..., SPECULAR_TERMS] = amounts[:, :1, SPECULAR_TERMS]
    values = amounts @ terms
    found, _ = fit_appearance(terms, values, 1.0)
    fitted = found @ terms
    assert np.sqrt(np.mean((fitted - values) ** 2)) < 0.01
    # What tells terms apart is little for some pixels; the amounts as a whole are right.
    assert np.median(np.abs(found - amounts)) < 0.05


def test_highlights_have_the_lights_colour(terms: NDArray[np.float32]) -> None:
    amounts = np.random.default_rng(5).uniform(0.05, 0.5, (PIXELS, 3, TERM_COUNT)).astype(np.float32)
    found, gloss = fit_appearance(terms, amounts @ terms, 1.0)
    for channel in range(3):
        np.testing.assert_array_equal(found[:, channel, SPECULAR_TERMS], gloss.amounts)


def test_where_no_light_tells_a_highlight_the_expected_one_stands(terms: NDArray[np.float32]) -> None:
    amounts = np.zeros((PIXELS, 3, TERM_COUNT), np.float32)
    amounts[..., 0], amounts[..., SPECULAR_TERMS] = 0.5, 0.3
    hidden = terms.copy()
    hidden[:, SPECULAR_TERMS] *= 1e-3
    expected = SpecularEstimate(np.full((PIXELS, 2), 0.2, np.float32), np.full((PIXELS, 2), 30, np.float32))
    told = terms[:, SPECULAR_TERMS].max(axis=2).min(axis=1) > 0.9
    assert told.any()
    for seen, hoped, where in ((terms, 0.3, told), (hidden, 0.2, np.ones_like(told))):
        _, gloss = fit_appearance(seen, amounts @ seen, 1.0, expected)
        np.testing.assert_allclose(gloss.amounts[where], hoped, atol=0.05)


def test_no_amount_is_negative_though_the_pictures_ask_for_it(terms: NDArray[np.float32]) -> None:
    values = np.repeat((0.5 - terms[:, :1]).clip(0), 3, axis=1)
    found, _ = fit_appearance(terms, values, 1.0)
    assert found.min() >= 0


def test_a_few_pictures_that_are_wrong_do_not_count(terms: NDArray[np.float32]) -> None:
    amounts = np.zeros((PIXELS, 3, TERM_COUNT), np.float32)
    amounts[..., 0] = 0.6
    values = amounts @ terms
    wrong = values.copy()
    wrong[..., ::12] = 1.5

    def error(seen: NDArray[np.float32]) -> float:
        fitted = fit_appearance(terms, seen, 1.0)[0] @ terms
        return float(np.sqrt(np.mean((fitted - values) ** 2)))

    assert error(values) < 0.005
    # Plain least squares is off by 0.19 here.
    assert error(wrong) < 0.03


def one(cosine: float, half: float, margin: float, toward_camera: float) -> NDArray[np.float32]:
    """The terms (TERMS,) of one light at one pixel."""
    single = [np.full((1, 1), value, np.float32) for value in (cosine, half, margin)]
    return appearance_terms(single[0], single[1], single[2], np.full(1, toward_camera, np.float32))[0, :, 0]


def test_what_stands_below_the_horizon_is_dark_but_for_the_light_of_the_surroundings() -> None:
    above, below = one(0.9, 0.9, 0.5, 1.0), one(0.9, 0.9, -0.5, 1.0)
    np.testing.assert_allclose(above, [0.9, (14 / 15) ** 2, 0.9**13, 0.9**61, 1], rtol=1e-3)
    np.testing.assert_allclose(below, [0, 0, 0, 0, 1], atol=1e-3)


def test_highlights_grow_toward_light_from_behind_and_the_surroundings_go_dark() -> None:
    front, side, behind = (one(0.3, 1.0, 1.0, toward) for toward in (1.0, 0.0, -0.8))
    assert front[2] < side[2] < behind[2]
    # Fresnel's factor of index 1.4 at 45 degrees is 1.07, by Schlick 1.075; the rest is geometry.
    assert side[2] / front[2] == pytest.approx(2 * 1.075, rel=0.01)
    assert front[4] == pytest.approx(1)
    assert side[4] == pytest.approx(1 / np.pi)
    assert one(0.3, 1.0, 1.0, -1.0)[4] == pytest.approx(0, abs=1e-6)


def test_a_light_straight_behind_is_no_number_that_is_not_one() -> None:
    samples = lambert(cap(40, 60))
    terms = distant_terms(samples.geometry, np.array([[0.0, 0.0, -1.0]]), np.arange(256))
    assert np.isfinite(terms).all()
    np.testing.assert_allclose(terms[:, 0], 0, atol=1e-6)
