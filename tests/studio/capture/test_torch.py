"""The hand-held torch: what it gives, where it goes, what it shadows."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.light.directions import spherical_from_direction
from relit_studio.capture.flash.point_shadow import PointShadow
from relit_studio.capture.flash.torch import REFERENCE_CM, HandPath, Torch
from relit_studio.mannequin.rendering.shading import Surface, reflected
from relit_studio.mannequin.shape.mesh import grid_triangles


def test_lambertian_patch_obeys_cosine_inverse_square_and_beam() -> None:
    # A white wall in the plane z = 0, the torch 80 cm before it, turned by 20 degrees in X and Z.
    torch = Torch(np.array([10.0, 5.0, 80.0]), np.array([np.sin(np.radians(20)), 0, -np.cos(np.radians(20))]))
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-40, 40, 9), np.linspace(-30, 30, 7)))
    points = np.stack([x, y, 0 * x], axis=1).astype(np.float32)
    way = torch.position.astype(np.float32) - points
    distance = np.linalg.norm(way, axis=1, keepdims=True)
    filled = (np.full(len(points), value, np.float32) for value in (0.0, 12.0))
    normals = np.tile(np.array([0, 0, 1], np.float32), (len(points), 1))
    cosine, _ = reflected(Surface(points, normals, normals, *filled), way / distance)
    squared = (x - 10) ** 2 + (y - 5) ** 2 + 80.0**2
    off_axis = np.clip((np.sin(np.radians(20)) * (x - 10) + np.cos(np.radians(20)) * 80) / np.sqrt(squared), 0, 1)
    expected = 80 / np.sqrt(squared) * 100.0**2 / squared * off_axis**2.3
    np.testing.assert_allclose(cosine * torch.irradiance(points), expected, rtol=1e-4)


def test_irradiance_is_one_at_the_reference_distance_and_half_at_42_degrees() -> None:
    torch = Torch(np.zeros(3), np.array([0.0, 0.0, -1.0]))
    aside = np.radians(42)
    points = REFERENCE_CM * np.array([[0, 0, -1.0], [np.sin(aside), 0, -np.cos(aside)], [0, 0, 1.0]])
    assert torch.irradiance(points) == pytest.approx([1, 0.5, 0], abs=0.01)


def test_disc_radiance_gives_the_irradiance_back() -> None:
    # At a distance that makes the disc small: E = L · area · cosine / distance².
    torch = Torch(np.zeros(3), np.array([0.0, 0.0, -1.0]))
    for off_axis in (1.0, 0.7):
        point = 50.0 * np.array([[np.sqrt(1 - off_axis**2), 0, -off_axis]])
        by_area = torch.radiance(np.array(off_axis)) * np.pi * 0.4**2 * off_axis / 50.0**2
        assert by_area == pytest.approx(float(torch.irradiance(point)[0]), rel=1e-6)


def test_path_covers_the_front_hemisphere_at_varying_distance_with_lapses_of_aim() -> None:
    target = np.array([0.0, -2.0, -62.0])
    path = HandPath(target, 30.0, seed=3)
    torches = [path.at(time) for time in np.arange(0, 30, 0.1)]
    ways = np.array([torch.position - target for torch in torches])
    distance = np.linalg.norm(ways, axis=1)
    azimuth, elevation = (np.degrees(angle) for angle in spherical_from_direction(ways))
    assert azimuth.min() < -60
    assert azimuth.max() > 60
    assert elevation.min() < -10
    assert elevation.max() > 60
    assert 3 < distance.std() < 15
    assert distance.min() > 65
    aim = np.array([torch.aim for torch in torches])
    off = np.degrees(np.arccos(np.clip((aim * -ways).sum(axis=1) / distance, -1, 1)))
    assert np.median(off) < 6
    assert off.max() > 30
    np.testing.assert_allclose(np.linalg.norm(aim, axis=1), 1)
    # A hand's speed, not a jump.
    assert np.linalg.norm(np.diff(ways, axis=0), axis=1).max() < 25


def test_shadow_edge_of_a_light_nearby_lies_where_geometry_puts_it() -> None:
    # A square of 4 cm hovers 3 cm over a floor; the light is 23 cm over the floor at x = 6.
    axis = np.linspace(-16, 16, 33)
    x, y = np.meshgrid(axis, -axis)
    floor = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    corners = np.array([[-2, 2, 3], [2, 2, 3], [-2, -2, 3], [2, -2, 3]], float)
    triangles = np.concatenate([grid_triangles(33, 33), grid_triangles(2, 2) + len(floor)])
    vertices = np.concatenate([floor, corners]).astype(np.float32)
    shadow = PointShadow(vertices, triangles, [6.0, 0.0, 23.0], 500)
    along = np.linspace(-8, 8, 801)
    probes = np.stack([along, 0 * along, 0 * along], axis=1).astype(np.float32)
    lit = shadow.lit(probes, np.tile(np.array([0, 0, 1], np.float32), (len(along), 1)))
    left, right = (6 + (edge - 6) * 23 / 20 for edge in (-2, 2))
    dark = along[lit < 0.5]
    assert (dark.min(), dark.max()) == pytest.approx((left, right), abs=0.12)
    assert (lit[(along < left - 0.25) | (along > right + 0.25)] == 1).all()
