"""Live frames of any size fitted to the output's."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from relit_camera.base.images.image_types import Frame
from relit_camera.face.face_state import FaceState, FaceStatus
from relit_camera.face.head_pose import project, unproject
from relit_camera.face.motion.face_follower import FaceFollower, FaceMotion
from relit_camera.live.modes.frame_fitting import TUNABLES, FaceCut, fit_frame, fit_motion
from tests.face.faces import SCHEME, SIZE, face
from tests.small_camera import difference

OUT = (270, 360)
"""Another shape than that of the frames, `SIZE`: a cut of 360 by 480 of their pixels."""


def frame(index: int, image: np.ndarray) -> Frame:
    return Frame(image, index, 0.0, 0.0)


def test_fitted_covers_and_centres() -> None:
    wide = np.zeros((100, 400, 3), np.uint8)
    wide[:, 190:210] = 255
    cut = fit_frame(frame(3, wide), (200, 100))
    assert cut.size == (200, 100)
    assert cut.index == 3
    np.testing.assert_array_equal(cut.image, wide[:, 100:300])
    same = frame(0, wide)
    assert fit_frame(same, (400, 100)) is same
    small = fit_frame(frame(0, wide), (100, 50)).image
    expected = np.asarray(cv2.resize(wide[:, 100:300], (100, 50), interpolation=cv2.INTER_AREA), np.uint8)
    assert difference(small, expected) < 2
    stripes = np.zeros((90, 180, 3), np.uint8)
    stripes[:, ::3] = 255
    assert (fit_frame(frame(0, stripes), (60, 30)).image == 85).all()  # what is finer than its pixels is averaged


def motion_of(state: FaceState) -> FaceMotion:
    return FaceFollower(SCHEME.name).follow(state, SIZE, 0.0)


def at(index: int) -> Frame:
    return Frame(np.zeros((SIZE[1], SIZE[0], 3), np.uint8), index, 0.0, index / 30)


def is_within(motion: FaceMotion, size: tuple[int, int]) -> bool:
    return bool((motion.landmarks >= 0).all() and (motion.landmarks <= size).all())


@pytest.mark.parametrize("side", [-1, 1])
def test_a_face_beside_the_middle_is_in_the_cut_from_the_first_frame(side: int) -> None:
    motion = motion_of(face(at=(20.0 * side, 0, -60)))
    middle = FaceCut(OUT).middle(motion, at(0))
    assert not is_within(fit_motion(motion, SIZE, OUT), OUT)
    assert is_within(fit_motion(motion, SIZE, OUT, middle), OUT)


def test_the_top_of_a_tall_frame_is_not_cut_off() -> None:
    tall, out = (360, 640), (640, 360)
    motion = replace(motion_of(face()), landmarks=np.array([[120, 60], [240, 220]], np.float32))
    frame = Frame(np.zeros((640, 360, 3), np.uint8), 0, 0.0, 0.0)
    assert is_within(fit_motion(motion, tall, out, FaceCut(out).middle(motion, frame)), out)


def test_pose_and_landmarks_of_a_cut_frame_still_belong_together() -> None:
    motion = motion_of(face(yaw=20, at=(12.0, 5.0, -60)))
    assert motion.pose is not None
    points = fit_motion(motion, SIZE, OUT, (0.7, 0.5))
    assert points.pose is not None
    before = unproject(motion.landmarks, motion.pose, SCHEME, SIZE)
    np.testing.assert_allclose(project(before, points.pose, OUT), points.landmarks, atol=0.01)
    np.testing.assert_allclose(unproject(points.landmarks, points.pose, SCHEME, OUT), before, atol=1e-3)
    marks = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
    x, y = motion.landmarks[30]
    cv2.circle(marks, (round(float(x)), round(float(y))), 3, (255, 255, 255), -1)
    cut = fit_frame(frame(0, marks), OUT, (0.7, 0.5)).image[..., 0]
    rows, columns = np.nonzero(cut > 100)
    np.testing.assert_allclose([columns.mean() + 0.5, rows.mean() + 0.5], points.landmarks[30], atol=1)


def test_the_cut_follows_gently_and_small_motion_not_at_all() -> None:
    cut, here, near, far = FaceCut(OUT), *(motion_of(face(at=(x, 0, -60))) for x in (0.0, 1.5, 12.0))
    begins = [cut.middle(here, at(index))[0] for index in range(3)]
    assert len(set(begins)) == 1
    assert {cut.middle(near, at(index))[0] for index in range(3, 30)} == set(begins)
    moved = [cut.middle(far, at(index))[0] for index in range(30, 210)]
    steps = np.diff([begins[-1], *moved])
    assert (steps >= 0).all()
    assert steps.max() < 0.01  # of the frame's width in a frame: a few pixels
    assert moved[-1] == moved[-2], "it comes to rest: others are not relit anew for it"
    wanted = far.landmarks[:, 0]
    assert moved[-1] == pytest.approx((wanted.min() + wanted.max()) / 2 / SIZE[0], abs=0.005)


def test_where_a_face_is_lost_the_cut_stays_and_before_one_it_is_in_the_middle() -> None:
    cut, aside = FaceCut(OUT), motion_of(face(at=(15.0, 0, -60)))
    assert cut.middle(motion_of(FaceState(FaceStatus.LOST)), at(0)) == (0.5, 0.5)
    there = cut.middle(aside, at(1))
    assert there[0] > 0.6
    assert cut.middle(replace(aside, status=FaceStatus.LOST), at(2)) == there


def test_after_a_pause_the_cut_is_at_the_face_at_once() -> None:
    cut, left, right = FaceCut(OUT), motion_of(face(at=(-15.0, 0, -60))), motion_of(face(at=(15.0, 0, -60)))
    cut.middle(left, at(0))
    later = cut.middle(right, at(1 + round(30 * TUNABLES.gap_s)))
    assert later == FaceCut(OUT).middle(right, at(0))


def test_frames_of_the_output_s_shape_are_not_cut() -> None:
    motion = motion_of(face(at=(15.0, 0, -60)))
    assert FaceCut((320, 240)).middle(motion, at(0)) == (0.5, 0.5)
    assert fit_motion(motion, SIZE, SIZE) is motion
