"""One clean picture of a person from a few frames: aligned, cropped about the head, the median of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.affine import opencv_affine
from relit_camera.base.images.color import linear_from_uint8, luminance
from relit_camera.base.images.image_types import DisplayImage, Frame, LinearImage, Mask, Points
from relit_camera.capture.instant.face_selection import SeenFace, align_to
from relit_camera.face.matting import SelfieMatting

CROP_REACH = 1.15
"""Half the side of the crop, in heights or widths of the face, whichever is more: head and shoulders."""
CROP_DROP = 0.1
"""How far the crop's middle lies below the face's, in halves of its side."""
SIDE_PX, MIN_SIDE_PX = 256, 128
"""Side of the crop: fewer pixels where the frame has fewer."""
BACKGROUND_ALPHA = 13
"""Alpha below which a pixel is the room's."""
MIN_BACKGROUND, MIN_BACKGROUND_PIXELS = 0.02, 150
"""A picture shows the room where its mean is brighter than this, and it has so many pixels of a thumbnail of 2304."""
MATTES = 5
"""Frames whose mattes are averaged."""


@dataclass(frozen=True)
class MedianPicture:
    """A person's head and shoulders.

    Attributes:
        image: (side, side, 3) uint8 sRGB.
        matte: (side, side).
        landmarks: (478, 2) pixels of it.
        frame_luminance: mean linear luminance of the whole frame, the room included; None before black, where the frame
            tells nothing of the room.
        frames: how many were used.
    """

    image: DisplayImage
    matte: Mask
    landmarks: Points
    frame_luminance: float | None
    frames: int


def median_picture(faces: Sequence[SeenFace]) -> MedianPicture:
    """The picture of faces that `select_faces` chose, the best first.

    Raises:
        ModelError: the network of the matte is not there.
    """
    best = faces[0]
    window = _crop(best)
    side = int(np.clip(window.side, MIN_SIDE_PX, SIDE_PX)) // 2 * 2
    pictures, points = [], []
    matting, mattes = SelfieMatting(), []
    for index, face in enumerate(faces):
        affine = align_to(face, best)
        pictures.append(window.cut(face.image, affine, side))
        points.append(window.place(face.landmarks @ affine[:, :2].T + affine[:, 2], side))
        if index < MATTES:
            alpha = matting.matte(Frame(face.image, index, 0.0, index / 10))
            mattes.append(window.cut(alpha, affine, side).astype(np.float32) / 255)
    size = (64, 36)
    thumbnail = linear_from_uint8(np.asarray(cv2.resize(best.image, size, interpolation=cv2.INTER_AREA), np.uint8))
    person = cv2.resize(matting.matte(Frame(best.image, len(faces), 0.0, 1.0)), size, interpolation=cv2.INTER_AREA)
    return MedianPicture(
        image=np.median(np.stack(pictures), axis=0).round().astype(np.uint8),
        matte=np.mean(mattes, axis=0, dtype=np.float32),
        landmarks=np.mean(points, axis=0).astype(np.float32),
        frame_luminance=float(luminance(thumbnail).mean()) if _shows_room(thumbnail, person) else None,
        frames=len(faces),
    )


def _shows_room(thumbnail: LinearImage, person: NDArray[np.uint8]) -> bool:
    """Whether there is more than black behind a person of that alpha."""
    behind = luminance(thumbnail)[person < BACKGROUND_ALPHA]
    return bool(len(behind) >= MIN_BACKGROUND_PIXELS and behind.mean() > MIN_BACKGROUND)


@dataclass(frozen=True)
class _Window:
    """A square of a frame: its upper left corner and side, in pixels."""

    left: float
    top: float
    side: float

    def cut(self, picture: NDArray[np.uint8], affine: NDArray[np.float64], side: int) -> NDArray[np.uint8]:
        """The square of a picture that `affine` (2, 3) brings onto the frame, (side, side, …)."""
        finer = max(1, round(self.side / side))
        scale = side * finer / self.side
        matrix = np.array([[scale, 0, -scale * self.left], [0, scale, -scale * self.top]])
        matrix = np.column_stack([matrix[:, :2] @ affine[:, :2], matrix[:, :2] @ affine[:, 2] + matrix[:, 2]])
        size = (side * finer, side * finer)
        warped = cv2.warpAffine(picture, opencv_affine(matrix), size, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(cv2.resize(warped, (side, side), interpolation=cv2.INTER_AREA), np.uint8)

    def place(self, points: NDArray[np.floating], side: int) -> NDArray[np.floating]:
        """Pixels of the square, of points (count, 2) of the frame."""
        return (points - [self.left, self.top]) * (side / self.side)


def _crop(face: SeenFace) -> _Window:
    """The square about the head; it stays in the frame."""
    low, high = face.landmarks.min(axis=0), face.landmarks.max(axis=0)
    height, width = face.image.shape[:2]
    half = min(CROP_REACH * float((high - low).max()), height / 2, width / 2)
    x, y = (low + high) / 2 + [0, CROP_DROP * half]
    left, top = np.clip([x - half, y - half], 0, [width - 2 * half, height - 2 * half])
    return _Window(float(left), float(top), 2 * half)
