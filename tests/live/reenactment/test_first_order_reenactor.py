"""The default reenactor: at rest the still stands in the output, and its features go where the driver's go."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest

from relit_camera.base.rotations import rotation_from_angles
from relit_camera.face.head_pose import project
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.reenactment import first_order_reenactor
from relit_camera.live.reenactment.control_points import control_points, head_and_shoulder_anchors
from relit_camera.live.reenactment.first_order_reenactor import FirstOrderReenactor
from relit_camera.live.reenactment.motion_transfer import split_body_motion, transfer_motion
from relit_camera.live.reenactment.reenactor import WarpedLayer, open_reenactor
from relit_camera.live.reenactment.source_image import feather_edges
from relit_camera.live.reenactment.warp import inverse_affine, move_body, source_from_output
from relit_camera.live.render_quality import FULL_QUALITY, RenderQuality
from relit_camera.subject.subject import Subject
from tests.live.people import NOBODY, SCHEME, close_up, context_of, live_frame, motion, moved_by, person, premultiplied

SIZE = (480, 360)
FEATURES = {"nose": 1, "chin": 152, "brow": 105, "cheek": 50, "mouth corner": 61}
"""Vertices of the canonical face that lie well inside it."""

CELL = 2
"""Side of a cell of the warp in this output, in pixels."""


def relit_picture(subject: Subject):
    """A smooth, bright picture of the subject's size."""
    height, width = subject.matte.shape
    x, y = np.meshgrid(np.linspace(0, 5, width), np.linspace(0, 7, height))
    return np.stack([0.5 + 0.3 * np.sin(x), 0.5 + 0.3 * np.cos(y), 0.4 + 0.2 * np.sin(x + y)], 2).astype(np.float32)


def marked(subject: Subject, point: np.ndarray):
    """Black but for a soft dot at a still position."""
    height, width = subject.matte.shape
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    dot = np.exp(-((x - point[0]) ** 2 + (y - point[1]) ** 2) / (2 * 1.5**2))
    return np.repeat(dot[..., None], 3, axis=2).astype(np.float32)


def centroid(moved: WarpedLayer):
    """Where the light is, in output pixels."""
    weight = premultiplied(moved)[0].sum(axis=2)
    x, y = np.meshgrid(np.arange(weight.shape[1]) + 0.5, np.arange(weight.shape[0]) + 0.5)
    return np.array([(weight * x).sum(), (weight * y).sum()]) / weight.sum() + moved.at


def placed_still(picture: np.ndarray, subject: Subject):
    """The still fitted into the output on its bottom edge, by cv2's resize alone."""
    scale = SIZE[1] / subject.size[1]
    width = round(subject.size[0] * scale)
    assert width == subject.size[0] * scale
    large = cv2.resize(picture, (width, SIZE[1]), interpolation=cv2.INTER_CUBIC)
    left = (SIZE[0] - width) // 2
    return cv2.copyMakeBorder(large, 0, 0, left, SIZE[0] - width - left, cv2.BORDER_CONSTANT), left


def in_output(moved: WarpedLayer):
    """The moved picture and its alpha in the whole output, linear and premultiplied."""
    picture, alpha = np.zeros((SIZE[1], SIZE[0], 3), np.float32), np.zeros((SIZE[1], SIZE[0]), np.float32)
    area = np.s_[moved.at[1] : moved.at[1] + moved.image.shape[0], moved.at[0] : moved.at[0] + moved.image.shape[1]]
    picture[area], alpha[area] = premultiplied(moved)
    return picture, alpha


@pytest.mark.parametrize("make", [person, close_up])
@pytest.mark.parametrize("at_rest", [motion(), NOBODY], ids=["at rest", "nobody"])
def test_a_face_at_rest_gives_back_the_still(make: Callable[[], Subject], at_rest: FaceMotion) -> None:
    subject = make()
    colours = relit_picture(subject)
    over_black = colours * (subject.matte[..., None] if subject.metadata.over_black else 1)
    reenactor = open_reenactor("first-order", context_of(subject, SIZE))
    picture, alpha = in_output(moved_by(reenactor, over_black, at_rest, live_frame()))
    matte = feather_edges(subject.matte)
    expected = placed_still(colours * matte[..., None], subject)[0]
    assert 10 * np.log10(1 / np.mean((picture - expected) ** 2)) > 35
    np.testing.assert_allclose(alpha, placed_still(matte, subject)[0], atol=0.06)


@pytest.mark.parametrize("feature", FEATURES)
@pytest.mark.parametrize("angles", [(14, 0, 0), (0, 9, 0), (0, 0, 10), (-10, -6, 5)])
def test_features_go_where_the_turned_head_has_them(feature: str, angles: tuple[float, float, float]) -> None:
    subject = person()
    context = context_of(subject, SIZE)
    index = FEATURES[feature]
    moving = motion(rotation_from_angles(*angles))
    moved = moved_by(FirstOrderReenactor(context), marked(subject, context.face.landmarks[index]), moving, live_frame())
    body = split_body_motion(context.face, moving)
    in_still = project(context.face.head_points, body.turned, context.face.size)[index]
    placed = move_body(source_from_output(subject.size, SIZE), body.pivot, body.shift, body.scale, subject.size[1])
    inverse = inverse_affine(placed)
    expected = inverse[:, :2] @ in_still + inverse[:, 2]
    pixel = SIZE[1] / subject.size[1]
    before = inverse_affine(source_from_output(subject.size, SIZE))
    start = before[:, :2] @ context.face.landmarks[index] + before[:, 2]
    way = np.linalg.norm(expected - start)
    assert way > pixel  # it had somewhere to go
    assert np.linalg.norm(centroid(moved) - expected) < 0.5 * pixel + 0.15 * way


def turned_pictures(yaws: Sequence[float], half_size: bool) -> np.ndarray:
    """Linear premultiplied pictures (count, rows, columns, 3) of a head with these yaws."""
    subject = person()
    relit, quality = relit_picture(subject), RenderQuality(half_size=half_size)
    reenactor = open_reenactor("first-order", context_of(subject, SIZE))
    moved = (reenactor.plan_warp(motion(rotation_from_angles(yaw)), live_frame(), quality)(relit) for yaw in yaws)
    return np.stack([in_output(each)[0] for each in moved])


@pytest.mark.parametrize("half_size", [False, True])
@pytest.mark.parametrize("yaw", [0.0, 30.0, -30.0])
def test_the_far_outline_alone_is_drawn_anew(yaw: float, half_size: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = turned_pictures([yaw], half_size)
    monkeypatch.setattr(first_order_reenactor, "plan_far_outline", lambda *_: None)
    changed = np.nonzero(np.abs(drawn - turned_pictures([yaw], half_size)).max(axis=3) > 1e-3)[2]
    if yaw == 0:
        assert changed.size == 0
    else:
        assert changed.size > 50
        assert (np.sign(yaw) * (changed - SIZE[0] / 2) > -CELL * (1 + half_size)).all()


@pytest.mark.slow
@pytest.mark.parametrize("half_size", [False, True])
@pytest.mark.parametrize("yaws", [np.arange(22, 29, 0.2), np.arange(-29, -22, 0.2)], ids=["right", "left"])
def test_the_outline_of_a_head_that_turns_slowly_goes_along_evenly(
    yaws: Sequence[float], half_size: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The pixels that change most do so less than where nothing draws the outline, in the worst moment too."""

    def worst() -> float:
        changes = np.abs(np.diff(turned_pictures(yaws, half_size), axis=0)).max(axis=3)
        return float(np.sort(changes.reshape(len(changes), -1), axis=1)[:, -200:].mean(axis=1).max())

    drawn = worst()
    monkeypatch.setattr(first_order_reenactor, "plan_far_outline", lambda *_: None)
    assert drawn < worst()


def test_brows_go_up_with_the_drivers() -> None:
    subject = person()
    context = context_of(subject, SIZE)
    expression = np.zeros((SCHEME.count, 3))
    brow = list(SCHEME.right_brow)
    away = np.linalg.norm(SCHEME.canonical[:, None, :2] - SCHEME.canonical[None, brow, :2], axis=2).min(axis=1)
    expression[:, 1] = 0.6 * np.exp(-((away / 1.5) ** 2))  # a brow takes the skin above and below it along
    relit = marked(subject, context.face.landmarks[brow].mean(axis=0))
    reenactor = FirstOrderReenactor(context)
    rest = centroid(moved_by(reenactor, relit, motion(), live_frame()))
    raised = centroid(moved_by(reenactor, relit, motion(expression=expression), live_frame()))
    points = control_points(context.face, head_and_shoulder_anchors(context.face.pose, context.face.size))
    expected = (
        transfer_motion(context.face, points, motion(expression=expression)).landmarks[brow]
        - context.face.landmarks[brow]
    )
    np.testing.assert_allclose(raised - rest, expected.mean(axis=0) * SIZE[1] / subject.size[1], atol=1.5)
    assert raised[1] < rest[1] - 3


def test_an_opening_mouth_shows_a_dark_inside() -> None:
    subject = person()
    context = context_of(subject, SIZE)
    expression = np.zeros((SCHEME.count, 3))
    expression[list(SCHEME.lower_lip_inner[1:-1]), 1] = -2.0
    expression[list(SCHEME.lower_lip_outer[1:-1]), 1] = -2.0
    relit = np.full((*subject.matte.shape, 3), 0.5, np.float32)
    reenactor = FirstOrderReenactor(context)
    shut, _ = in_output(moved_by(reenactor, relit, motion(), live_frame()))
    opened, alpha = in_output(moved_by(reenactor, relit, motion(expression=expression), live_frame()))
    lips = context.face.landmarks[[13, 14]].mean(axis=0) + [0, 6]
    column, row = (inverse_affine(source_from_output(subject.size, SIZE)) @ [*lips, 1]).astype(int)
    assert shut[row, column].min() > 0.4
    assert opened[row, column].max() < 0.15
    assert opened[row, column, 0] > 1.5 * opened[row, column, 2]
    assert alpha[row, column] == pytest.approx(1, abs=1e-3)


def test_no_motion_lets_the_body_hover_and_all_stays_in_the_output() -> None:
    subject = person()
    reenactor = FirstOrderReenactor(context_of(subject, SIZE))
    relit = relit_picture(subject)
    for shift in ((0, 9, 0), (-12, 5, 4), (12, -6, -20), (0, 0, 12)):
        moved = moved_by(reenactor, relit, motion(rotation_from_angles(10, -8, 4), shift=shift), live_frame())
        height, width = moved.image.shape[:2]
        assert moved.image.shape == (height, width, 4)
        assert moved.image.dtype == np.uint8
        assert min(moved.at) >= 0
        assert moved.at[0] + width <= SIZE[0]
        assert moved.at[1] + height == SIZE[1]
        assert moved.image[-1, :, 3].max() > 230


def test_light_and_picture_are_proportional() -> None:
    """The warp is linear in the light, up to codes: twice the light is twice the picture."""
    subject = person()
    relit = relit_picture(subject)
    reenactor = FirstOrderReenactor(context_of(subject, SIZE))
    moving = motion(rotation_from_angles(10, 5, 0))
    once, twice = (premultiplied(moved_by(reenactor, relit * gain, moving, live_frame()))[0] for gain in (0.4, 0.8))
    np.testing.assert_allclose(twice, 2 * once, atol=0.02)


@pytest.mark.parametrize("size", [SIZE, (1280, 720), (642, 358)])
@pytest.mark.parametrize("angles", [(0, 0, 0), (12, 5, -4)])
def test_at_half_size_it_is_the_same_picture_only_softer(
    size: tuple[int, int], angles: tuple[float, float, float]
) -> None:
    subject = person()
    reenactor = FirstOrderReenactor(context_of(subject, size))
    moving, relit = motion(rotation_from_angles(*angles)), relit_picture(subject)
    whole, half = (
        reenactor.plan_warp(moving, live_frame(), replace(FULL_QUALITY, half_size=each))(relit)
        for each in (False, True)
    )
    assert half.at == whole.at
    assert half.image.shape == whole.image.shape
    inside = whole.image[..., 3] > 250
    error = half.image[inside].astype(float) - whole.image[inside]
    assert 10 * np.log10(255**2 / np.mean(error**2)) > 30
    assert abs(error.mean()) < 0.5  # no shift by half a pixel, which a slope would show
    edge = np.abs(half.image[..., 3].astype(float) - whole.image[..., 3]).mean()
    assert edge < 4
