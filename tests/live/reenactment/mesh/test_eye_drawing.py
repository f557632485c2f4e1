"""Closing eyes in the moved picture: nothing of the eyeball is left to see."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from relit_camera.base.images.image_types import LinearImage
from relit_camera.base.rotations import rotation_from_angles
from relit_camera.live.reenactment.first_order_reenactor import FirstOrderReenactor
from relit_camera.live.reenactment.mesh.eye_drawing import plan_closing_eyes
from relit_camera.live.reenactment.mesh.head_mesh import triangulate_head
from relit_camera.live.reenactment.reenactor import ReenactorContext
from relit_camera.live.render_quality import FULL_QUALITY, RenderQuality
from tests.live.people import SCHEME, close_up, context_of, lids_lowered, live_frame, motion

SIZE, SCALE = (432, 576), 3
BLUE, SKIN = (0.0, 0.0, 0.6), (0.3, 0.2, 0.15)


@cache
def enlarged() -> ReenactorContext:
    """The small person, whose eyes are three pixels high, three times as large."""
    context = context_of(close_up(), SIZE)
    subject, face = context.subject, context.face
    matte, neutral = (cv2.resize(each, None, fx=SCALE, fy=SCALE) for each in (subject.matte, subject.neutral))
    size = (SCALE * face.size[0], SCALE * face.size[1])
    pose = replace(face.pose, focal_px=SCALE * face.pose.focal_px)
    large = replace(face, landmarks=face.landmarks * np.float32(SCALE), pose=pose, size=size)
    metadata = subject.metadata.model_copy(update={"width": size[0], "height": size[1]})
    subject = replace(
        subject, metadata=metadata, matte=matte, neutral=neutral, normals=None, albedo=None, depth=None, horizons=None
    )
    return replace(context, subject=subject, face=large)


def picture_with_blue_eyes() -> LinearImage:
    """The source image: skin, and eyes that are blue between the lids."""
    picture = np.full((*enlarged().subject.matte.shape, 3), SKIN, np.float32)
    for eye in (SCHEME.right_eye, SCHEME.left_eye):
        lids = enlarged().face.landmarks[list(eye.lids)]
        inside = lids.mean(axis=0) + 0.85 * (lids - lids.mean(axis=0))  # the lids' own rims are skin
        cv2.fillPoly(picture, [np.round(inside * 16 - 8).astype(np.int32)], BLUE, lineType=cv2.LINE_8, shift=4)
    return picture


def blueness(shut: float, yaw: float = 0.0, quality: RenderQuality = FULL_QUALITY) -> float:
    """How much more blue than red all pixels of the moved picture have together."""
    reenactor = FirstOrderReenactor(enlarged())
    driver = motion(rotation_from_angles(yaw), expression=lids_lowered(enlarged().face, shut))
    image = reenactor.plan_warp(driver, live_frame(), quality)(picture_with_blue_eyes()).image.astype(float)
    return float(np.maximum(image[..., 2] - image[..., 0], 0)[image[..., 3] > 200].sum())


@pytest.mark.parametrize("yaw", [0, 20, -20])
@pytest.mark.parametrize("half_size", [False, True])
def test_a_shut_eye_shows_no_eyeball(yaw: float, half_size: bool) -> None:
    """Trackers see shut eyes an eighth open."""
    quality = RenderQuality(half_size=half_size)
    opened, shut, nearly = (blueness(share, yaw, quality) for share in (0.0, 1.0, 0.85))
    assert opened > 10_000
    assert shut < 0.06 * opened
    assert nearly < 0.06 * opened


def test_the_more_a_lid_falls_the_less_is_seen() -> None:
    seen = [blueness(share) for share in np.linspace(0, 0.7, 8)]
    assert (np.diff(seen) < 0.02 * seen[0]).all()
    assert seen[3] < 0.85 * seen[0]  # with the lid lowered by 0.3
    assert seen[5] < 0.4 * seen[0]  # by 0.5


def test_a_half_shut_eye_shows_the_lower_half_of_the_eyeball_as_high_as_it_is() -> None:
    """A lid moves over the eyeball: it does not squeeze it."""

    def seen(shut: float, from_share: float, to_share: float) -> float:
        picture = np.full((*enlarged().subject.matte.shape, 3), SKIN, np.float32)
        landmarks = enlarged().face.landmarks
        for eye in (SCHEME.right_eye, SCHEME.left_eye):
            top, bottom = (landmarks[list(edge), 1].mean() for edge in eye.gap)
            left, right = np.sort(landmarks[[eye.outer, eye.inner], 0])
            columns = np.s_[int(left + 0.35 * (right - left)) : int(right - 0.35 * (right - left))]
            rows = np.s_[round(top + from_share * (bottom - top)) : round(top + to_share * (bottom - top))]
            picture[rows, columns] = BLUE
        reenactor = FirstOrderReenactor(enlarged())
        driver = motion(expression=lids_lowered(enlarged().face, shut))
        image = reenactor.plan_warp(driver, live_frame(), FULL_QUALITY)(picture).image.astype(float)
        return float(np.maximum(image[..., 2] - image[..., 0], 0).sum())

    # Lids that are lowered by 0.42 show half of what is open.
    assert seen(0.42, 0.6, 0.9) > 0.7 * seen(0.0, 0.6, 0.9)
    assert seen(0.42, 0.1, 0.4) < 0.3 * seen(0.0, 0.1, 0.4)


def test_at_half_the_size_a_position_a_pixel_is_computed() -> None:
    context = enlarged()
    mesh = triangulate_head(context.face, np.zeros((0, 2)))
    landmarks = context.face.landmarks.astype(np.float64)
    surface = mesh.surface(landmarks, np.zeros((0, 2)), context.face.pose, (1.0, 0.5))
    whole, half = (
        plan_closing_eyes(mesh.eyes, (1.0, 0.5), surface, landmarks, np.eye(2, 3), context.face.size, half_size)
        for half_size in (False, True)
    )
    for task, coarse, share in zip(whole, half, (1.0, 0.5), strict=True):
        assert coarse.looks.shape[:2] == coarse.cover.shape
        assert task.looks.shape[0] == 2 * task.cover.shape[0]
        assert task.cover.max() == pytest.approx(share, abs=0.01)
        rim = np.concatenate([task.cover[0], task.cover[-1], task.cover[:, 0], task.cover[:, -1]])
        assert rim.max() < 0.3 * share
    assert plan_closing_eyes(mesh.eyes, (0.0, 0.0), surface, landmarks, np.eye(2, 3), context.face.size) == []


def test_what_lies_beside_the_eyes_stays() -> None:
    """Alpha is the moved picture's, and of skin of one color nothing changes."""
    skin = np.full((*enlarged().subject.matte.shape, 3), SKIN, np.float32)
    reenactor = FirstOrderReenactor(enlarged())
    opened, shut = (
        reenactor.plan_warp(motion(expression=expression), live_frame(), FULL_QUALITY)(skin).image.astype(int)
        for expression in (lids_lowered(enlarged().face, 0.0), lids_lowered(enlarged().face))
    )
    assert np.abs(opened[..., 3] - shut[..., 3]).max() <= 5  # of 255
    assert np.abs(opened - shut)[opened[..., 3] > 200][:, :3].max() <= 2
