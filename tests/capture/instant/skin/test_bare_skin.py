"""A beard is dark skin in the same light: it is left out where the light is told, and found nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.array_types import Float32Array
from relit_camera.capture.instant.room_light import fit_room_light
from relit_camera.capture.instant.skin.bare_skin import below_nose, find_bare_skin
from tests.capture.instant.canonical_person import canonical_landmarks, canonical_pose
from tests.capture.instant.lit_person import SIDE, field_of, person, window
from tests.capture.instant.lit_person import SKIN as ALBEDO

HALF = SIDE // 2
BEARD = 0.2
"""Albedo of the beard, relative to the skin's."""


@pytest.fixture(scope="module")
def below() -> np.ndarray:
    """What lies below the nose of the generic head."""
    return below_nose(canonical_landmarks(canonical_pose(HALF, pixels_per_cm=1.5), HALF), (HALF, HALF))


def picture(light: Float32Array, bearded: np.ndarray | None = None) -> Float32Array:
    """The generic head in a light, darker where it is bearded; at half the resolution."""
    seen = field_of(ALBEDO).pictures(light[None])[0].reshape(HALF, 2, HALF, 2, 3).mean(axis=(1, 3))
    if bearded is not None:
        seen[bearded] *= BEARD
    return np.asarray(seen, np.float32)


def test_below_the_nose_is_below_it_however_the_head_is_tilted(below: np.ndarray) -> None:
    landmarks = canonical_landmarks(canonical_pose(HALF, pixels_per_cm=1.5), HALF)
    assert not below[: int(landmarks[2, 1]) - 1].any()
    assert below[int(landmarks[2, 1]) + 2 :].all()
    lying = np.stack([HALF - landmarks[:, 1], landmarks[:, 0]], axis=1)  # a quarter turn, the chin at the left
    turned = below_nose(lying.astype(np.float32), (HALF, HALF))
    np.testing.assert_array_equal(turned, np.rot90(below, -1))


@pytest.mark.parametrize(("azimuth", "elevation"), [(0, 10), (-60, 20), (20, 60)])
def test_a_beard_is_found_and_the_light_is_what_it_was(below: np.ndarray, azimuth: float, elevation: float) -> None:
    shape, response = person()
    light = window(azimuth, elevation)
    seen = picture(light, below)
    bare = find_bare_skin(response, seen, shape.skin, below, ALBEDO)
    assert not (bare & below).any()
    assert (bare & ~below).sum() > 0.85 * (shape.skin & ~below).sum()  # but a row beside it
    clean = field_of(ALBEDO).pictures(light[None])[0]
    wrong = []
    for skin in (bare, shape.skin):
        relit = field_of(ALBEDO).pictures(fit_room_light(response, seen, skin, ALBEDO)[None])[0]
        inside = shape.skin.repeat(2, axis=0).repeat(2, axis=1)
        wrong.append(float(np.abs(relit - clean)[inside].mean() / clean[inside].mean()))
    assert wrong[0] < 0.12
    assert wrong[0] < 0.5 * wrong[1]


@pytest.mark.parametrize(("azimuth", "elevation"), [(0, 10), (-85, 5), (85, 5), (10, 70), (0, -40)])
def test_nobody_gets_a_beard_from_a_harsh_light(below: np.ndarray, azimuth: float, elevation: float) -> None:
    shape, response = person()
    seen = picture(window(azimuth, elevation, 20, around=0.02))
    bare = find_bare_skin(response, seen, shape.skin, below, ALBEDO)
    np.testing.assert_array_equal(bare, shape.skin)
