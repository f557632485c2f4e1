"""Resampling, rotation and irradiance of light maps against analytic truth."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import transform

from relit_camera.base.errors import ImageError
from relit_camera.base.rotations import Rotation, rotation_from_angles
from relit_camera.light.directions import (
    direction_from_degrees,
    spherical_from_direction,
    texel_directions,
    texel_solid_angles,
)
from relit_camera.light.light_map import LightMap, check_light_map, irradiance, resample_to_light_map, total
from relit_camera.light.light_map_rotation import rotate_light_map

texels = st.tuples(st.integers(0, 31), st.integers(0, 63))
seeds = st.integers(0, 2**32 - 1)


def random_rotation(rng: np.random.Generator) -> Rotation:
    """A rotation that all others are as likely as."""
    return Rotation(transform.Rotation.random(rng=rng).as_matrix())


def one_texel(row: int, column: int, channel: int | slice = slice(None)) -> LightMap:
    light_map = np.zeros((32, 64, 3), np.float32)
    light_map[row, column, channel] = 10
    return light_map


def texel_direction(row: int, column: int) -> np.ndarray:
    return np.array(texel_directions()[row, column])


def centroid(light_map: LightMap, channel: int = 0) -> np.ndarray:
    vector = np.einsum("ij,ijk->k", light_map[..., channel] * texel_solid_angles(), texel_directions())
    return vector / np.linalg.norm(vector)


def angle_deg(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip(a @ b, -1, 1))))


def random_map(seed: int = 0) -> LightMap:
    return np.random.default_rng(seed).gamma(0.3, 1.0, (32, 64, 3)).astype(np.float32)


@given(st.integers(1, 90), st.integers(1, 150), seeds)
@settings(max_examples=40)
def test_resampling_keeps_energy_at_any_size(height: int, width: int, seed: int) -> None:
    radiance = np.random.default_rng(seed).gamma(0.1, 100.0, (height, width, 3)).astype(np.float32)
    expected = np.einsum("ijc,ij->c", radiance.astype(np.float64), texel_solid_angles(height, width))
    np.testing.assert_allclose(total(resample_to_light_map(radiance)), expected, rtol=1e-5)


def test_a_map_of_the_right_size_stays_as_it_is() -> None:
    light_map = random_map()
    np.testing.assert_allclose(resample_to_light_map(light_map), light_map, rtol=1e-5, atol=1e-6)


def test_resampling_averages_the_texels_it_covers() -> None:
    radiance = np.random.default_rng(3).random((64, 128, 3)).astype(np.float32)
    weights = texel_solid_angles(64, 128)[..., None]
    blocks = (radiance * weights).reshape(32, 2, 64, 2, 3).sum(axis=(1, 3)) / texel_solid_angles()[..., None]
    np.testing.assert_allclose(resample_to_light_map(radiance), blocks, rtol=1e-5)


def test_resampling_smooth_light_at_an_odd_size_is_smooth() -> None:
    y = texel_directions(101, 203)[..., 1:2]
    resampled = resample_to_light_map(np.repeat(1 + y, 3, axis=2).astype(np.float32))
    np.testing.assert_allclose(resampled[..., 0], 1 + texel_directions()[..., 1], atol=0.01)


def test_the_identity_returns_the_input() -> None:
    light_map = random_map()
    np.testing.assert_array_equal(rotate_light_map(light_map, Rotation.identity()), light_map)


def test_rotation_ends_in_the_identity_without_a_jump() -> None:
    light_map = random_map()
    nearly = rotate_light_map(light_map, Rotation.from_rotvec([1e-6, 2e-6, -1e-6]))
    np.testing.assert_allclose(nearly, light_map, atol=1e-3 * light_map.max())


@given(seeds)
@settings(max_examples=50)
def test_a_constant_map_stays_constant(seed: int) -> None:
    rotated = rotate_light_map(np.full((32, 64, 3), 0.7, np.float32), random_rotation(np.random.default_rng(seed)))
    np.testing.assert_allclose(rotated, 0.7, rtol=1e-5)


@pytest.mark.parametrize(
    ("angles", "expected"),
    # E_out(l) = E_in(R·l): light at d is found at R⁻¹·d.
    [((90, 0, 0), (-90, 0)), ((0, 30, 0), (0, 30)), ((180, 0, 0), (180, 0))],
)
def test_a_frontal_lamp_goes_the_other_way(angles: tuple[float, float, float], expected: tuple[float, float]) -> None:
    light_map = one_texel(15, 31) + one_texel(15, 32) + one_texel(16, 31) + one_texel(16, 32)
    found = centroid(rotate_light_map(light_map, rotation_from_angles(*angles)))
    assert angle_deg(found, direction_from_degrees(*expected)) < 0.2


def test_a_turned_head_sees_a_lamp_at_the_picture_s_right_in_front() -> None:
    light_map = one_texel(15, 47) + one_texel(16, 47) + one_texel(15, 48) + one_texel(16, 48)
    assert angle_deg(centroid(rotate_light_map(light_map, rotation_from_angles(90))), np.array([0, 0, 1.0])) < 0.2


@given(texels, seeds)
@settings(max_examples=60)
def test_a_lamp_keeps_its_place_and_its_energy(texel: tuple[int, int], seed: int) -> None:
    rotation = random_rotation(np.random.default_rng(seed))
    lamp = one_texel(*texel)
    rotated = rotate_light_map(lamp, rotation)
    assert (rotated >= 0).all()
    np.testing.assert_allclose(total(rotated), total(lamp), rtol=1e-4)
    assert angle_deg(centroid(rotated), rotation.inv().apply(texel_direction(*texel))) < 1


def energy_beside_a_witness(texel: tuple[int, int], rotation: Rotation) -> float:
    """Fraction of its energy that a lamp keeps beside much more light, even, from the far third of the sphere.

    The whole map is renormalised, which that light decides: what the rotation itself takes from the lamp shows. (A
    second lamp as witness could hide it: at the antipodes every error is the same.)
    """
    lamp, toward = one_texel(*texel), texel_direction(*texel)
    witness = np.where(texel_directions() @ toward < -0.4, 10, 0)[..., None].astype(np.float32)
    light = rotate_light_map(lamp + witness, rotation)[..., 0] * texel_solid_angles()
    near = texel_directions() @ rotation.inv().apply(toward) > 0
    return float(light[near].sum() / total(lamp)[0])


@given(texels, seeds)
@settings(max_examples=80)
def test_two_lamps_of_one_map_keep_their_fractions(texel: tuple[int, int], seed: int) -> None:
    rotation = random_rotation(np.random.default_rng(seed))
    assert energy_beside_a_witness(texel, rotation) == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize("row", [0, 1, 2, 5, 10, 15, 20, 30, 31])
def test_nods_do_not_flicker(row: int) -> None:
    energies = [energy_beside_a_witness((row, 11), rotation_from_angles(7, pitch, 3)) for pitch in range(-40, 41, 2)]
    assert np.ptp(energies) < 0.01


@given(texels, st.floats(-180, 180))
@settings(max_examples=40)
def test_lamps_near_a_pole_brought_to_the_equator_keep_their_energy(texel: tuple[int, int], spin: float) -> None:
    row = texel[0] % 3
    aligned, _ = transform.Rotation.align_vectors([texel_direction(row, texel[1])], [direction_from_degrees(spin, 0)])
    there = Rotation(aligned.as_matrix())
    assert energy_beside_a_witness((row, texel[1]), there) == pytest.approx(1, abs=0.01)


def test_irradiance_moves_smoothly_with_small_nods() -> None:
    lamp = one_texel(6, 20)
    normal = np.array([0.0, 0.0, 1.0])
    reading = []
    for pitch in np.arange(0, 12, 0.25):
        rotation = rotation_from_angles(0, pitch)
        cosine = rotation.inv().apply(texel_direction(6, 20)) @ normal
        reading.append(irradiance(rotate_light_map(lamp, rotation), normal)[0] / total(lamp)[0] - cosine)
    assert np.abs(reading).max() < 0.006
    assert np.abs(np.diff(reading)).max() < 0.003


@given(seeds)
@settings(max_examples=30)
def test_smooth_light_rotates_as_its_formula(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rotation = random_rotation(rng)
    toward = random_rotation(rng).apply([0, 0, 1])

    def glow(direction: np.ndarray) -> np.ndarray:
        return np.repeat(np.exp(3 * (direction @ toward - 1))[..., None], 3, axis=-1).astype(np.float32)

    directions = np.array(texel_directions())
    truth = glow(rotation.apply(directions.reshape(-1, 3)).reshape(directions.shape))
    error = np.abs(rotate_light_map(glow(directions), rotation) - truth)
    # Texels at the poles are narrow: what keeps a lamp's energy there blurs along θ a little more.
    assert error[1:-1].max() < 0.025
    assert error.max() < 0.04


def test_rotating_there_and_back_keeps_irradiance() -> None:
    light_map, rotation = random_map(4), rotation_from_angles(25, -15, 10)
    normals = direction_from_degrees([0, 60, -60, 10], [0, 20, -20, 80])
    seen = irradiance(rotate_light_map(light_map, rotation), normals)
    np.testing.assert_allclose(seen, irradiance(light_map, rotation.apply(normals)), rtol=0.02)


def test_the_seam_wraps() -> None:
    behind = one_texel(16, 0) + one_texel(16, 63)
    rotated = rotate_light_map(behind, rotation_from_angles(0.5 * 360 / 64))
    columns = np.flatnonzero(rotated[16, :, 0] > 0.1)
    azimuth, _ = spherical_from_direction(texel_directions()[16, columns])
    assert (np.abs(np.degrees(azimuth)) > 165).all()


def test_irradiance_of_even_light_is_pi_everywhere() -> None:
    normals = direction_from_degrees([0, 90, 180, 33], [0, 0, 45, -90])
    np.testing.assert_allclose(irradiance(np.ones((32, 64, 3), np.float32), normals), np.pi, rtol=2e-3)


def test_irradiance_of_a_lamp_is_lambert_s_cosine() -> None:
    lamp = one_texel(16, 32)
    toward = texel_direction(16, 32)
    turned = Rotation.from_rotvec([0, np.radians(60), 0]).apply(toward)
    expected = total(lamp)[0] * (toward @ turned)
    np.testing.assert_allclose(irradiance(lamp, turned), expected, rtol=1e-5)
    np.testing.assert_array_equal(irradiance(lamp, -toward), 0)


def test_wrong_maps_are_refused() -> None:
    with pytest.raises(ImageError, match=r"\(16, 64, 3\)"):
        check_light_map(np.zeros((16, 64, 3), np.float32))
    with pytest.raises(ImageError, match="float64"):
        check_light_map(np.zeros((32, 64, 3)))
    check_light_map(np.zeros((32, 64, 3), np.float32))
