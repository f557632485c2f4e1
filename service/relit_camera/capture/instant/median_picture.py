"""One clean picture of a person from a few frames: aligned, cropped about the head, the median of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.affine import opencv_affine
from relit_camera.base.images.color import linear_from_uint8, luminance
from relit_camera.base.images.image_types import Alpha, DisplayImage, Frame, LinearImage, Mask, Points
from relit_camera.capture.instant.face_selection import CHIN, SeenFace, align_to
from relit_camera.face.matting import SelfieMatting

CROP_REACH = 1.15
"""Half the side of the crop, in heights or widths of the face, whichever is more: head and shoulders."""
CROP_DROP = 0.1
"""How far the crop's middle lies below the face's, in halves of its side."""
HAIR_REACH, HAIR_BESIDE, HAIR_MARGIN = 0.8, 0.35, 0.08
"""How far above the face's landmarks hair is looked for, how far it is held beside them, and the room around it, in
heights or widths of the face, whichever is more."""
CHEST_REACH = 0.35
"""How far below the chin a crop goes that the frame is too small for, in the same."""
HEAD_GROWTH = 1.3
"""Size of a head over that of its face's landmarks, about the chin."""
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
    matting = SelfieMatting()
    alphas = [matting.matte(Frame(face.image, index, 0.0, index / 10)) for index, face in enumerate(faces[:MATTES])]
    window = _crop(best, alphas[0])
    side = int(np.clip(window.side, MIN_SIDE_PX, SIDE_PX)) // 2 * 2
    affines = [align_to(face, best) for face in faces]
    pictures = [window.cut(face.image, affine, side) for face, affine in zip(faces, affines, strict=True)]
    points = [
        window.place(face.landmarks @ affine[:, :2].T + affine[:, 2], side)
        for face, affine in zip(faces, affines, strict=True)
    ]
    for alpha in alphas:
        alpha[0] = 0  # which goes on where the crop does above the frame; at its other sides the body goes on
    mattes = [window.cut(alpha, affine, side) for alpha, affine in zip(alphas, affines[:MATTES], strict=True)]
    size = (64, 36)
    thumbnail = linear_from_uint8(np.asarray(cv2.resize(best.image, size, interpolation=cv2.INTER_AREA), np.uint8))
    person = cv2.resize(matting.matte(Frame(best.image, len(faces), 0.0, 1.0)), size, interpolation=cv2.INTER_AREA)
    return MedianPicture(
        image=np.median(np.stack(pictures), axis=0).round().astype(np.uint8),
        matte=np.asarray(np.mean(mattes, axis=0, dtype=np.float32) / 255, np.float32),
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


def _crop(face: SeenFace, alpha: Alpha) -> _Window:
    """The square about head and shoulders: in the frame, or as much beyond it as the whole head needs."""
    low, high = face.landmarks.min(axis=0), face.landmarks.max(axis=0)
    height, width = alpha.shape
    extent = float((high - low).max())
    head_low = low - [HAIR_BESIDE * extent, 0]
    head_low[1] = _hair_top(alpha, low, high, extent) - HAIR_MARGIN * extent
    head_high = high + [HAIR_BESIDE * extent, CHEST_REACH * extent]
    head_low, head_high = np.maximum(head_low, [0, -np.inf]), np.minimum(head_high, [width, height])
    side = max(min(2 * CROP_REACH * extent, width, height), float((head_high - head_low).max()))
    corner = (low + high) / 2 + [0, CROP_DROP * side / 2] - side / 2
    beyond = np.array([width, height]) - side
    corner = np.clip(corner, np.minimum(beyond, 0), np.maximum(beyond, 0))
    left, top = np.clip(corner, head_high - side, head_low)
    return _Window(float(left), float(top), side)


def _hair_top(alpha: Alpha, low: Points, high: Points, extent: float) -> float:
    """The row up to which a person goes on above the face whose landmarks lie between two corners."""
    top, left, right = max(int(low[1]), 0), max(int(low[0]), 0), max(int(high[0]), 1)
    nothing = np.flatnonzero((alpha[:top, left:right] > 127).mean(axis=1) < 0.1)
    return max(float(nothing[-1] + 1 if len(nothing) else 0), float(low[1]) - HAIR_REACH * extent)


def face_hull(landmarks: Points, shape: tuple[int, ...], growth: float = 1.0) -> Mask:
    """1 in the hull of landmarks in a picture of a shape (height, width), 0 elsewhere; it grows about the chin."""
    grown = landmarks[CHIN] + growth * (landmarks - landmarks[CHIN])
    hull = np.zeros(shape, np.float32)
    cv2.fillConvexPoly(hull, cv2.convexHull(np.round(grown).astype(np.int32)), 1.0)
    return hull


def with_head(picture: MedianPicture) -> tuple[MedianPicture, bool]:
    """The picture with the whole face in its matte, and whether the matte had missed it: then a head is there too."""
    face = face_hull(picture.landmarks, picture.matte.shape)
    missed = float(picture.matte[face > 0].mean()) < 0.5
    head = face_hull(picture.landmarks, picture.matte.shape, HEAD_GROWTH) if missed else face
    soft = cv2.GaussianBlur(cv2.erode(head, np.ones((3, 3))), (0, 0), 1.0)
    return replace(picture, matte=np.maximum(picture.matte, soft)), missed
