"""Simulated webcam frames: exposure, noise, and the room behind the person."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.images.color import linear_from_uint8
from relit_camera.lab.evaluate.ladder.webcam_frames import WEBCAM, enlarged, film_in_room
from relit_camera.light.environments.environment_panorama import (
    Environment,
    environment_from_panorama,
    panorama_from_radiance,
)
from tests.lab.ladder.known_head import known_head

pytestmark = pytest.mark.slow


def gray_room(radiance: float = 1.0) -> Environment:
    return environment_from_panorama("gray", panorama_from_radiance(np.full((64, 128, 3), radiance, np.float32)))


def test_frames_differ_by_the_noise_of_the_sensor_alone() -> None:
    frames = film_in_room(known_head(), gray_room(), 12).frames
    stack = np.stack(frames).astype(float)
    assert stack.shape == (12, WEBCAM.side_px, WEBCAM.side_px, 3)
    mean, deviation = stack.mean(axis=0), stack.std(axis=0, ddof=1)
    middle = np.abs(mean - 128) < 12
    assert middle.sum() > 1000
    assert np.sqrt((deviation[middle] ** 2).mean()) == pytest.approx(WEBCAM.noise_codes, rel=0.15)


def test_exposure_does_not_depend_on_the_rooms_brightness_and_clips_nobody() -> None:
    dim, bright = (film_in_room(known_head(), gray_room(level), 1).frames[0] for level in (0.01, 100))
    assert np.abs(dim.astype(int) - bright).max() <= 2
    person = enlarged(known_head().samples.matte) > 0.99
    assert np.percentile(linear_from_uint8(bright)[person], WEBCAM.clipped_percentile) <= WEBCAM.clipped_at + 0.02


def test_the_person_is_lit_by_the_room_that_is_seen_behind() -> None:
    radiance = np.full((64, 128, 3), (0.2, 0.4, 1.0), np.float32)
    blue = film_in_room(known_head(), environment_from_panorama("blue", panorama_from_radiance(radiance)), 1).frames[0]
    gray = film_in_room(known_head(), gray_room(), 1).frames[0]
    matte = enlarged(known_head().samples.matte)
    for part in (matte > 0.99, matte < 0.01):
        ratio = linear_from_uint8(blue)[part].mean(axis=0) / linear_from_uint8(gray)[part].mean(axis=0)
        assert ratio[2] / ratio[0] == pytest.approx(5, rel=0.25)
