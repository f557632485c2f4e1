"""Light guessed from a picture behind the person."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.images.color import linear_from_uint8, uint8_from_linear
from relit_camera.light.directions import direction_from_degrees, map_position_from_direction
from relit_camera.light.environments.background_light import panorama_from_background
from relit_camera.light.environments.builtin.builtin_environments import builtin_environment
from relit_camera.light.light_map import irradiance, resample_to_light_map


def with_window(where: float, level: float = 1.0, shape: tuple[int, int] = (180, 320)) -> np.ndarray:
    """A dim wall with a bright window about `where`, 0 at the viewer's left to 1."""
    picture = np.full((*shape, 3), 0.1, np.float32)
    middle = round(where * shape[1])
    picture[shape[0] // 4 : shape[0] // 2, max(0, middle - 25) : middle + 25] = level
    return picture


def seen(radiance: np.ndarray, bearing_deg: float, elevation_deg: float) -> np.ndarray:
    """What the viewer sees along −Z, so many degrees to the right and up."""
    row, column = map_position_from_direction(
        direction_from_degrees(180 - bearing_deg, elevation_deg), *radiance.shape[:2]
    )
    return radiance[round(float(row)), round(float(column)) % radiance.shape[1]]


def reading(picture: np.ndarray, azimuth: float, elevation: float = 0) -> float:
    light_map = resample_to_light_map(panorama_from_background(picture).radiance)
    return float(irradiance(light_map, direction_from_degrees(azimuth, elevation)).mean())


def test_the_picture_is_where_it_is_seen() -> None:
    picture = np.zeros((180, 320, 3), np.float32)
    picture[:90, :160, 0] = picture[:90, 160:, 1] = picture[90:, :160, 2] = 0.5
    radiance = panorama_from_background(picture).radiance
    np.testing.assert_allclose(seen(radiance, -15, 9), (0.5, 0, 0), atol=1e-5)
    np.testing.assert_allclose(seen(radiance, 15, 9), (0, 0.5, 0), atol=1e-5)
    np.testing.assert_allclose(seen(radiance, -15, -9), (0, 0, 0.5), atol=1e-5)


def test_it_is_35_degrees_high() -> None:
    picture = np.zeros((180, 320, 3), np.float32)
    picture[:6] = 0.5
    radiance = panorama_from_background(picture).radiance
    assert seen(radiance, 0, 17.0)[0] > 0.4
    assert seen(radiance, 0, 15.0)[0] < 0.1


def test_a_window_the_viewer_sees_at_the_left_lights_the_left_rim_and_the_left_of_the_face() -> None:
    left = with_window(0.15)
    assert reading(left, -120) > 1.8 * reading(left, 120)
    assert reading(left, -45) > 1.3 * reading(left, 45)


def test_light_is_mirrored_when_the_picture_is() -> None:
    left, right = with_window(0.15), with_window(0.15)[:, ::-1]
    for azimuth in (-120, -45, 0, 80):
        assert reading(left, azimuth) == pytest.approx(reading(right, -azimuth), rel=0.02)


def test_the_face_is_never_lit_from_behind_alone() -> None:
    assert reading(with_window(0.5), 0) > 0.3 * reading(with_window(0.5), 180)


def test_a_bright_top_lights_from_above() -> None:
    picture = np.full((180, 320, 3), 0.05, np.float32)
    picture[:60] = 0.7
    assert reading(picture, 0, 80) > 2 * reading(picture, 0, -80)


def test_clipped_highlights_are_taken_to_be_brighter_than_white() -> None:
    radiance = panorama_from_background(with_window(0.5, 1.0)).radiance
    assert 4 < radiance.max() <= 8
    assert panorama_from_background(with_window(0.5, 0.8)).radiance.max() == pytest.approx(0.8, rel=1e-3)


def test_a_white_wall_is_no_lamp() -> None:
    radiance = panorama_from_background(np.ones((90, 160, 3), np.float32)).radiance
    np.testing.assert_allclose(radiance, 1, rtol=1e-5)


def test_one_colour_is_even_light() -> None:
    colour = np.array([0.02, 0.1, 0.4], np.float32)
    radiance = panorama_from_background(np.broadcast_to(colour, (90, 160, 3)).copy()).radiance
    assert radiance.dtype == np.float32
    np.testing.assert_allclose(radiance, np.broadcast_to(colour, radiance.shape), rtol=1e-4)


@pytest.mark.parametrize("shape", [(1, 1), (3, 500), (500, 3), (720, 1280), (90, 180)])
def test_any_shape_of_picture_gives_light(shape: tuple[int, int]) -> None:
    picture = np.random.default_rng(0).random((*shape, 3)).astype(np.float32)
    panorama = panorama_from_background(picture)
    assert np.isfinite(panorama.radiance).all()
    assert panorama.radiance.min() >= 0
    assert "Guessed" in panorama.notes[0]


def test_a_black_picture_gives_no_light() -> None:
    assert not panorama_from_background(np.zeros((90, 160, 3), np.float32)).radiance.any()


@pytest.mark.parametrize("name", ["window", "overcast", "night-street"])
def test_a_panorama_is_used_exactly(name: str) -> None:
    shown = builtin_environment(name).panorama.radiance[:, ::-1]
    picture = linear_from_uint8(uint8_from_linear(shown))
    panorama = panorama_from_background(picture)
    assert "exact" in panorama.notes[0]
    height, width = picture.shape[:2]
    for row, column in ((100, 30), (256, 512), (300, 700), (400, 1000)):
        bearing, elevation = (column + 0.5) / width * 360 - 180, 90 - (row + 0.5) / height * 180
        np.testing.assert_array_equal(seen(panorama.radiance, bearing, elevation), picture[row, column])


@pytest.mark.parametrize("where", [0.15, 0.35])
def test_a_window_at_the_left_of_a_panorama_lights_the_left_rim(where: float) -> None:
    picture = with_window(where, shape=(256, 512))
    assert "exact" in panorama_from_background(picture).notes[0]
    assert reading(picture, -120) > 1.3 * reading(picture, 120)


def test_an_ordinary_picture_of_two_to_one_is_no_panorama() -> None:
    picture = with_window(0.1, shape=(200, 400))
    picture[:, 200:] *= np.linspace(1, 4, 200)[:, None]
    assert "Guessed" in panorama_from_background(picture).notes[0]
