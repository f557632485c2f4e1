"""Which light was measured: directions with captured lights around them, and their share of a light."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.capture.desk.person.patch_light import place_patches
from relit_camera.capture.reflectance.delaunay_triangulation import find_triangles
from relit_camera.lab.evaluate.desk_simulation import MONITOR
from relit_camera.light.directions import fibonacci_directions, texel_directions, texel_solid_angles
from relit_camera.subject.measured_light import measured_fraction, measured_texels, share_of_light

SPHERE = fibonacci_directions(240)
FILM = SPHERE[SPHERE[:, 2] > np.cos(np.radians(75))]
DESK = place_patches(MONITOR).directions
BESIDE_A_HOLE = SPHERE[SPHERE[:, 2] < np.cos(np.radians(75))]


@pytest.mark.parametrize("lights", [FILM, DESK, BESIDE_A_HOLE, SPHERE], ids=["film", "desk", "hole", "sphere"])
def test_it_is_the_region_of_the_delaunay_triangles(lights: NDArray[np.float64]) -> None:
    """Found by another way: the convex hull of the lights. Along the edge they differ by half a texel."""
    texels = texel_directions().reshape(-1, 3)
    inside = np.zeros(len(texels), np.bool_)
    inside[find_triangles(lights, texels).covered] = True
    found = measured_texels(lights).ravel()
    solid_angles = texel_solid_angles().ravel() / (4 * np.pi)
    assert solid_angles[inside != found].sum() < 0.01
    assert measured_fraction(lights) == pytest.approx(solid_angles[inside].sum(), abs=0.005)
    strayed = texels[inside != found]
    if len(strayed):  # what differs lies within a texel of the edge
        others = texels[inside == found]
        assert np.degrees(np.arccos((strayed @ others.T).max(axis=1))).max() < 6


def test_few_lights_measure_nothing() -> None:
    """As the one of an instant subject, which is the light of a room."""
    for count in (1, 2, 3):
        assert measured_fraction(SPHERE[:count]) == 0


def test_of_a_light_the_share_from_measured_directions_counts() -> None:
    """Of light from the front all, of light from behind none, of both in equal parts half."""
    front, back = (np.zeros((32, 64, 3), np.float32) for _ in range(2))
    toward = texel_directions()
    front[toward[..., 2] > 0.9] = 1
    back[toward[..., 2] < -0.9] = 1
    measured = measured_texels(FILM)
    shares = [share_of_light(light, measured) for light in (front, back, front + back, 0 * front)]
    assert shares == pytest.approx([1, 0, 0.5, 0], abs=0.01)
