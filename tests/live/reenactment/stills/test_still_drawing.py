"""Expression stills in the moved picture: they show the person in the wanted light, and nothing without stills."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from relit_camera.base.rotations import rotation_from_angles
from relit_camera.face.head_pose import project
from relit_camera.live.reenactment.first_order_reenactor import FirstOrderReenactor
from relit_camera.live.reenactment.motion_transfer import rotate_about
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.live.reenactment.stills import still_light, still_regions
from relit_camera.live.reenactment.stills.still_drawing import StillDrawing
from relit_camera.live.reenactment.stills.still_regions import face_in_still
from relit_camera.subject.expression_stills import ExpressionStill
from relit_camera.subject.subject import Subject
from tests.live.people import close_up, context_of, live_frame, motion, moved_by
from tests.live.reenactment.stills.made_stills import expression, relit, soft_light, still, with_stills

SIZE = (288, 384)


def shown(subject: Subject, moved: np.ndarray, picture: np.ndarray, turn: float = 0.0) -> np.ndarray:
    """The moved picture, (height, width, 3) uint8."""
    reenactor = FirstOrderReenactor(context_of(subject, SIZE))
    driver = motion(rotation_from_angles(turn), expression=moved.astype(np.float64))
    return moved_by(reenactor, picture, driver, live_frame()).image[..., :3].copy()


def test_at_rest_a_subject_with_stills_looks_as_one_without() -> None:
    picture = relit(close_up(), soft_light())
    np.testing.assert_array_equal(shown(with_stills(), expression(), picture), shown(close_up(), expression(), picture))


@pytest.mark.parametrize("exposure", [1.0, 0.4])
def test_a_still_in_another_light_is_shown_in_the_wanted_one(exposure: float) -> None:
    """The still is the source image in another light: relit, the skin is the relit source image's."""
    own, wanted = soft_light((-1.0, 0.2, 0.7)), soft_light((0.8, 0.5, 0.6), 0.7)
    subject = with_stills(still(own, expression(open_cm=0.3), rotation_from_angles(25), exposure))
    picture = relit(close_up(), wanted)
    plain, drawn = (shown(each, expression(), picture, turn=24) for each in (close_up(), subject))
    assert np.abs(drawn.astype(int) - plain).max() > 3, "nothing was drawn"
    soft = [cv2.GaussianBlur(each.astype(np.float32), (0, 0), 6) for each in (plain, drawn)]
    changed = np.abs(soft[1] - soft[0])
    assert np.percentile(changed, 99) < 7
    assert changed.mean() < 1.0


def test_what_a_still_shows_between_the_lips_is_in_the_picture() -> None:
    """A white spot between the lips of the still appears in the open mouth, where there is none without stills."""
    own = soft_light()
    opened = still(own, expression(open_cm=1.0))
    face = context_of(close_up(), SIZE).face
    landmarks = opened.landmarks.copy()
    lower = sorted({*face.scheme.lower_lip_inner[1:-1], *face.scheme.lower_lip_outer[1:-1]})
    landmarks[lower, 1] += 8
    image = opened.image.copy()
    middle = landmarks[[13, 14]].mean(axis=0)
    cv2.circle(image, tuple(int(each) for each in middle), 2, (255, 255, 255), -1)
    subject = with_stills(replace(opened, image=image, landmarks=landmarks))
    picture = relit(close_up(), own)
    with_spot, without = (shown(each, expression(open_cm=1.0), picture) for each in (subject, close_up()))
    assert with_spot.astype(int).sum(axis=2).max() > without.astype(int).sum(axis=2).max() + 60


def test_a_driver_in_a_scheme_that_stills_do_not_have_sees_none() -> None:
    """Stills are of one scheme: with other landmarks the source image alone is moved."""
    from relit_camera.face.landmarks.landmark_schemes import landmark_scheme

    scheme = landmark_scheme("openseeface66")
    face = context_of(with_stills(), SIZE).face
    other = replace(face, scheme=scheme, landmarks=face.landmarks[:66], head_points=scheme.canonical.copy())
    reenactor = FirstOrderReenactor(replace(context_of(with_stills(), SIZE), face=other))
    assert reenactor._stills is None


def test_each_still_is_placed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawing all of the face into a still is what takes the time when a subject is chosen."""
    placed = []

    def counted(made: ExpressionStill, face: SourceFace) -> np.ndarray:
        placed.append(made)
        return face_in_still(made, face)

    for module in (still_light, still_regions):
        monkeypatch.setattr(module, "face_in_still", counted)
    subject = with_stills()
    StillDrawing(subject, context_of(subject, SIZE).face)
    assert len(placed) == len(subject.stills)


def test_the_light_on_the_face_is_computed_once_for_one_relit_picture() -> None:
    subject = with_stills()
    light = still_light.StillLight(subject, context_of(subject, SIZE).face)
    first, second = (relit(subject, soft_light(color=color)) for color in (1.0, 0.5))
    roots = light.relit_roots(first)
    assert light.relit_roots(first) is roots
    assert light.relit_roots(second).mean() < roots.mean()
    np.testing.assert_array_equal(light.relit_roots(first), roots)


def test_at_half_the_size_a_quarter_of_the_pixels_is_drawn() -> None:
    subject = with_stills()
    face = context_of(subject, SIZE).face
    moved = expression(open_cm=1.0).astype(np.float64)
    landmarks = project(face.head_points + moved, face.pose, face.size).astype(np.float64)

    def pixels(half_size: bool) -> int:
        as_it_is = np.eye(2, 3)
        task = StillDrawing(subject, face).plan(
            landmarks, face.pose, moved, 0.0, as_it_is, face.size, 2, half_size=half_size
        )
        return sum(layer.cover.size for region in task.regions for layer in region.layers)

    assert pixels(half_size=True) < 0.35 * pixels(half_size=False)


def test_no_region_ends_at_the_border_of_its_box() -> None:
    """What stills show fades out inside the rectangle that is drawn: on all sides nothing of them is left."""
    subject = with_stills()
    face = context_of(subject, SIZE).face
    turned = rotate_about(np.zeros(3), face.pose, rotation_from_angles(22))
    moved = (expression(open_cm=1.0) + expression(shut=1.0)).astype(np.float64)
    landmarks = project(face.head_points + moved, turned, face.size).astype(np.float64)
    enlarged = np.array([[4.0, 0, 0], [0, 4.0, 0]])
    size = (4 * face.size[0], 4 * face.size[1])
    task = StillDrawing(subject, face).plan(landmarks, turned, moved, 0.0, enlarged, size, 3)
    assert len(task.regions) == 4  # mouth, both eyes, one side
    for region in task.regions:
        for layer in region.layers:
            rim = np.concatenate([layer.cover[0], layer.cover[-1], layer.cover[:, 0], layer.cover[:, -1]])
            assert rim.max() < 0.15
            assert layer.cover.max() > 0.4


def test_a_still_of_a_turned_head_leaves_a_shut_eye_out() -> None:
    """It shows the eye open."""
    subject = with_stills(still(soft_light(), expression(), rotation_from_angles(25)))
    face = context_of(subject, SIZE).face
    pose = rotate_about(np.zeros(3), face.pose, rotation_from_angles(22))

    def cover_at_eye(shut: float) -> float:
        moved = expression(shut=shut).astype(np.float64)
        landmarks = project(face.head_points + moved, pose, face.size).astype(np.float64)
        enlarged = np.array([[4.0, 0, 0], [0, 4.0, 0]])
        size = (4 * face.size[0], 4 * face.size[1])
        (side,) = StillDrawing(subject, face).plan(landmarks, pose, moved, 0.0, enlarged, size, 3).regions
        cover = side.layers[0].cover  # of half the resolution, for the still is coarser
        x, y = (4 * landmarks[list(face.scheme.left_eye.lids)].mean(axis=0) - side.box[:2]) / 2
        return float(cover[int(y), int(x)])

    assert cover_at_eye(shut=0.0) > 0.5
    assert cover_at_eye(shut=1.0) < 0.05
