"""Crops of stills: of one size, no larger than the source image needs, and with landmarks where they were."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from relit_camera.capture.expressions.still_crops import MAX_ENLARGEMENT, StillCropper, black_beyond_face
from relit_camera.subject.expression_stills import MAX_STILL_SIDE_PX
from tests.capture.expressions.talking_film import SCHEME, SIZE, moved_points, tracked


@pytest.mark.parametrize("source_span", [20.0, 1000.0])
def test_a_landmark_is_where_it_was(source_span: float) -> None:
    faces = [tracked(0, moved_points()), tracked(1, moved_points(open_cm=1.5), yaw=30)]
    cropper = StillCropper(faces, SCHEME, source_span)
    for face in faces:
        frame = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
        dot = [round(16 * (float(each) - 0.5)) for each in face.landmarks[1]]
        cv2.circle(frame, dot, 16 * 6, (255, 255, 255), -1, shift=4)
        image, landmarks = cropper.crop(frame, face)
        y, x = np.nonzero(image[..., 0] > 127)
        assert (x.mean() + 0.5, y.mean() + 0.5) == pytest.approx(landmarks[1], abs=0.5)


def test_all_are_of_one_size_and_hold_the_face() -> None:
    faces = [tracked(0, moved_points()), tracked(1, moved_points(open_cm=2), yaw=30, pitch=15)]
    cropper = StillCropper(faces, SCHEME, 50.0)
    crops = [cropper.crop(np.zeros((SIZE[1], SIZE[0], 3), np.uint8), face) for face in faces]
    sides = {image.shape for image, _ in crops}
    assert len(sides) == 1
    side = sides.pop()[0]
    for _, landmarks in crops:
        assert (landmarks > 0).all()
        assert (landmarks < side).all()
    span = np.median([SCHEME.eye_span(landmarks) for _, landmarks in crops])
    assert span == pytest.approx(MAX_ENLARGEMENT * 50, rel=0.02)
    assert side <= MAX_STILL_SIDE_PX


def test_the_room_behind_is_not_kept() -> None:
    face = tracked(0, moved_points())
    room = np.random.default_rng(0).integers(0, 256, (SIZE[1], SIZE[0], 3)).astype(np.uint8)
    image, landmarks = StillCropper([face], SCHEME, 1000.0).crop(room, face)
    corners = image[[0, 0, -1, -1], [0, -1, 0, -1]]
    assert (corners == corners[0]).all()
    x, y = landmarks[1].astype(int)
    assert image[y - 5 : y + 5, x - 5 : x + 5].std() > 30


@pytest.mark.parametrize("source_span", [20.0, 1000.0])
def test_what_is_black_beyond_the_face_is_in_no_still(source_span: float) -> None:
    faces = [tracked(0, moved_points()), tracked(1, moved_points(open_cm=1.5), yaw=30)]
    cropper = StillCropper(faces, SCHEME, source_span)
    room = np.random.default_rng(0).integers(0, 256, (SIZE[1], SIZE[0], 3)).astype(np.uint8)
    for face in faces:
        kept = black_beyond_face(room, face.landmarks)
        assert (kept == 0).mean() > 0.5
        np.testing.assert_array_equal(cropper.crop(kept, face)[0], cropper.crop(room, face)[0])
