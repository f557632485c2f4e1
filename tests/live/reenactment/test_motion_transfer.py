"""The driver's motion on the still's own head."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from relit_camera.base.rotations import Rotation, angles_from_rotation, rotation_from_angles
from relit_camera.face.head_pose import project
from relit_camera.live.reenactment.control_points import (
    EARS_AND_JAW,
    NECK_PIVOT,
    ControlPoints,
    control_points,
    head_and_shoulder_anchors,
)
from relit_camera.live.reenactment.motion_transfer import (
    FACE_CENTER,
    MAX_ROTATION_IN_PLACE_DEG,
    MAX_SHIFT_CM,
    SCALE_RANGE,
    keep_beside_face,
    rotate_about,
    soft_limit_rotation,
    split_body_motion,
    transfer_motion,
    transfer_motion_in_place,
)
from relit_camera.live.reenactment.source_image import SourceFace
from tests.live.people import SCHEME, close_up, face_of, motion, person


@pytest.fixture(scope="module")
def face():
    return face_of(person())


@pytest.fixture(scope="module")
def points(face: SourceFace):
    return control_points(face, head_and_shoulder_anchors(face.pose, face.size))


def test_a_face_at_rest_stays_where_it_is(face: SourceFace, points: ControlPoints) -> None:
    target = transfer_motion(face, points, motion())
    np.testing.assert_allclose(target.landmarks, face.landmarks, atol=1e-3)
    np.testing.assert_allclose(target.points, points.source, atol=1e-3)
    np.testing.assert_allclose(target.shift, 0, atol=1e-9)
    assert target.scale == pytest.approx(1)
    close = face_of(close_up())
    landmarks = control_points(close, np.zeros((0, 2)))
    np.testing.assert_allclose(
        transfer_motion_in_place(close, landmarks, motion()).landmarks, close.landmarks, atol=1e-3
    )


def test_an_expression_moves_landmarks_by_its_centimetres(face: SourceFace, points: ControlPoints) -> None:
    """x cm to the right at depth d are x · f / d pixels."""
    lips = list(SCHEME.lips)
    expression = np.zeros((SCHEME.count, 3))
    expression[lips] = [0.5, -1.0, 0]
    moved = transfer_motion(face, points, motion(expression=expression)).landmarks - face.landmarks
    depth = -(face.pose.rotation.apply(face.head_points) + face.pose.translation)[:, 2]
    pixels = face.pose.focal_px / depth[lips]
    np.testing.assert_allclose(moved[lips], np.stack([0.5 * pixels, pixels], axis=1), rtol=0.02)
    rest = np.setdiff1d(np.arange(SCHEME.count), lips)
    np.testing.assert_allclose(moved[rest], 0, atol=1e-3)


def test_a_step_aside_moves_the_body_and_not_the_head_on_it(face: SourceFace, points: ControlPoints) -> None:
    target = transfer_motion(face, points, motion(shift=(4, 2, 0)))
    depth = face.pose.depth_of(NECK_PIVOT)
    np.testing.assert_allclose(target.shift, np.array([4, -2]) * face.pose.focal_px / depth, rtol=1e-6)
    np.testing.assert_allclose(target.landmarks, face.landmarks, atol=1e-3)
    assert target.scale == pytest.approx(1)


def test_coming_closer_makes_the_person_larger_and_is_limited(face: SourceFace) -> None:
    depth = face.pose.depth_of(NECK_PIVOT)
    assert split_body_motion(face, motion(shift=(0, 0, 4))).scale == pytest.approx(depth / (depth - 4))
    assert split_body_motion(face, motion(shift=(0, 0, 30))).scale == SCALE_RANGE[1]
    assert split_body_motion(face, motion(shift=(0, 0, -60))).scale == SCALE_RANGE[0]
    far = split_body_motion(face, motion(shift=(50, 0, 0))).shift[0]
    assert far == pytest.approx(MAX_SHIFT_CM * face.pose.focal_px / depth)


@pytest.mark.parametrize("angles", [(8, 0, 0), (0, 8, 0), (0, 0, 8)])
def test_a_turn_on_the_neck_is_explained_by_the_neck(face: SourceFace, angles: tuple[float, float, float]) -> None:
    """The head's origin moves as it turns; the body does not follow. Bending is weak at small angles."""
    turn = rotation_from_angles(*angles)
    shift = rotate_about(NECK_PIVOT, face.pose, turn).translation - face.pose.translation
    assert np.abs(shift).max() > 0.5
    body = split_body_motion(face, motion(turn, shift=shift))
    np.testing.assert_allclose(body.shift, 0, atol=0.3)
    assert body.scale == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize(("angles", "axis", "sign"), [((15, 0, 0), 0, 1), ((0, 15, 0), 1, 1)])
def test_the_nose_goes_where_the_head_turns(
    face: SourceFace, points: ControlPoints, angles: tuple[float, float, float], axis: int, sign: int
) -> None:
    """Yaw > 0 brings the nose to the picture's right, pitch > 0 down."""
    moved = transfer_motion(face, points, motion(rotation_from_angles(*angles))).landmarks
    nose, outline = 1, list(SCHEME.oval)
    before = face.landmarks[nose] - face.landmarks[outline].mean(axis=0)
    after = moved[nose] - moved[outline].mean(axis=0)
    assert sign * (after - before)[axis] > 0.05 * np.ptp(face.landmarks[:, 0])


def test_positive_roll_lifts_the_pictures_right(face: SourceFace, points: ControlPoints) -> None:
    moved = transfer_motion(face, points, motion(rotation_from_angles(0, 0, 12))).landmarks
    left_eye, right_eye = moved[SCHEME.left_eye.outer], moved[SCHEME.right_eye.outer]  # the subject's
    assert np.degrees(np.arctan2(right_eye[1] - left_eye[1], left_eye[0] - right_eye[0])) == pytest.approx(12, abs=1)


def test_landmarks_are_the_projected_head(face: SourceFace, points: ControlPoints) -> None:
    turn = rotation_from_angles(10, -5, 3)
    target = transfer_motion(face, points, motion(turn))
    np.testing.assert_allclose(target.landmarks, project(face.head_points, target.pose, face.size), atol=1e-3)
    np.testing.assert_allclose(target.points[: len(points.chosen)], target.landmarks[points.chosen])


def test_in_the_frame_a_face_turns_in_its_place_and_less_far() -> None:
    face = face_of(close_up())
    points = control_points(face, np.zeros((0, 2)))
    target = transfer_motion_in_place(face, points, motion(rotation_from_angles(60, 0, 0), shift=(10, 0, 0)))
    yaw = angles_from_rotation(target.pose.rotation * face.pose.rotation.inv())[0]
    assert 15 < yaw < MAX_ROTATION_IN_PLACE_DEG
    middle = [project(FACE_CENTER[None], pose, face.size)[0] for pose in (face.pose, target.pose)]
    np.testing.assert_allclose(middle[1], middle[0], atol=1e-3)
    np.testing.assert_array_equal(target.shift, 0)


def test_a_bent_turn_keeps_its_axis_and_never_passes_its_limit() -> None:
    axis = np.array([0.6, 0.0, 0.8])
    for angle in (0.0, 1e-9, 3.0, 30.0, 90.0, 170.0):
        vector = np.degrees(soft_limit_rotation(Rotation.from_rotvec(axis * np.radians(angle)), 40).as_rotvec())
        assert np.linalg.norm(vector) <= min(angle, 40) + 1e-9
        np.testing.assert_allclose(np.cross(vector, axis), 0, atol=1e-9)
    small = np.degrees(soft_limit_rotation(Rotation.from_rotvec(axis * np.radians(3)), 40).as_rotvec())
    assert np.linalg.norm(small) == pytest.approx(3, rel=0.01)


def test_turning_about_a_point_leaves_it_where_it_is(face: SourceFace) -> None:
    turned = rotate_about(NECK_PIVOT, face.pose, rotation_from_angles(20, 10, -5))
    for pose in (turned, face.pose):
        place = pose.rotation.apply(NECK_PIVOT) + pose.translation
        np.testing.assert_allclose(place, face.pose.rotation.apply(NECK_PIVOT) + face.pose.translation)


@pytest.mark.parametrize("yaw", [-30, -10, 0, 10, 30])
def test_what_is_beside_the_face_stays_beside_it(face: SourceFace, yaw: float) -> None:
    """Ears and jaw of a turned head are no further inside its outline than at rest; at rest they do not move."""
    before = project(EARS_AND_JAW, face.pose, face.size).astype(np.float64)
    landmarks = face.landmarks.astype(np.float64)
    turned = rotate_about(NECK_PIVOT, face.pose, rotation_from_angles(yaw))
    anchors = project(EARS_AND_JAW, turned, face.size).astype(np.float64)
    seen = project(face.head_points, turned, face.size)
    kept = keep_beside_face(anchors, seen.astype(np.float64), before, landmarks)
    side = np.sign(EARS_AND_JAW[:, 0])
    assert (side * (kept - anchors)[:, 0] >= 0).all()
    assert (kept[:, 1] == anchors[:, 1]).all()
    if yaw == 0:
        np.testing.assert_allclose(kept, before, atol=0.05)

    def depth(points: np.ndarray, outline: np.ndarray) -> list[float]:
        hull = cv2.convexHull(outline.astype(np.float32))
        return [cv2.pointPolygonTest(hull, (float(x), float(y)), True) for x, y in points]

    assert (np.array(depth(kept, seen)) <= np.array(depth(before, landmarks)) + 0.5).all()
