"""What part of a frame a subject's picture is: the whole head, whatever the frame's shape."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from relit_camera.base.images.image_types import Alpha, Frame, Mask
from relit_camera.capture.instant import median_picture as module
from relit_camera.capture.instant.face_selection import SeenFace
from relit_camera.capture.instant.median_picture import MedianPicture, median_picture, with_head
from tests.capture.instant.canonical_person import canonical_landmarks, canonical_pose

HAIR, ROOM, SKIN, SHIRT = (200, 30, 30), (40, 90, 40), (180, 140, 110), (40, 40, 160)
FACE_PX = 90


def pictured(
    monkeypatch: pytest.MonkeyPatch, size: tuple[int, int], middle: tuple[float, float], hair_px: int
) -> MedianPicture:
    """The picture of somebody whose face is 90 pixels high, in a frame of a size (width, height).

    Args:
        middle: of the face.
        hair_px: height of the hair above the forehead.
    """
    width, height = size
    points = canonical_landmarks(canonical_pose(200, 0, FACE_PX / 18.1), 200)
    points = (points - points.mean(axis=0) + middle).astype(np.float32)
    (left, top), (right, low) = points.min(axis=0).astype(int), points.max(axis=0).astype(int)
    image = np.full((height, width, 3), ROOM, np.uint8)
    alpha: Alpha = np.zeros((height, width), np.uint8)
    for part, color in (
        ((left - 15, top - hair_px, right + 15, low), HAIR),
        ((left - 60, low, right + 60, height), SHIRT),
        ((left, top, right, low), SKIN),
    ):
        for picture, value in ((image, color), (alpha, 255)):
            cv2.rectangle(picture, part[:2], part[2:], value, -1)

    class Matting:
        def matte(self, frame: Frame) -> Alpha:
            return alpha.copy()

    monkeypatch.setattr(module, "SelfieMatting", Matting)
    return median_picture([SeenFace(image, points, 0.0, 0.3, 0.0)])


@pytest.mark.parametrize(
    ("size", "middle", "hair_px"),
    [
        ((320, 240), (160, 130), 30),
        ((240, 454), (120, 100), 30),
        ((120, 226), (60, 100), 30),
        ((120, 226), (60, 80), 32),
        ((320, 320), (160, 190), 75),
        ((140, 140), (70, 82), 30),
    ],
)
def test_the_whole_head_is_in_the_picture(
    monkeypatch: pytest.MonkeyPatch, size: tuple[int, int], middle: tuple[float, float], hair_px: int
) -> None:
    """In wide frames and tall ones, with big hair, high up in the frame, and where the head fills it."""
    picture = pictured(monkeypatch, size, middle, hair_px)
    hair = np.abs(picture.image.astype(int) - HAIR).max(axis=2) < 40
    scale = np.ptp(picture.landmarks[:, 1]) / FACE_PX
    assert hair.sum(axis=0).max() > 0.9 * hair_px * scale
    assert not hair[0].any()
    assert not picture.matte[0].any()
    assert picture.matte[-1].max() > 0.9
    assert picture.landmarks[:, 1].max() < len(picture.matte)


def test_the_picture_is_no_larger_than_head_and_shoulders(monkeypatch: pytest.MonkeyPatch) -> None:
    picture = pictured(monkeypatch, (1280, 720), (640, 360), 30)
    assert np.ptp(picture.landmarks[:, 1]) > 0.4 * len(picture.matte)


def test_a_matte_without_the_face_is_filled_with_a_head(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = pictured(monkeypatch, (320, 240), (160, 130), 30)
    kept, missed = with_head(whole)
    assert not missed
    np.testing.assert_allclose(kept.matte, whole.matte, atol=0.05)
    none: Mask = np.zeros_like(whole.matte)
    filled, missed = with_head(MedianPicture(whole.image, none, whole.landmarks, None, 1))
    assert missed
    low, high = whole.landmarks.min(axis=0), whole.landmarks.max(axis=0)
    rows, columns = np.nonzero(filled.matte > 0.5)
    assert low[1] - rows.min() > 0.1 * (high[1] - low[1])
    assert columns.min() < low[0]
    assert columns.max() > high[0]
