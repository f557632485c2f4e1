"""Patterns and their demultiplexing, and the light of patches, against what is known in closed form."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from relit_camera.base.errors import CaptureError
from relit_camera.base.images.color import Gamma, decode, srgb_decode, srgb_encode
from relit_camera.capture.desk.desk_recording import CameraPlace, DeskSetup, PatchGrid, Screen
from relit_camera.capture.desk.patterns.pattern_sequence import (
    demultiplex,
    pattern_light,
    pattern_lights,
    s_matrix,
    standard_sequence,
    undetermined_patches,
)
from relit_camera.capture.desk.patterns.plateaus import find_plateaus
from relit_camera.capture.desk.person.patch_light import Patches, place_patches


@pytest.mark.parametrize("patches", [4, 6, 7, 9, 11, 12, 15, 20, 28])
def test_an_s_matrix_determines_every_patch_with_half_of_them_lit(patches: int) -> None:
    matrix = s_matrix(patches)
    assert set(np.unique(matrix)) == {0, 1}
    assert np.linalg.matrix_rank(matrix) == patches
    assert len(matrix) < patches + 5
    assert undetermined_patches(matrix.astype(float)[1:]) or len(matrix) > patches
    # The room's own light is one more unknown, and black shows it.
    assert not undetermined_patches(np.concatenate([matrix, np.zeros((1, patches))]))


def test_an_s_matrix_of_full_order_is_balanced() -> None:
    matrix = s_matrix(15)
    assert matrix.shape == (15, 15)
    assert (matrix.sum(axis=1) == 8).all()
    assert (matrix @ matrix.T == 4 + 4 * np.eye(15)).all()


def test_demultiplexing_returns_the_single_patches_and_the_room() -> None:
    random = np.random.default_rng(0)
    alone, room = random.uniform(0, 1, (6, 5, 3)).astype(np.float32), random.uniform(0, 1, (5, 3)).astype(np.float32)
    lights = pattern_lights(standard_sequence(3, 2), 6)
    pictures = np.tensordot(lights, alone, axes=1).astype(np.float32) + room
    found, found_room = demultiplex(pictures, lights)
    np.testing.assert_allclose(found, alone, atol=1e-5)
    np.testing.assert_allclose(found_room, room, atol=1e-5)


def test_multiplexing_lowers_noise() -> None:
    """By (N + 1) / (2 √N) for noise that does not depend on light (Harwit and Sloane 1979)."""
    noise = np.random.default_rng(0).normal(size=(15, 20000)).astype(np.float32)
    matrix = s_matrix(15).astype(float)
    # Room known: without the column of ones.
    found = np.linalg.inv(matrix) @ noise
    assert noise.std() / found.std() == pytest.approx(16 / (2 * np.sqrt(15)), rel=0.03)


def test_a_missing_pattern_leaves_patches_undetermined() -> None:
    lights = pattern_lights(["black", *standard_sequence(5, 3)[3:10]], 15)
    assert undetermined_patches(lights)


def test_successive_patterns_differ_in_their_middle() -> None:
    rows = np.array([row for row in standard_sequence(5, 3) if not isinstance(row, str)])
    places = np.stack(np.meshgrid(np.linspace(-1, 1, 5), np.linspace(-0.6, 0.6, 3)), axis=-1).reshape(-1, 2)
    apart = np.linalg.norm(np.diff(rows @ places, axis=0), axis=1)
    plain = np.linalg.norm(np.diff(s_matrix(15) @ places, axis=0), axis=1)
    assert apart.min() > max(1.0, 2 * plain.min())


def test_light_follows_the_display_curve() -> None:
    half = pattern_light([0.5, 1, 0, 0.25], 4, gamma=2.2)
    np.testing.assert_allclose(half, [0.5**2.2, 1, 0, 0.25**2.2])
    leaking = pattern_light([0.5, 1, 0, 0], 4, gamma=2.0, black=0.1)
    np.testing.assert_allclose(leaking[:3], [(0.36 - 0.01) / (1.21 - 0.01), 1, 0])


def test_a_small_patch_follows_the_inverse_square_and_cosine_laws() -> None:
    patches = Patches(np.array([[30.0, 0, 40.0]]), (0.1, 0.1))
    found = patches.irradiance(np.array([[0.0, 0, 0], [3.0, 4.0, -2.0]]), 0)
    for point, vector in zip(([0, 0, 0], [3, 4, -2]), found, strict=True):
        toward = np.array([30.0, 0, 40.0]) - point
        distance = np.linalg.norm(toward)
        expected = 0.01 * (toward[2] / distance) / distance**2
        np.testing.assert_allclose(vector, expected * toward / distance, rtol=1e-4)


def test_a_large_patch_is_as_good_as_many_small_ones() -> None:
    large = Patches(np.array([[5.0, 3.0, 50.0]]), (12.0, 11.5))
    fine = (np.arange(40) + 0.5) / 40 - 0.5
    small = np.array([[5 + 12 * x, 3 + 11.5 * y, 50.0] for x in fine for y in fine])
    many = Patches(small, (12 / 40, 11.5 / 40))
    point = np.array([[2.0, -8.0, 1.0]])
    total = sum(many.irradiance(point, k) for k in range(len(small)))
    np.testing.assert_allclose(large.irradiance(point, 0), total, rtol=0.01)


def test_the_right_of_the_screen_lights_the_left_of_the_picture() -> None:
    setup = DeskSetup(
        screen=Screen(width_cm=60, height_cm=30),
        distance_cm=60,
        camera=CameraPlace(up_cm=16, right_cm=2),
        patches=PatchGrid(columns=2, rows=2),
    )
    centers = place_patches(setup).centers_cm
    np.testing.assert_allclose(centers, [[17, -8.5, 60], [-13, -8.5, 60], [17, -23.5, 60], [-13, -23.5, 60]])
    moved = place_patches(setup, (3, -2)).centers_cm
    np.testing.assert_allclose(moved - centers, np.tile([-3, 2, 0], (4, 1)))


def test_a_distant_patch_needs_no_correction() -> None:
    patches = Patches(np.array([[1e4, 2e3, 3e4]]), (10.0, 10.0))
    normals = np.tile(np.array([0, 0.3, 0.954], np.float32), (5, 1))
    points = np.random.default_rng(0).uniform(-10, 10, (5, 3)).astype(np.float32)
    np.testing.assert_allclose(patches.distant_light_factor(points, normals, 0), 1, atol=2e-3)


def test_the_near_field_of_a_lambertian_surface_is_undone_where_it_faces_the_light() -> None:
    patches = Patches(np.array([[20.0, -10.0, 50.0]]), (1.0, 1.0))
    points = np.array([[4.0, 3.0, 1.0], [-6.0, 2.0, -5.0]], np.float32)
    normals = np.array([[0.1, 0.0, 0.995], [-0.2, 0.1, 0.975]], np.float32)
    near = np.einsum("nc,nc->n", patches.irradiance(points, 0), normals)
    far = normals @ patches.directions[0] * patches.strengths()[0]
    np.testing.assert_allclose(near * patches.distant_light_factor(points, normals, 0), far, rtol=0.05)


def test_plateaus_end_where_light_changes() -> None:
    levels = np.concatenate([np.full(9, 0.2), np.linspace(0.2, 0.8, 6)[1:-1], np.full(7, 0.8), np.full(8, 0.3)])
    random = np.random.default_rng(0)
    cells = (levels[:, None, None] + 0.002 * random.normal(size=(len(levels), 24, 32))).astype(np.float32)
    assert [(each.start, each.stop) for each in find_plateaus(cells, "srgb")] == [(0, 9), (13, 20), (20, 28)]


@pytest.mark.parametrize("change", [10, 15, 20, 40])
def test_a_slow_change_of_little_light_belongs_to_no_plateau(change: int) -> None:
    """As before a laptop: ten frames of each pattern, and four in between; changes in units of the noise."""
    random = np.random.default_rng(0)
    noise = 0.002
    light = np.concatenate([[0.9, 0.1], 0.5 + change * noise * (np.arange(25) % 2)])  # one change is large
    fades = [np.linspace(one, other, 6)[1:-1] for one, other in pairwise(light)]
    standing = light.repeat(10).reshape(-1, 10)
    levels = np.concatenate([standing[0], *(np.append(*each) for each in zip(fades, standing[1:], strict=True))])
    codes = levels[:, None, None] + noise * random.normal(size=(len(levels), 24, 32))
    found = find_plateaus(srgb_decode(codes.astype(np.float32)), "srgb")
    assert len(found) == len(light)
    for index, each in enumerate(found):
        assert 14 * index - 1 <= each.start <= 14 * index
        assert 14 * index + 10 <= each.stop <= 14 * index + 11


@pytest.mark.parametrize("seed", range(20))
def test_a_head_that_trembles_hides_no_pattern(seed: int) -> None:
    """A trembling changes bright frames more than dark ones, and some of them more than a next pattern does."""
    random = np.random.default_rng(seed)
    face, across, down, side = random.uniform(0.3, 1, (4, 24, 32)) * np.array([1, 0.3, 0.3, 0.05])[:, None, None]
    levels = np.repeat([0.01, 1.0, 0.01, *([0.5, 0.55] * 8)], 4)
    turned = np.repeat([0, 0, 0, *([1, -1] * 8)], 4)
    lit = face + np.einsum("tk,kyx->tyx", 0.015 * random.normal(size=(len(levels), 2)), np.stack([across, down]))
    codes = srgb_encode(0.5 * levels[:, None, None] * (lit + turned[:, None, None] * side))
    noise = np.float32(0.0005) * random.standard_normal(codes.shape, np.float32)
    found = find_plateaus(srgb_decode(codes + noise), "srgb")
    assert {each.start // 4 for each in found} == set(range(len(levels) // 4))
    assert all(each.start // 4 == (each.stop - 1) // 4 for each in found)


@pytest.mark.parametrize("frames", [6, 10, 20])
@pytest.mark.parametrize("disturbed", ["drifting", "noisy"])
def test_patterns_under_which_the_head_drifts_or_the_picture_is_noisy_are_seen_too(frames: int, disturbed: str) -> None:
    """In a third of the patterns each frame differs from the one before as much as three or six times the noise."""
    random = np.random.default_rng(0)
    noise, levels = 0.002, np.tile([0.25, 0.6], 15)
    codes = np.repeat(levels, frames)[:, None, None] + noise * random.normal(size=(30 * frames, 24, 32))
    for pattern in range(0, 30, 3):
        part = codes[pattern * frames : (pattern + 1) * frames]
        if disturbed == "drifting":
            part += 3 * noise * np.arange(frames)[:, None, None]
        else:
            part += 6 * noise * random.normal(size=part.shape)
    found = find_plateaus(srgb_decode(codes.astype(np.float32)), "srgb")
    assert {each.start // frames for each in found} == set(range(30))
    assert all(each.start // frames == (each.stop - 1) // frames for each in found)


@pytest.mark.parametrize("gamma", ["srgb", "linear", 2.2])
def test_black_is_a_plateau_whatever_the_curve_of_the_camera(gamma: Gamma) -> None:
    random = np.random.default_rng(0)
    codes = np.repeat([0.02, 0.6, 0.02, 0.3, 0.35, 0.02], 8)[:, None, None] + 0.003 * random.normal(size=(48, 24, 32))
    found = find_plateaus(decode(codes.astype(np.float32), gamma), gamma)
    assert [(each.start, each.stop) for each in found] == [(k, k + 8) for k in range(0, 48, 8)]


def test_too_few_frames_are_no_patterns() -> None:
    for count in (1, 2):
        with pytest.raises(CaptureError, match="no patterns are seen"):
            find_plateaus(np.linspace(0.1, 0.2, count * 4, dtype=np.float32).reshape(count, 2, 2), "srgb")


@pytest.mark.slow
def test_a_long_recording_is_parted_in_bounded_time_and_memory() -> None:
    levels = np.tile(np.repeat([0.2, 0.7], [700, 50]), 4)
    cells = levels[:, None, None] + 0.002 * np.random.default_rng(0).normal(size=(len(levels), 24, 32))
    found = find_plateaus(cells.astype(np.float32), "srgb")
    assert {each.start for each in found} >= set(range(0, 3000, 750)) | {k + 700 for k in range(0, 3000, 750)}
    assert max(each.stop - each.start for each in found) <= 200


def test_noise_alone_has_no_plateaus() -> None:
    cells = 0.2 + 0.01 * np.random.default_rng(0).normal(size=(60, 24, 32))
    with pytest.raises(CaptureError, match="no patterns are seen"):
        find_plateaus(cells.astype(np.float32), "srgb")
