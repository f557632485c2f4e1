"""The webcam: exposure that settles with delay, balance that drifts, and noise of a stated size."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.images.color import linear_from_uint8, luminance
from relit_studio.cameras.camera_simulation import Gains
from relit_studio.drive.webcam import SENSOR, Webcam

HEIGHT, WIDTH = 90, 160


def flat(level: float, tint: tuple[float, float, float] = (1, 1, 1)) -> np.ndarray:
    return np.full((HEIGHT, WIDTH, 3), level, np.float32) * np.array(tint, np.float32)


def test_it_is_settled_when_the_video_begins() -> None:
    for level in (0.3, 1.0, 3.0):
        webcam = Webcam(1, flat(level))
        picture = webcam.develop(flat(level), webcam.gains, 0)
        assert luminance(linear_from_uint8(picture)).mean() == pytest.approx(0.25, rel=0.02)


def test_exposure_follows_a_change_with_delay() -> None:
    webcam = Webcam(1, flat(1.0))
    start, course = webcam.gains.exposure_ev, []
    for _ in range(96):
        webcam.follow(flat(2.0))
        course.append(webcam.gains.exposure_ev - start)
    assert abs(course[0]) < 0.1
    assert abs(course[11]) < 0.9 < 0.97 < abs(course[-1]) < 1.03  # one stop, in seconds rather than frames
    assert min(course) > -1.1


def test_frames_left_out_are_followed_all_the_same() -> None:
    each, several = Webcam(1, flat(1.0)), Webcam(1, flat(1.0))
    for _ in range(6):
        each.follow(flat(1.7))
    several.follow(flat(1.7), 6)
    assert each.gains == several.gains


def test_a_dark_room_is_noisier_and_its_gain_has_a_limit() -> None:
    noise = []
    for level in (2.0, 0.2):
        webcam = Webcam(1, flat(level))
        picture = webcam.develop(flat(level), webcam.gains, 0)
        noise.append(linear_from_uint8(picture).std())
    assert noise[1] > 2.5 * noise[0]
    assert Webcam(1, flat(1e-4)).gains.exposure_ev == 2.5


def test_noise_has_the_stated_standard_deviation() -> None:
    light, gains = flat(1.2), Gains(exposure_ev=0.5)
    seen = linear_from_uint8(Webcam(3, light).develop(light, gains, 0)) / gains.exposure
    value = 1.2 * SENSOR.white
    # A code of the sRGB curve spans about 0.0045 here: a uniform error besides.
    step = 0.0045 / gains.exposure
    expected = np.sqrt(SENSOR.shot * value + SENSOR.read**2 + step**2 / 12)
    assert seen.mean() == pytest.approx(value, rel=0.003)
    assert seen.std() == pytest.approx(expected, rel=0.05)


def test_another_seed_is_other_noise_of_the_same_mean() -> None:
    light, gains = flat(1.2), Gains()
    first, again, other = (Webcam(seed, light).develop(light, gains, 0) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first, again)
    assert (first != other).mean() > 0.5
    assert first.mean() == pytest.approx(other.mean(), abs=0.1)
    assert (first != Webcam(3, light).develop(light, gains, 1)).mean() > 0.5


def test_white_balance_drifts_and_takes_half_of_a_tint_for_the_lights() -> None:
    webcam = Webcam(5, flat(1.0, (1.2, 1, 0.8)))
    assert webcam.gains.balance == pytest.approx((0, 0), abs=1e-3)
    drift = np.array([webcam.set_at(time_s).balance for time_s in np.arange(0, 300, 1 / 24)])
    assert drift.std() == pytest.approx(0.04, rel=0.3)
    assert np.abs(np.diff(drift, axis=0)).max() < 0.01
    webcam.follow(flat(1.0, (1.3, 1, 0.8)), 400)
    assert webcam.gains.balance == pytest.approx((-0.5 * np.log(1.3 / 1.2), 0), abs=1e-3)
