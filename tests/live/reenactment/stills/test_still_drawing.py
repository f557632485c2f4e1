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
from relit_camera.live.reenactment.stills.still_drawing import StillDrawing, _Layer, _PlannedRegion
from relit_camera.live.reenactment.stills.still_regions import face_in_still
from relit_camera.subject.expression_stills import ExpressionStill
from relit_camera.subject.subject import Subject
from tests.live.people import close_up, context_of, live_frame, motion, moved_by
from tests.live.reenactment.stills.made_stills import expression, relit, soft_light, still, with_stills

SIZE = (288, 384)
TURNED_RIGHT, NEAR_CHEEK = 3, 280
"""A still of `with_stills`, and a landmark of the cheek that is near in it."""


def shown(subject: Subject, moved: np.ndarray, picture: np.ndarray, turn: float = 0.0) -> np.ndarray:
    """The moved picture, (height, width, 3) uint8."""
    reenactor = FirstOrderReenactor(context_of(subject, SIZE))
    driver = motion(rotation_from_angles(turn), expression=moved.astype(np.float64))
    return moved_by(reenactor, picture, driver, live_frame()).image[..., :3].copy()


@pytest.mark.slow
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


@pytest.mark.slow
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
    assert len(task.regions) == 4  # mouth, both eyes, the turned face
    for region in task.regions:
        for layer in region.layers:
            rim = np.concatenate([layer.cover[0], layer.cover[-1], layer.cover[:, 0], layer.cover[:, -1]])
            assert rim.max() < 0.15
            assert layer.cover.max() > 0.4


def cover_at(subject: Subject, moved: np.ndarray, turn: float, landmarks: tuple[int, ...]) -> float:
    """How far the only region that is drawn shows its only still in the middle of some landmarks."""
    face = context_of(subject, SIZE).face
    pose = rotate_about(np.zeros(3), face.pose, rotation_from_angles(turn))
    places = project(face.head_points + moved, pose, face.size).astype(np.float64)
    enlarged = np.array([[4.0, 0, 0], [0, 4.0, 0]])
    size = (4 * face.size[0], 4 * face.size[1])
    drawing = StillDrawing(subject, face)
    (region,) = drawing.plan(places, pose, moved.astype(np.float64), 0.0, enlarged, size, 3).regions
    (layer,) = region.layers
    return cover_of(region, layer, 4 * places[list(landmarks)].mean(axis=0))


def cover_of(region: _PlannedRegion, layer: _Layer, place: np.ndarray) -> float:
    """How far a layer shows at a place (x, y) of the picture."""
    x, y = (place - region.box[:2]) / 2  # drawn at half the size: the still is small
    rows, columns = layer.cover.shape
    return float(layer.cover[int(y), int(x)]) if 0 <= y < rows and 0 <= x < columns else 0.0


def test_a_still_of_a_turned_head_leaves_a_shut_eye_out() -> None:
    """It shows the eye open."""
    subject = with_stills(still(soft_light(), expression(), rotation_from_angles(25)))
    lids = context_of(subject, SIZE).face.scheme.left_eye.lids
    assert cover_at(subject, expression(shut=0.0), 22, lids) > 0.5
    assert cover_at(subject, expression(shut=1.0), 22, lids) < 0.05


@pytest.mark.parametrize(("turn", "near"), [(25, 50), (-25, 280)])
def test_of_a_turned_head_a_still_shows_the_near_cheek_too(turn: float, near: int) -> None:
    """The source image shows that from aside, with fewer pixels. The near eye stays the source image's."""
    subject = with_stills(still(soft_light(), expression(), rotation_from_angles(turn)))
    scheme = context_of(subject, SIZE).face.scheme
    eyes = [scheme.right_eye, scheme.left_eye]
    near_eye, far_eye = eyes if turn > 0 else eyes[::-1]
    assert cover_at(subject, expression(), 1.2 * turn, (near,)) > 0.9
    assert cover_at(subject, expression(), 0.48 * turn, (near,)) < 0.05, "there the source image's is sharper"
    assert cover_at(subject, expression(), turn, near_eye.lids) < 0.1
    assert cover_at(subject, expression(), turn, far_eye.lids) > 0.5


def test_the_near_cheek_of_the_side_that_a_head_comes_from_does_not_come_back() -> None:
    """While a head swings over in a seventh of a second the other side's still fades out. Its near cheek is gone."""
    subject = with_stills()
    face = context_of(subject, SIZE).face
    drawing, covers = StillDrawing(subject, face), []
    enlarged, size = np.array([[4.0, 0, 0], [0, 4.0, 0]]), (4 * face.size[0], 4 * face.size[1])
    for index, turn in enumerate([-30.0] * 10 + [-18.0, -6.0, 6.0, 18.0] + [30.0] * 10):
        pose = rotate_about(np.zeros(3), face.pose, rotation_from_angles(turn))
        places = project(face.head_points, pose, face.size).astype(np.float64)
        task = drawing.plan(places, pose, np.zeros_like(face.head_points), index / 30, enlarged, size, 3)
        shown = [(region, layer) for region in task.regions for layer in region.layers if layer.still == TURNED_RIGHT]
        covers.append(max((cover_of(region, layer, 4 * places[NEAR_CHEEK]) for region, layer in shown), default=0.0))
    assert min(covers[:10]) > 0.9
    assert max(covers[11:]) == 0


def test_skin_is_not_taken_for_hair() -> None:
    """Nor is dark skin: what counts is the skin round it."""
    bare = with_stills()
    face = context_of(bare, SIZE).face
    dark = replace(bare, basis=replace(bare.basis, scales=bare.basis.scales * np.float32(0.15)))
    for subject in (bare, dark):
        whole = still_light._Grid.over(subject, face).skin
        assert still_light.StillLight(subject, face)._grid.skin.sum() > 0.95 * whole.sum()


def test_hair_over_the_outline_of_the_source_image_does_not_brighten_a_still_s_cheek() -> None:
    """A strand of black hair hangs over one cheek there, and none in the still: divided by it, skin would be white."""
    bare = with_stills(still(soft_light(), expression(), rotation_from_angles(25)))
    face = context_of(bare, SIZE).face
    oval = np.zeros(bare.size[::-1], np.uint8)
    cv2.fillPoly(oval, [face.landmarks[list(face.scheme.oval)].astype(np.int32)], 1)
    inside = np.flatnonzero(oval.any(axis=0))
    strand = np.zeros_like(oval)
    strand[:, inside[0] : inside[0] + len(inside) // 12] = 1
    per_place = np.where(strand.ravel()[bare.basis.pixels], 0.05, 1.0)  # (clusters, places)
    of_cluster = np.repeat(np.arange(len(bare.basis.pixels)), np.diff(bare.basis.first))
    darkened = bare.basis.values.astype(np.float32) * per_place[of_cluster][:, None]
    hairy = replace(bare, basis=replace(bare.basis, values=darkened.astype(np.float16)))
    with_hair, without = (still_light.StillLight(each, face).unlit[0].astype(int) for each in (hairy, bare))
    assert relit(hairy, soft_light())[strand > 0].mean() < 0.1 * relit(bare, soft_light())[strand > 0].mean()
    skin = cv2.erode(oval, np.ones((5, 5))) > 0
    assert (with_hair - without)[skin].max() < 25
