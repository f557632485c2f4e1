"""Following a head without a tracker: it moves aside and nearer as the picture shows, and comes to rest where lost."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from relit_camera.base.images.image_types import Frame
from relit_camera.base.rotations import rotation_from_angles
from relit_camera.face.face_state import FaceStatus
from relit_camera.face.head_pose import project
from relit_camera.live.supervision.head_movement import TUNABLES, HeadMovement
from tests.live.people import LIVE_SIZE, NOBODY, motion

ORIGIN = np.zeros((1, 3))


def frame(time_s: float, right: float = 0.0, down: float = 0.0, grown: float = 1.0) -> Frame:
    """A patterned picture, moved by pixels and grown about its middle."""
    pattern = np.random.default_rng(1).uniform(0, 255, (LIVE_SIZE[1], LIVE_SIZE[0], 3)).astype(np.float32)
    pattern = cv2.normalize(cv2.GaussianBlur(pattern, (0, 0), 3), None, 0, 255, cv2.NORM_MINMAX)
    x, y = (1 - grown) * np.array(LIVE_SIZE) / 2 + [right, down]
    moved = cv2.warpAffine(pattern, np.array([[grown, 0, x], [0, grown, y]]), LIVE_SIZE, borderMode=cv2.BORDER_REFLECT)
    return Frame(moved.astype(np.uint8), int(30 * time_s), time_s, time_s)


def following() -> HeadMovement:
    head = HeadMovement()
    head.begin_at(frame(0.0), motion())
    return head


def test_nothing_is_followed_before_a_face_was_found() -> None:
    head = HeadMovement()
    assert head.motion(frame(0.0)) is None
    head.begin_at(frame(0.0), NOBODY)
    assert head.motion(frame(0.1)) is None


def test_a_head_that_stays_keeps_its_motion() -> None:
    found = following().motion(frame(0.1))
    assert found is not None
    np.testing.assert_allclose(found.translation, 0, atol=0.05)


def test_a_head_that_moves_aside_takes_its_place_in_the_picture_along() -> None:
    head = following()
    for step in range(1, 11):
        found = head.motion(frame(0.1 * step, right=2.0 * step, down=step))
    assert found is not None
    pose = motion(shift=found.translation).pose
    before = motion().pose
    assert pose is not None
    assert before is not None
    way = project(ORIGIN, pose, LIVE_SIZE) - project(ORIGIN, before, LIVE_SIZE)
    np.testing.assert_allclose(way, [[20, 10]], atol=0.7)
    assert abs(found.translation[2]) < 1.0


def test_a_head_that_comes_nearer_is_larger() -> None:
    head = following()
    for step in range(1, 11):
        found = head.motion(frame(0.1 * step, grown=1 + 0.02 * step))
    assert found is not None
    assert found.translation[2] == pytest.approx(60 - 60 / 1.2, abs=1.0)


def test_a_head_that_is_lost_comes_to_rest_and_is_found_again() -> None:
    head = HeadMovement()
    head.begin_at(frame(0.0), motion(shift=(6, 0, 0)))
    grey = np.full((LIVE_SIZE[1], LIVE_SIZE[0], 3), 90, np.uint8)
    ways = []
    for step in range(1, 9):
        found = head.motion(Frame(grey, step, 0.1 * step, 0.1 * step))
        assert found is not None
        ways.append(float(found.translation[0]))
    assert np.abs(np.diff([6.0, *ways])).max() < 6 * 1.6 * 0.1 / TUNABLES.ease_s  # eased, without a jump
    assert ways[-1] == 0
    for step in range(9, 16):
        found = head.motion(frame(0.1 * step))
    assert found is not None
    assert found.translation[0] == pytest.approx(6, abs=0.1)
    assert found.status is FaceStatus.FOUND


def test_another_picture_size_is_no_head() -> None:
    head = HeadMovement()
    head.begin_at(frame(0.0), motion(rotation_from_angles(25), shift=(6, 0, 0)))
    small = np.zeros((LIVE_SIZE[1] // 2, LIVE_SIZE[0] // 2, 3), np.uint8)
    found = head.motion(Frame(small, 1, 1.0, 1.0))
    assert found is not None
    assert found.presence == 0
    assert found.rotation.magnitude() == 0
    np.testing.assert_array_equal(found.translation, 0)


def test_what_is_forgotten_is_not_followed() -> None:
    head = following()
    assert head.motion(frame(0.1)) is not None
    head.forget()
    assert head.motion(frame(0.2)) is None
    head = following()
    head.forget()
    assert head.motion(frame(0.1)) is None
