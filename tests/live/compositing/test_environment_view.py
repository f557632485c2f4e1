from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from relit_camera.base.images.color import luminance
from relit_camera.base.images.tone_mapping import linear_from_display
from relit_camera.base.rotations import Rotation, rotation_from_angles
from relit_camera.light.directions import direction_from_degrees, texel_directions
from relit_camera.light.environments.environment_panorama import Panorama, read_panorama
from relit_camera.light.exposure import auto_exposure_scale
from relit_camera.light.light_map import irradiance, resample_to_light_map
from relit_camera.live.compositing.environment_view import EnvironmentView

SIZE = (320, 180)
UPRIGHT = Rotation.identity()
UNIT = 1 / np.pi
"""The exposure at which radiance is display light."""


def panorama_with_lamp(direction: np.ndarray, width_deg: float = 2.0, height: int = 256) -> Panorama:
    """Black but for a round lamp of radiance 0.7 around a direction of the map."""
    angle = np.degrees(np.arccos(np.clip(texel_directions(height, 2 * height) @ direction, -1, 1)))
    lamp = 0.7 * (angle < width_deg / 2)
    return Panorama(np.repeat(lamp[..., None], 3, axis=2).astype(np.float32))


def centroid(picture: np.ndarray) -> np.ndarray:
    """Middle (x, y) of the light, pixel centres at integers + ½."""
    light = luminance(linear_from_display(picture))
    y, x = np.mgrid[: picture.shape[0], : picture.shape[1]] + 0.5
    return np.array([(light * x).sum(), (light * y).sum()]) / light.sum()


def projected(direction: np.ndarray, height_deg: float) -> np.ndarray:
    """Pixel of a direction in front of a camera that looks along -Z: the pinhole's definition."""
    focal = SIZE[1] / 2 / np.tan(np.radians(height_deg / 2))
    return np.array(
        [SIZE[0] / 2 - focal * direction[0] / direction[2], SIZE[1] / 2 + focal * direction[1] / direction[2]]
    )


@pytest.mark.parametrize(
    ("azimuth", "elevation", "angles", "height_deg"),
    [
        (180, 0, (0, 0, 0), 35),
        (-160, 5, (0, 0, 0), 35),
        (165, -10, (0, 0, 0), 35),
        (-130, 20, (0, 0, 0), 90),
        (150, 3, (20, 0, 0), 35),
        (-170, 0, (0, 0, 25), 35),
        (-60, 30, (-115, -20, 10), 60),
        (170, 4, (8, 12, -30), 50),
    ],
)
def test_a_lamp_is_seen_where_its_direction_in_the_room_projects_to(
    azimuth: float, elevation: float, angles: tuple[float, float, float], height_deg: float
) -> None:
    in_map, rotation = direction_from_degrees(azimuth, elevation), rotation_from_angles(*angles)
    in_room = rotation.apply(in_map)
    assert in_room[2] < -0.5, "the case is meant to be in view"
    picture = EnvironmentView(panorama_with_lamp(in_map), SIZE, height_deg).picture(rotation, UNIT)
    np.testing.assert_allclose(centroid(picture), projected(in_room, height_deg), atol=1.0)


@pytest.mark.parametrize(("columns", "side"), [(slice(236, 248), "left"), (slice(8, 20), "right")])
def test_a_window_lights_the_rim_on_the_side_where_it_is_seen(tmp_path: Path, columns: slice, side: str) -> None:
    """From a panorama file to the view and to the light: to the right of the file's middle lies -X, and so on round."""
    file = np.full((128, 256, 3), 4, np.uint8)
    file[50:74, columns] = 200
    cv2.imwrite(str(tmp_path / "window.png"), file)
    panorama = read_panorama(tmp_path / "window.png")

    light = luminance(linear_from_display(EnvironmentView(panorama, SIZE, 60.0, 0.1).picture(UPRIGHT, UNIT)))
    left, right = light[:, : SIZE[0] // 2].sum(), light[:, SIZE[0] // 2 :].sum()
    light_map = resample_to_light_map(panorama.radiance)
    left_rim, right_rim = (luminance(irradiance(light_map, (x, 0.0, -0.3))) for x in (-1.0, 1.0))
    if side == "right":
        left, right, left_rim, right_rim = right, left, right_rim, left_rim
    assert left > 5 * right
    assert left_rim > 3 * right_rim


def test_a_white_wall_behind_is_as_bright_as_a_white_ball_before_it() -> None:
    """In even light, radiance 1, a ball's irradiance is π: shown at 0.8, the wall of that light must read 0.8 too."""
    even = Panorama(np.ones((32, 64, 3), np.float32))
    picture = EnvironmentView(even, SIZE, 35.0, 0.2).picture(
        UPRIGHT, auto_exposure_scale(resample_to_light_map(even.radiance))
    )
    np.testing.assert_allclose(linear_from_display(picture), 0.8, atol=0.01)


@pytest.mark.parametrize("blur", [0.15, 0.5, 1.0])
def test_blur_spreads_a_point_by_its_sigma_and_keeps_its_light(blur: float) -> None:
    direction = direction_from_degrees(180, 0)
    panorama = Panorama(panorama_with_lamp(direction, 1.0, 1024).radiance)
    sharp, soft = (EnvironmentView(panorama, SIZE, 35.0, amount).picture(UPRIGHT, UNIT) for amount in (0.0, blur))
    sharp_light, soft_light = (linear_from_display(picture)[..., 0].astype(float) for picture in (sharp, soft))
    assert soft_light.sum() == pytest.approx(sharp_light.sum(), rel=0.15)
    x = np.arange(SIZE[0]) + 0.5 - SIZE[0] / 2
    spread = np.sqrt((soft_light.sum(axis=0) * x**2).sum() / soft_light.sum())
    assert spread == pytest.approx(0.1 * blur * SIZE[1], rel=0.15)


def test_the_seam_of_the_panorama_does_not_show() -> None:
    directions = texel_directions(64, 128)
    smooth = 0.4 + 0.3 * directions[..., 0] + 0.1 * directions[..., 1]
    panorama = Panorama(np.repeat(smooth[..., None], 3, axis=2).astype(np.float32))
    light = linear_from_display(EnvironmentView(panorama, SIZE, 60.0).picture(UPRIGHT, UNIT))[..., 0]
    focal = SIZE[1] / 2 / np.tan(np.radians(30))
    y, x = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5
    ray = np.stack([(x - SIZE[0] / 2) / focal, -(y - SIZE[1] / 2) / focal, -np.ones_like(x)], axis=-1)
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    np.testing.assert_allclose(light, 0.4 + 0.3 * ray[..., 0] + 0.1 * ray[..., 1], atol=0.008)


@pytest.mark.parametrize(("pitch", "expected"), [(-90, 0.6), (90, 0.1)])
def test_the_poles_can_be_looked_at(pitch: float, expected: float) -> None:
    """Pitch 90° turns the map's front down, to -Y, and so its nadir to -Z, into view; pitch -90° its zenith."""
    radiance = np.zeros((64, 128, 3), np.float32)
    radiance[:3], radiance[-3:] = 0.6, 0.1
    picture = EnvironmentView(Panorama(radiance), SIZE, 20.0).picture(rotation_from_angles(0, pitch), UNIT)
    np.testing.assert_allclose(linear_from_display(picture)[80:100, 150:170, 0], expected, atol=0.01)


def test_a_fine_panorama_does_not_alias_in_a_small_view() -> None:
    checks = np.indices((1024, 2048)).sum(axis=0) % 2
    panorama = Panorama(np.repeat(0.6 * checks[..., None], 3, axis=2).astype(np.float32))
    light = linear_from_display(EnvironmentView(panorama, (96, 54), 120.0).picture(UPRIGHT, UNIT))
    assert light.std() < 0.05
    assert light.mean() == pytest.approx(0.3, abs=0.02)


def test_a_view_keeps_no_direction_for_each_pixel() -> None:
    view = EnvironmentView(panorama_with_lamp(np.array([0.0, 0.0, -1.0])), (1280, 720), 50.0)
    kept = sum(value.nbytes for value in vars(view).values() if isinstance(value, np.ndarray))
    assert kept < 3 * 1280 * 720
