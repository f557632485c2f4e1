"""Correction of the near field, and strengths of flashes, against formulas."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from relit_camera.capture.film.olat.flash_strength import estimate_flash_strengths
from relit_camera.capture.film.olat.near_field import CaptureLamp, Surface, distant_light_factor, near_field_irradiance
from relit_camera.light.directions import direction_from_degrees
from tests.capture.film.generated_film import Film

SIDE = 96


def film_pictures(film: Film, indices: range, near: bool = True) -> np.ndarray:
    """Flashes alone, cut to the person and small: (count, SIDE, SIDE, 3)."""
    cut = [film.flash(index, near)[60:270, 0:210].astype(np.float32) for index in indices]
    return np.stack([cv2.resize(each, (SIDE, SIDE), interpolation=cv2.INTER_AREA) for each in cut])


def film_matte(film: Film) -> np.ndarray:
    """The person in those pictures (SIDE, SIDE)."""
    return cv2.resize(film.surface[2][60:270, 0:210].astype(np.float32), (SIDE, SIDE), interpolation=cv2.INTER_AREA)


def test_light_falls_with_the_square_of_the_distance_and_off_the_axis() -> None:
    points = np.array([[[0, 0, 0], [0, 0, 10], [30, 0, 0]]], np.float32)
    surface = Surface(np.tile(np.array([0, 0, 1], np.float32), (1, 3, 1)), points)
    toward, light = near_field_irradiance(surface, CaptureLamp(np.array([0.0, 0.0, 100.0]), np.zeros(3)))
    np.testing.assert_allclose(light, [[1, (100 / 90) ** 2, (100**2 / (100**2 + 30**2)) ** 2]], rtol=1e-5)
    np.testing.assert_allclose(toward[0, 2], np.array([-30, 0, 100]) / np.hypot(30, 100), atol=1e-6)


def test_a_picture_under_a_near_lamp_becomes_one_under_a_distant_lamp() -> None:
    film = Film()
    normals, points, person = film.surface
    surface = Surface(normals.astype(np.float32), points.astype(np.float32))
    for index in (40, 120, 200):
        lamp = film.lamp_cm(index)
        wanted = film.flash(index, near=False)
        near = film.flash(index) * (np.linalg.norm(lamp) / film.distance_cm) ** 2
        lit = person & (normals @ lamp > 0.5 * np.linalg.norm(lamp))
        as_is = np.abs(near[lit] / wanted[lit] - 1)
        corrected = np.abs(
            (near * distant_light_factor(surface, CaptureLamp(lamp, np.zeros(3)))[..., None])[lit] / wanted[lit] - 1
        )
        assert corrected.mean() < 0.03 < 0.08 < as_is.mean()


@pytest.mark.slow
def test_strengths_are_recovered() -> None:
    film = Film(frames=60)
    indices = range(60)
    pictures = film_pictures(film, indices)
    scale, matte = SIDE / 210, film_matte(film)
    lamps = np.stack([film.lamp_cm(index) for index in indices])
    # Where the lamp is nearer, it is not known.
    known = 100 * lamps / np.linalg.norm(lamps, axis=1, keepdims=True)
    found = estimate_flash_strengths(pictures, known, matte, (105 * scale, 90 * scale), 52 / 9.5 * scale)
    truth = np.log([film.strength(index) for index in indices])
    error = np.log(found.strength) - truth
    assert np.std(error) < 0.35 * np.std(truth)
    assert np.median(found.strength) == pytest.approx(1, rel=1e-3)
    assert np.median(found.misfit) < 0.05


@pytest.mark.slow
def test_flashes_that_light_no_skin_do_not_affect_others() -> None:
    film, spoilt = Film(frames=60), [10, 30]
    pictures = film_pictures(film, range(60))
    lamps = np.stack([film.lamp_cm(index) for index in range(60)])
    pictures[10] = 0
    lamps[30] = (0, 0, -100)
    scale = SIDE / 210
    found = estimate_flash_strengths(pictures, lamps, film_matte(film), (105 * scale, 90 * scale), 52 / 9.5 * scale)
    others = np.setdiff1d(range(60), spoilt)
    assert np.all(np.isinf(found.misfit[spoilt]) & (found.strength[spoilt] == 1))
    assert np.median(found.misfit[others]) < 0.05
    assert np.median(found.strength[others]) == pytest.approx(1, rel=1e-3)
    np.testing.assert_array_equal(found.consistent(np.inf), others)


def test_without_lit_skin_no_flash_is_consistent() -> None:
    film = Film(frames=60)
    lamps = np.stack([film.lamp_cm(index) for index in range(0, 60, 6)])
    dark = np.zeros((len(lamps), SIDE, SIDE, 3), np.float32)
    found = estimate_flash_strengths(dark, lamps, film_matte(film), (SIDE / 2, SIDE / 2), 2.5)
    assert np.all(found.strength == 1)
    assert len(found.consistent(3.0)) == 0


def test_the_direction_of_a_lamp_far_away_is_the_same_everywhere() -> None:
    surface = Surface(
        np.tile(np.array([0, 0, 1], np.float32), (4, 4, 1)),
        np.random.default_rng(0).uniform(-9, 9, (4, 4, 3)).astype(np.float32),
    )
    np.testing.assert_allclose(
        distant_light_factor(surface, CaptureLamp(1e5 * direction_from_degrees(20, 30), np.zeros(3))), 1, atol=1e-3
    )


@pytest.mark.slow
def test_the_tilt_of_a_lamp_that_points_beside_the_head() -> None:
    film = Film(frames=60)
    pictures = film_pictures(film, range(60))
    scale, matte = SIDE / 210, film_matte(film)
    lamps = np.stack([film.lamp_cm(index) for index in range(60)])
    # Of one flash, brighter to the right by so much a radian.
    right = (np.arange(SIDE) + 0.5 - 105 * scale) / (52 / 9.5 * scale) / 100
    pictures[30] *= np.exp(0.8 * right)[None, :, None].astype(np.float32)
    found = estimate_flash_strengths(pictures, lamps, matte, (105 * scale, 90 * scale), 52 / 9.5 * scale)
    tilts = np.array([lamp.tilt[0] for lamp in found.lamps])
    assert tilts[30] - np.median(tilts) == pytest.approx(0.8, abs=0.3)
    assert np.abs(np.delete(tilts, 30) - np.median(tilts)).max() < 0.35
