from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.config.look import Lamp
from relit_camera.base.errors import ImageError
from relit_camera.light.directions import direction_from_degrees, fibonacci_directions
from relit_camera.light.light_map import irradiance, total
from relit_camera.light.scene_light import lamp_light_map
from relit_studio.mannequin.rendering.distant_lights import lights_from_map, room
from relit_studio.mannequin.rendering.shading import ShadowMap, Surface, reflected
from relit_studio.mannequin.shape.mesh import grid_triangles


def patch(normals: np.ndarray, shine: float = 0.0, exponent: float = 12.0) -> Surface:
    count = len(normals)
    views = np.tile(np.array([0, 0, 1], np.float32), (count, 1))
    filled = (np.full(count, value, np.float32) for value in (shine, exponent))
    return Surface(np.zeros((count, 3), np.float32), normals.astype(np.float32), views, *filled)


def test_white_wall_facing_the_light_reads_one() -> None:
    cosine, gloss = reflected(patch(np.array([[0, 0, 1.0]])), [0, 0, 1])
    assert cosine == pytest.approx([1])
    assert gloss == pytest.approx([0])


def test_lambert_under_light_from_all_sides_is_pi() -> None:
    normals = fibonacci_directions(40)
    lights = fibonacci_directions(400)
    summed = sum(reflected(patch(normals), light)[0] for light in lights) * (4 * np.pi / len(lights))
    np.testing.assert_allclose(summed, np.pi, rtol=0.005)


@pytest.mark.slow
def test_gloss_gives_back_about_the_fraction_it_is_named_by() -> None:
    lights = fibonacci_directions(20000)
    flat = patch(np.array([[0, 0, 1.0]]), shine=0.05, exponent=60)
    energy = sum(reflected(flat, light)[1][0] for light in lights) * (4 * np.pi / len(lights))
    # In units where white Lambert gives π; Schlick's rise is small for a patch that faces the camera.
    assert energy / np.pi == pytest.approx(0.05, rel=0.1)


def test_shadow_edge_lies_where_the_light_puts_it() -> None:
    # A square of 4 cm hovers 3 cm over a floor, lit at 45 degrees: its shadow is shifted by 3 cm.
    axis = np.linspace(-12, 12, 25)
    x, y = np.meshgrid(axis, -axis)
    floor = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    corners = np.array([[-2, 2, 3], [2, 2, 3], [-2, -2, 3], [2, -2, 3]], float)
    triangles = np.concatenate([grid_triangles(25, 25), grid_triangles(2, 2) + len(floor)])
    vertices = np.concatenate([floor, corners]).astype(np.float32)
    shadow = ShadowMap(vertices, triangles, np.array([1, 0, 1]) / np.sqrt(2), 400)
    along = np.linspace(-8, 4, 601)
    probes = np.stack([along, np.zeros(601), np.zeros(601)], axis=1).astype(np.float32)
    lit = shadow.lit(probes, np.tile(np.array([0, 0, 1], np.float32), (601, 1)))
    dark = along[lit < 0.5]
    assert dark.min() == pytest.approx(-5, abs=0.15)
    assert dark.max() == pytest.approx(-1, abs=0.15)
    assert (lit[(along < -5.3) | (along > -0.7)] == 1).all()


def test_round_body_does_not_shadow_itself() -> None:
    polar, around = np.linspace(0, np.pi, 60)[:, None], np.linspace(-np.pi, np.pi, 120, endpoint=False)
    ball = np.stack([np.sin(polar) * np.sin(around), np.cos(polar) + 0 * around, np.sin(polar) * np.cos(around)], -1)
    points = (8 * ball.reshape(-1, 3)).astype(np.float32)
    normals = points / 8
    light = direction_from_degrees(30, 20)
    lit = ShadowMap(points, grid_triangles(60, 120, closed=True), light, 300).lit(points, normals.astype(np.float32))
    facing = normals @ light
    assert (lit[facing > 0.15] > 0.99).all()
    assert (lit[facing < -0.3] < 0.01).all()


def test_lights_of_a_map_keep_its_energy_and_light_walls_as_it_does() -> None:
    light_map = room()
    lights = lights_from_map(light_map, 48)
    assert len(lights.directions) == 48
    np.testing.assert_allclose(np.linalg.norm(lights.directions, axis=1), 1)
    np.testing.assert_allclose(lights.irradiance.sum(axis=0), total(light_map), rtol=1e-6)
    for normal in fibonacci_directions(12):
        cosine = np.maximum(lights.directions @ normal, 0)
        np.testing.assert_allclose(cosine @ lights.irradiance, irradiance(light_map, normal), rtol=0.05)


def test_a_lamp_alone_becomes_lights_where_it_stands() -> None:
    lights = lights_from_map(lamp_light_map([Lamp(azimuth_deg=70, elevation_deg=20, size_deg=8)]), 16)
    middle = lights.irradiance[:, 1] @ lights.directions
    assert middle / np.linalg.norm(middle) @ direction_from_degrees(70, 20) > np.cos(np.radians(1))


def test_black_map_gives_no_lights_and_a_wrong_one_is_refused() -> None:
    assert lights_from_map(np.zeros((32, 64, 3), np.float32), 8).directions.shape == (0, 3)
    with pytest.raises(ImageError, match=r"\(16, 64, 3\)"):
        lights_from_map(np.zeros((16, 64, 3), np.float32), 8)
