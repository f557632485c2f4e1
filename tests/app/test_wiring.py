"""What the settings become: the parts that the camera runs with are those that were tuned and measured."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np

from relit_camera.app.wiring import make_follower
from relit_camera.base.config.settings import TrackerSettings
from relit_camera.face.face_state import Tracker
from relit_camera.face.motion.face_follower import FaceFollower
from relit_camera.face.motion.one_euro_filter import FACE_SMOOTHING
from tests.face.faces import RATE, SCHEME, SIZE, face

TRACKER = cast(Tracker, SimpleNamespace(scheme=SCHEME.name))


def angles(follower: FaceFollower, swing_deg: float) -> np.ndarray:
    """A head that turns from side to side, followed for two seconds: (60, 3) degrees."""
    turned = swing_deg * np.sin(2 * np.pi * np.arange(60) / RATE)
    return np.array([follower.follow(face(yaw), SIZE, at / RATE).angles for at, yaw in enumerate(turned)])


def test_the_live_follower_smooths_as_it_was_measured() -> None:
    """`docs/trackers.md` has the figures of `FaceFollower` alone; the settings change its dead band and reach only."""
    band = FACE_SMOOTHING.rotation.dead_band
    live = make_follower(TrackerSettings.model_validate({"dead_band_deg": band}), TRACKER)
    np.testing.assert_array_equal(angles(live, 20), angles(FaceFollower(SCHEME.name), 20))


def test_within_the_dead_band_of_the_settings_the_head_rests() -> None:
    held = make_follower(TrackerSettings(dead_band_deg=5), TRACKER)
    assert np.ptp(angles(held, 2), axis=0).max() < 1e-6
