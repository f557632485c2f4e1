"""Control points: the right landmarks, lids and lips that part cleanly, anchors that turn as a head does."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.base.rotations import rotation_from_angles
from relit_camera.face.head_pose import HeadPose
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.live.reenactment.control_points import (
    MAX_LANDMARKS,
    NECK_PIVOT,
    SKULL_CENTER,
    ControlPoints,
    control_points,
    feature_boxes,
    head_and_shoulder_anchors,
    select_landmarks,
    shoulder_anchors,
    skull_outline,
)
from relit_camera.live.reenactment.dense_motion import DenseMotion
from relit_camera.live.reenactment.first_order_reenactor import whole_flow
from relit_camera.live.reenactment.mesh.head_mesh import triangulate_head
from relit_camera.live.reenactment.motion_transfer import rotate_about, transfer_motion
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.live.reenactment.warp import Warp
from tests.live.people import SCHEME, face_of, lids_lowered, motion, person

UP = np.array([0.0, -1.0])


@pytest.fixture(scope="module")
def face():
    return face_of(person())


@pytest.fixture(scope="module")
def points(face: SourceFace):
    return control_points(face, head_and_shoulder_anchors(face.pose, face.size))


def test_lips_eyes_brows_and_outline_are_all_chosen(face: SourceFace) -> None:
    chosen = set(select_landmarks(SCHEME, face.landmarks.astype(float)).tolist())
    assert len(chosen) == MAX_LANDMARKS
    assert chosen >= {*SCHEME.lips, *SCHEME.eyes, *SCHEME.right_brow, *SCHEME.left_brow, *SCHEME.oval}
    small = landmark_scheme("openseeface66")
    assert select_landmarks(small, small.canonical[:, :2]).tolist() == list(range(66))


def test_the_chosen_are_spread_evenly(face: SourceFace, points: ControlPoints) -> None:
    """No landmark is far from a chosen one: farthest-point sampling leaves no hole."""
    distance = np.linalg.norm(face.landmarks[:, None] - points.source[None, : len(points.chosen)], axis=2).min(axis=1)
    assert distance.max() < 0.12 * points.unit


def test_pairs_lie_over_each_other(points: ControlPoints) -> None:
    upper, lower = points.source[points.pairs.T]
    assert (lower[:, 1] >= upper[:, 1] - 1e-6).all()
    assert np.abs(lower[:, 0] - upper[:, 0]).max() < 0.06 * points.unit


def test_open_lids_act_where_they_are(points: ControlPoints) -> None:
    """Two landmarks a whole reach apart need no handing over."""
    apart = points.source.copy()
    upper, lower = points.pairs.T
    apart[upper] += 2 * points.radius[upper, None] * UP
    apart[lower] -= 2 * points.radius[lower, None] * UP
    influence = points.influence(apart, UP)
    np.testing.assert_array_equal(influence.center, influence.target)
    np.testing.assert_array_equal(influence.target, apart)
    np.testing.assert_allclose(influence.strength, (points.unit / points.radius) ** 2)


def test_lids_that_would_cross_meet_in_the_middle(points: ControlPoints) -> None:
    crossed = points.source.copy()
    upper, lower = points.pairs.T
    crossed[upper] = points.source[lower] - 2 * UP  # two pixels below the lower one
    crossed[lower] = points.source[lower]
    target = points.influence(crossed, UP).target
    np.testing.assert_allclose(target[upper], target[lower], atol=1e-9)
    np.testing.assert_allclose(target[upper], points.source[lower] - UP)


def test_a_shut_eye_has_no_iris(face: SourceFace, points: ControlPoints) -> None:
    shut, open_ = (
        transfer_motion(face, points, motion(expression=lids_lowered(face, share))).points for share in (1.0, 0.0)
    )
    irises = np.concatenate([iris for iris, _ in points.irises])
    assert len(irises) == 10
    assert points.influence(shut, UP).strength[irises].max() == 0
    assert points.influence(open_, UP).strength[irises].min() > 0


def test_a_blink_shows_the_upper_lid_above_the_slit_and_the_lower_lid_below_it(
    face: SourceFace, points: ControlPoints
) -> None:
    """The eyeball between the still's open lids is nowhere to be seen."""
    moved = transfer_motion(face, points, motion(expression=lids_lowered(face)))
    mesh = triangulate_head(face, head_and_shoulder_anchors(face.pose, face.size))
    _, closing = mesh.with_lids_that_meet(moved.landmarks, moved.pose)
    graph = DenseMotion(SessionOptions())
    patches = whole_flow(graph, mesh, points, moved.points, moved.landmarks, moved.pose, closing)
    still = face.landmarks.astype(float)
    # A fifth of a source pixel from place to place.
    grid = Warp(np.array([[0.2, 0, 0], [0, 0.2, 0]]), patches).grid((0, 0, 5 * face.size[0], 5 * face.size[1]), 1)
    looks_y = grid.nodes()[..., 1]
    x, y = np.meshgrid(*(0.2 * (np.arange(looks_y.shape[i]) + 0.5) for i in (1, 0)))
    for eye in (SCHEME.right_eye, SCHEME.left_eye):
        inner = eye.lids.index(eye.inner)
        upper, lower = eye.lids[1:inner], eye.lids[:inner:-1]
        middle = len(upper) // 2
        for u, v in list(zip(upper, lower, strict=True))[middle - 1 : middle + 2]:
            gap = still[v, 1] - still[u, 1]
            slit = (moved.landmarks[u] + moved.landmarks[v]) / 2
            column = int(np.abs(x[0] - slit[0]).argmin())
            distance = y[:, column] - slit[1]
            above = (distance < -0.35 * gap) & (distance > -0.9 * gap)
            below = (distance > 0.35 * gap) & (distance < 0.9 * gap)
            assert above.any()
            assert below.any()
            assert looks_y[above, column].max() < still[u, 1] + 0.2 * gap
            assert looks_y[below, column].min() > still[v, 1] - 0.2 * gap


def test_feature_boxes_hold_eyes_and_mouth(face: SourceFace) -> None:
    boxes = feature_boxes(face, face.landmarks.astype(float))
    for box, group in zip(boxes, (SCHEME.right_eye.lids, SCHEME.left_eye.lids, SCHEME.lips), strict=True):
        part = face.landmarks[list(group)]
        assert (part > box[:2]).all()
        assert (part < box[2:]).all()


def test_the_skulls_outline_stays_when_the_head_turns_about_its_middle(face: SourceFace) -> None:
    rest = skull_outline(face.pose, face.size)
    nodded = rotate_about(SKULL_CENTER, face.pose, rotation_from_angles(25))
    np.testing.assert_allclose(skull_outline(nodded, face.size), rest, atol=1e-3)


def test_the_skulls_outline_rolls_and_grows_with_the_head(face: SourceFace) -> None:
    rest, size = skull_outline(face.pose, face.size), face.size
    # A roll about the camera's own axis turns the whole picture: positive lifts its right side.
    roll = rotation_from_angles(0, 0, 20)
    rolled = HeadPose(roll * face.pose.rotation, roll.apply(face.pose.translation), face.pose.focal_px)
    across = (rest - np.array(size) / 2) * [1, -1]
    expected = roll.apply(np.column_stack([across, np.zeros(len(across))]))[:, :2] * [1, -1] + np.array(size) / 2
    np.testing.assert_allclose(skull_outline(rolled, size), expected, atol=1e-3)
    near = dataclasses.replace(face.pose, translation=face.pose.translation * [1, 1, 0.8])
    assert np.ptp(skull_outline(near, size)[:, 0]) > 1.15 * np.ptp(rest[:, 0])


def test_shoulders_stay_while_the_head_turns_on_its_neck(face: SourceFace) -> None:
    turned = rotate_about(NECK_PIVOT, face.pose, rotation_from_angles(25, 10, 5))
    np.testing.assert_allclose(shoulder_anchors(turned, face.size), shoulder_anchors(face.pose, face.size), atol=1e-3)
    assert shoulder_anchors(face.pose, face.size)[:, 1].min() > face.landmarks[list(SCHEME.lips), 1].max()
