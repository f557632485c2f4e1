"""The room's light from the live face: as good as the relit picture that it gives."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from relit_camera.base.images.color import linear_from_uint8, uint8_from_linear
from relit_camera.base.images.image_quality import psnr
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.rotations import Rotation, rotation_from_angles
from relit_camera.light.light_map import LightMap
from relit_camera.light.light_map_rotation import rotate_light_map
from relit_camera.live.modes.room_light_estimator import (
    TUNABLES,
    RoomLightEstimate,
    RoomLightEstimator,
    relative_deviation,
)
from tests.live.people import close_up, face_of
from tests.live.rooms import EVENING, WINDOW, before_the_camera, live_picture, relighter, still_under

SECONDS = 3.0


def watched(
    probe: RoomLightEstimator,
    image: DisplayImage,
    turn: Rotation | None = None,
    seconds: float = SECONDS,
    start: float = 0.0,
):
    """What the probe says after watching one picture for a while."""
    motion = before_the_camera(turn)
    for time_s in np.arange(start, start + seconds, 1 / 15):
        room = probe.update(image, motion.landmarks, motion.rotation, float(time_s))
    return room


def fresh_probe() -> RoomLightEstimator:
    return RoomLightEstimator(close_up(), face_of(close_up()))


def seen(room: RoomLightEstimate, turn: Rotation | None = None) -> np.ndarray:
    """The still under the light that the probe says."""
    light = room.light_map if turn is None else rotate_light_map(room.light_map, turn)
    return relighter().relight(light[None])[0] * room.gain


@pytest.mark.parametrize("light", [WINDOW, EVENING], ids=["window", "evening"])
def test_it_recovers_the_relit_picture_of_a_known_room(light: LightMap) -> None:
    room = watched(fresh_probe(), live_picture(light))
    assert psnr(seen(room), still_under(light)) > 30
    assert room.residual < 0.1
    np.testing.assert_allclose(room.gain, 1, atol=0.05)


def test_the_light_is_fixed_in_the_room_when_the_head_turns() -> None:
    """Watched with the head turned, it is the room's light that is found: it predicts the face looking straight."""
    turn = rotation_from_angles(20, 5, 0)
    room = watched(fresh_probe(), live_picture(WINDOW, turn), turn)
    assert psnr(seen(room, turn), still_under(WINDOW, turn)) > 30
    assert psnr(seen(room), still_under(WINDOW)) > 25


def test_light_is_never_negative_and_its_side_is_right() -> None:
    room = watched(fresh_probe(), live_picture(WINDOW)).light_map
    assert room.shape == (32, 64, 3)
    assert room.dtype == np.float32
    assert room.min() >= 0
    assert room[:, 32:48].sum() > 3 * room[:, 16:32].sum()  # the window is at the picture's right, before the person


def test_a_change_of_exposure_is_a_gain_at_once() -> None:
    probe = fresh_probe()
    image = live_picture(WINDOW)
    watched(probe, image)
    darker = uint8_from_linear(linear_from_uint8(image) * np.float32(0.6))
    motion = before_the_camera()
    before = probe.update(image, motion.landmarks, motion.rotation, 10.0)
    room = probe.update(darker, motion.landmarks, motion.rotation, 10.0 + 0.3 / TUNABLES.fits_per_s)
    np.testing.assert_allclose(room.gain / before.gain, 0.6, atol=0.03)
    np.testing.assert_array_equal(room.light_map, before.light_map)


@pytest.mark.parametrize("degrees", [0.1, 0.4, 5.0])
def test_between_fits_the_head_s_frame_follows_the_head(degrees: float) -> None:
    probe = fresh_probe()
    before = watched(probe, live_picture(WINDOW))
    turn = rotation_from_angles(degrees, 0, 0)
    motion = before_the_camera(turn)
    time_s = SECONDS - 1 / 15 + 0.1 / TUNABLES.fits_per_s
    room = probe.update(live_picture(WINDOW, turn), motion.landmarks, motion.rotation, time_s)
    np.testing.assert_array_equal(room.light_map, before.light_map)
    expected = rotate_light_map(room.light_map, turn)
    scale = float(expected.max())
    np.testing.assert_allclose(room.in_head_frame(motion.rotation) / scale, expected / scale, atol=0.02)
    np.testing.assert_allclose(room.gain, before.gain, rtol=0.05)


def test_a_new_light_is_followed_within_seconds() -> None:
    probe = fresh_probe()
    watched(probe, live_picture(WINDOW))
    room = watched(probe, live_picture(EVENING), start=SECONDS)
    assert psnr(seen(room), still_under(EVENING)) > 28


def test_a_hand_before_part_of_the_face_hardly_matters() -> None:
    image = live_picture(WINDOW)
    height, width = image.shape[:2]
    covered = image.copy()
    covered[int(0.62 * height) :, : int(0.45 * width)] = (40, 160, 40)
    room = watched(fresh_probe(), covered)
    assert psnr(seen(room), still_under(WINDOW)) > 22


def test_what_no_light_explains_has_a_large_residual() -> None:
    noise = np.random.default_rng(1).integers(20, 220, live_picture(WINDOW).shape).astype(np.uint8)
    coarse = np.asarray(cv2.resize(noise[::24, ::24], noise.shape[1::-1]), np.uint8)
    assert watched(fresh_probe(), coarse).residual > 0.5


def test_the_same_errors_count_less_in_light_that_makes_shading_strong() -> None:
    """An error is a share of the light that falls on a point, so hard light makes all of them larger."""
    rng = np.random.default_rng(2)
    shading = rng.uniform(-0.4, 0.4, (500, 1)).astype(np.float32)
    errors = rng.normal(0, 0.1, (500, 3)).astype(np.float32)

    def found(contrast: float, color: tuple[float, float, float] = (1, 1, 1)) -> float:
        tint = np.array(color, np.float32)
        return relative_deviation((1 + contrast * shading) * tint, (1 + contrast * shading * (1 + errors)) * tint)

    assert found(2.0) == pytest.approx(found(1.0), rel=0.3)
    assert found(1.0, (1, 0.05, 0.4)) == pytest.approx(found(1.0), rel=1e-4), "nor does its color count"
    assert found(0.1) < 0.7 * found(1.0), "of a face in flat light little but noise is left"


def test_black_white_and_absent_faces_are_no_trouble() -> None:
    """Nothing usable: the answer stays finite."""
    motion = before_the_camera()
    for image in (np.zeros_like(live_picture(WINDOW)), np.full_like(live_picture(WINDOW), 255)):
        room = watched(fresh_probe(), image, seconds=1.0)
        assert np.isfinite(room.light_map).all()
        assert np.isfinite(room.gain).all()
    outside = fresh_probe().update(live_picture(WINDOW), motion.landmarks + 5000, motion.rotation, 0.0)
    assert np.isfinite(outside.light_map).all()
