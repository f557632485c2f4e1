"""The mirror ball against geometry worked out another way."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from relit_camera.light.directions import texel_directions
from relit_studio.cameras.pinhole import Pinhole
from relit_studio.capture.ball.ball_reflection import Room, highlight_px, room_in_ball, torch_in_ball
from relit_studio.capture.ball.mirror_ball import MirrorBall
from relit_studio.capture.flash.torch import RADIUS_CM, Torch

CAMERA = Pinhole(240, 200, 230.0)
METAL = np.array([0.9, 0.8, 0.7], np.float32)
BALL = MirrorBall(np.array([13.0, 9.0, -50.0]), 4.0, METAL)
LIGHTS = [(-90.0, 20.0, -20.0), (10.0, 95.0, -30.0), (70.0, -10.0, -10.0), (-20.0, 30.0, 40.0)]


def torch_at(position: tuple[float, float, float]) -> Torch:
    place = np.array(position)
    return Torch(place, (BALL.center - place) / np.linalg.norm(BALL.center - place))


def centroid(image: np.ndarray) -> tuple[float, float]:
    x, y = CAMERA.pixel_grid()
    weight = image.sum(axis=2) / image.sum()
    return float((x * weight).sum()), float((y * weight).sum())


def test_outline_is_the_region_that_rays_hit() -> None:
    x, y = np.meshgrid(np.arange(100, 230, 0.1) + 0.05, np.arange(20, 120, 0.1) + 0.05)
    hit, _, _ = BALL.reflect(CAMERA.rays(x, y).reshape(-1, 3))
    hit = hit.reshape(x.shape)
    outline = BALL.outline(CAMERA)
    assert x[hit].mean() == pytest.approx(outline.x, abs=0.01)
    assert y[hit].mean() == pytest.approx(outline.y, abs=0.01)
    assert hit.sum() * 0.01 == pytest.approx(np.pi * outline.radius**2, rel=1e-3)
    moments = np.linalg.eigvalsh(np.cov(np.stack([x[hit], y[hit]])))
    assert 2 * np.sqrt(moments) == pytest.approx([outline.semi_tangential, outline.semi_radial], rel=1e-3)


@pytest.mark.parametrize("light", LIGHTS)
def test_reflection_point_is_on_the_shortest_way(light: tuple[float, float, float]) -> None:
    def way(angles: np.ndarray) -> float:  # Fermat: of all ways over the near side the shortest is the light's
        a, b = angles
        point = BALL.center + 4.0 * np.array([np.sin(a) * np.cos(b), np.sin(b), np.cos(a) * np.cos(b)])
        return float(np.linalg.norm(point) + np.linalg.norm(point - light))

    start = np.array(light) / np.linalg.norm(np.array(light) - BALL.center) - BALL.center / 50
    shortest = minimize(way, [np.arctan2(start[0], start[2]), 0.0], method="Nelder-Mead", options={"xatol": 1e-9})
    a, b = shortest.x
    found = BALL.reflection_point(light)
    expected = BALL.center + 4.0 * np.array([np.sin(a) * np.cos(b), np.sin(b), np.cos(a) * np.cos(b)])
    np.testing.assert_allclose(found, expected, atol=2e-3)


@pytest.mark.parametrize("light", LIGHTS)
def test_the_ray_to_the_reflection_point_is_mirrored_into_the_light(light: tuple[float, float, float]) -> None:
    point = BALL.reflection_point(light)
    hit, points, mirrored = BALL.reflect((point / np.linalg.norm(point))[None])
    assert hit.all()
    np.testing.assert_allclose(points[0], point, atol=1e-6)
    toward = np.array(light) - point
    np.testing.assert_allclose(mirrored[0], toward / np.linalg.norm(toward), atol=1e-6)


def test_a_light_inside_the_ball_is_refused() -> None:
    with pytest.raises(ValueError, match="inside"):
        BALL.reflection_point(BALL.center + [0.0, 1.0, 0.0])


@pytest.mark.parametrize("light", LIGHTS)
def test_the_picture_of_the_torch_lies_at_its_highlight(light: tuple[float, float, float]) -> None:
    torch = torch_at(light)
    assert centroid(torch_in_ball(BALL, CAMERA, torch)) == pytest.approx(highlight_px(BALL, CAMERA, torch), abs=0.02)


def test_the_torch_keeps_its_energy() -> None:
    # A ball straight ahead, the torch straight behind the camera: the mirror formula, f = -R / 2.
    ball = MirrorBall(np.array([0.0, 0.0, -50.0]), 4.0, METAL)
    torch = Torch(np.array([0.0, 0.0, 40.0]), np.array([0.0, 0.0, -1.0]))
    away = 90.0 - 4.0
    behind_surface = 1 / (1 / 2.0 + 1 / away)
    radius_px = CAMERA.focal_px * RADIUS_CM * behind_surface / away / (50.0 - 4.0 + behind_surface)
    reading = np.pi * 100.0**2 / (np.pi * RADIUS_CM**2)
    picture = torch_in_ball(ball, CAMERA, torch)
    assert picture.sum(axis=(0, 1)) == pytest.approx(METAL * reading * np.pi * radius_px**2, rel=0.01)


def test_a_torch_that_points_away_is_not_seen() -> None:
    torch = torch_at(LIGHTS[0])
    assert not torch_in_ball(BALL, CAMERA, Torch(torch.position, -torch.aim)).any()


def test_a_white_room_in_the_ball_reads_its_reflectance() -> None:
    white = Room(np.full((64, 128, 3), 1 / np.pi, np.float32))
    image, coverage = room_in_ball(BALL, CAMERA, white)
    np.testing.assert_allclose(image, coverage[..., None] * METAL, atol=1e-5)
    assert coverage.sum() == pytest.approx(np.pi * BALL.outline(CAMERA).radius ** 2, rel=1e-3)


def test_the_ball_shows_each_side_of_the_room_where_it_lies() -> None:
    directions = texel_directions(256, 512).astype(np.float32)
    image, coverage = room_in_ball(BALL, CAMERA, Room(np.maximum(directions, 0)))
    # Colors tell where each pixel looks: red right, green up, blue toward the camera.
    x, y = CAMERA.pixel_grid()
    inside = coverage == 1
    looks = CAMERA.rays(x, y)
    hit, points, _ = BALL.reflect(looks[inside])
    normal = (points - BALL.center) / 4.0
    sight = points / np.linalg.norm(points, axis=1, keepdims=True)
    expected = np.maximum(sight - 2 * (sight * normal).sum(axis=1, keepdims=True) * normal, 0) * np.pi * METAL
    assert hit.all()
    assert np.abs(image[inside] - expected).mean() < 0.02
    outline = BALL.outline(CAMERA)
    right, left = (image[int(outline.y), int(outline.x + side * 0.5 * outline.radius)] for side in (1, -1))
    assert right[0] > left[0] + 1
