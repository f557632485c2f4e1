"""Lamps against the formulas of a disc of even radiance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from relit_camera.base.config.look import Lamp
from relit_camera.base.images.color import LUMINANCE, rgb_from_kelvin
from relit_camera.light.directions import direction_from_degrees, texel_directions, texel_solid_angles
from relit_camera.light.light_map import irradiance, total
from relit_camera.light.scene_light import lamp_light_map

directions = st.tuples(st.floats(-180, 180), st.floats(-90, 90))
sizes = st.floats(0.1, 180)


def lamp(azimuth: float, elevation: float, size: float = 10, **more: object) -> Lamp:
    return Lamp(azimuth_deg=azimuth, elevation_deg=elevation, size_deg=size, **more)


@given(directions, sizes)
@settings(max_examples=30)
def test_intensity_is_the_irradiance_at_the_head(direction: tuple[float, float], size: float) -> None:
    light_map = lamp_light_map([lamp(*direction, size, intensity=2.5)])
    assert light_map.dtype == np.float32
    np.testing.assert_allclose(irradiance(light_map, direction_from_degrees(*direction)), 2.5, rtol=5e-3)


@given(directions, sizes)
@settings(max_examples=30)
def test_energy_is_that_of_a_disc_of_even_radiance(direction: tuple[float, float], size: float) -> None:
    # Irradiance π L sin²(s/2) perpendicular to the disc, energy 2π L (1 − cos(s/2)): their ratio.
    half = np.radians(size) / 2
    expected = 2 * (1 - np.cos(half)) / np.sin(half) ** 2
    np.testing.assert_allclose(total(lamp_light_map([lamp(*direction, size)])), expected, rtol=5e-3)


@pytest.mark.parametrize("direction", [(0, 0), (180, 0), (70, -50), (10, 90), (0, -90), (-120, 85)])
def test_a_large_lamp_is_even_inside_and_black_outside(direction: tuple[float, float]) -> None:
    light_map = lamp_light_map([lamp(*direction, 90)])[..., 0]
    angle = np.degrees(np.arccos(np.clip(texel_directions() @ direction_from_degrees(*direction), -1, 1)))
    radiance = 1 / (np.pi * np.sin(np.radians(45)) ** 2)
    np.testing.assert_allclose(light_map[angle < 36], radiance, rtol=0.03)
    # Texels at the poles are as wide as elsewhere only after a blur along θ: the edge is about a texel soft.
    assert light_map[angle > 57].max(initial=0) == 0


@pytest.mark.parametrize("direction", [(0, 0), (180, 0), (-179.9, 3), (70, -50), (10, 90), (33, 60)])
@pytest.mark.parametrize("size", [0.1, 5, 40])
def test_a_lamp_is_where_it_should_be(direction: tuple[float, float], size: float) -> None:
    energy = lamp_light_map([lamp(*direction, size)])[..., 0] * texel_solid_angles()
    centroid = np.einsum("ij,ijk->k", energy, texel_directions())
    cosine = centroid @ direction_from_degrees(*direction) / np.linalg.norm(centroid)
    assert np.degrees(np.arccos(min(1, cosine))) < 0.5


@pytest.mark.parametrize("elevation", [0, 40, 75, 88])
@pytest.mark.parametrize("size", [0.1, 10])
def test_small_moves_change_shading_smoothly(elevation: float, size: float) -> None:
    normals = direction_from_degrees([0, 60, -30], [0, 0, 45])
    readings = np.array([
        irradiance(lamp_light_map([lamp(azimuth, elevation, size)]), normals)[:, 0] for azimuth in np.arange(20, 40,
        0.5)
    ])  # fmt: skip
    assert np.abs(np.diff(readings, axis=0)).max() < 0.012


def test_white_kelvin_and_colour() -> None:
    white, warm, red = (
        lamp_light_map([lamp(0, 0)]),
        lamp_light_map([lamp(0, 0, kelvin=3000)]),
        lamp_light_map([lamp(0, 0, color=(2, 0, 0))]),
    )
    np.testing.assert_array_equal(white[..., 0], white[..., 2])
    np.testing.assert_allclose(total(warm) / total(white), rgb_from_kelvin(3000), rtol=1e-4)
    assert float(irradiance(warm, (0, 0, 1)) @ LUMINANCE) == pytest.approx(1, rel=5e-3)
    np.testing.assert_allclose(irradiance(red, (0, 0, 1)), (2, 0, 0), rtol=5e-3)


def test_lamps_add_up() -> None:
    one, other = lamp(20, 10, 5), lamp(-80, 40, 60, intensity=3.0)
    np.testing.assert_allclose(lamp_light_map([one, other]), lamp_light_map([one]) + lamp_light_map([other]), rtol=1e-6)


def test_no_lamp_is_no_light() -> None:
    np.testing.assert_array_equal(lamp_light_map([]), np.zeros((32, 64, 3)))


def test_a_muted_lamp_gives_no_light_and_a_name_changes_none() -> None:
    bright, muted = Lamp(azimuth_deg=40, name="key"), Lamp(azimuth_deg=-40, muted=True)
    np.testing.assert_array_equal(lamp_light_map([bright, muted]), lamp_light_map([Lamp(azimuth_deg=40)]))
    assert not lamp_light_map([muted]).any()
