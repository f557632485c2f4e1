"""Light from behind is softened in an instant subject's field, light from the front is not."""

from __future__ import annotations

import numpy as np

from relit_camera.capture.instant.back_light import soften_back_light
from relit_camera.light.directions import texel_directions
from relit_camera.subject.rungs import SOFT_FROM_DEG

TOWARD = texel_directions().reshape(-1, 3)
FIELD = np.random.default_rng(3).random((5, len(TOWARD))).astype(np.float32)


def angles_from_camera() -> np.ndarray:
    return np.degrees(np.arccos(np.clip(TOWARD[:, 2], -1, 1)))


def test_lights_from_the_front_are_as_before() -> None:
    front = angles_from_camera() <= SOFT_FROM_DEG
    np.testing.assert_array_equal(soften_back_light(FIELD)[:, front], FIELD[:, front])


def test_even_light_is_as_before() -> None:
    even = np.full((1, len(TOWARD)), 0.7, np.float32)
    np.testing.assert_allclose(soften_back_light(even), even, rtol=1e-5)


def test_a_lamp_from_behind_is_seen_as_a_wide_one() -> None:
    """A field that sees one direction only: the lights about it are seen by it too, less and less with distance."""
    behind = int(np.argmax(TOWARD @ np.array([np.sin(np.radians(150)), 0, np.cos(np.radians(150))])))
    narrow = np.zeros((1, len(TOWARD)), np.float32)
    narrow[0, behind] = 1
    seen = soften_back_light(narrow)[0]
    distance = np.degrees(np.arccos(np.clip(TOWARD @ TOWARD[behind], -1, 1)))
    ring = [seen[(distance > low) & (distance <= low + 6)].mean() for low in (0, 15, 30, 60)]
    assert ring[0] > ring[1] > ring[2] > ring[3]
    assert ring[1] > 0.4 * ring[0]
    assert ring[3] < 0.02 * ring[0]
