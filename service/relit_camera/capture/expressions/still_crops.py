"""Crops of chosen frames: the pictures of expression stills, all of one size."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.affine import opencv_affine
from relit_camera.base.images.image_types import DisplayImage, Points
from relit_camera.capture.expressions.film_tracking import TrackedFace
from relit_camera.face.landmarks.landmark_schemes import LandmarkScheme
from relit_camera.subject.expression_stills import MAX_STILL_SIDE_PX

MARGIN = 0.08
"""Round the face, in parts of the larger side of its box; half of it is shown."""
MAX_ENLARGEMENT = 2.0
"""Largest distance of the eyes in a still, in parts of that in the source image: more would not be seen."""


class StillCropper:
    """Makes a square picture of each face alone, all of one size."""

    def __init__(self, faces: Sequence[TrackedFace], scheme: LandmarkScheme, source_span: float) -> None:
        """Find the size.

        Args:
            faces: those of all stills.
            scheme: of the landmarks.
            source_span: distance of the outer eye corners in the source image, in pixels.
        """
        span = float(np.median([scheme.eye_span(face.landmarks) for face in faces]))
        scale = min(1.0, MAX_ENLARGEMENT * source_span / span)
        widest = max(float(np.ptp(face.landmarks, axis=0).max()) for face in faces) * (1 + 2 * MARGIN)
        self._side = min(round(widest * scale), MAX_STILL_SIDE_PX)
        self._scale = self._side / widest

    def crop(self, image: DisplayImage, face: TrackedFace) -> tuple[DisplayImage, Points]:
        """The picture of a face in a frame, and the landmarks in it."""
        middle = (face.landmarks.min(axis=0) + face.landmarks.max(axis=0)) / 2
        affine = np.column_stack([np.eye(2) * self._scale, self._side / 2 - self._scale * middle])
        moved = (face.landmarks @ affine[:, :2].T + affine[:, 2]).astype(np.float32)
        return _face_alone(_resampled(image, affine, self._side, self._scale), moved), moved


def black_beyond_face(image: DisplayImage, landmarks: Points) -> DisplayImage:
    """A frame with black where no still of that face has a pixel: as a file it is a third as large."""
    low, high = landmarks.min(axis=0), landmarks.max(axis=0)
    reach = 2 * MARGIN * float((high - low).max())
    left, top = np.maximum(np.floor(low - reach), 0).astype(int)
    right, bottom = np.maximum(np.ceil(high + reach), 0).astype(int)
    kept = np.zeros_like(image)
    kept[top:bottom, left:right] = image[top:bottom, left:right]
    return kept


def _face_alone(image: DisplayImage, landmarks: Points) -> DisplayImage:
    """A picture with one color instead of what is not the face: the room is nobody's business, and takes space."""
    shown = np.zeros(image.shape[:2], np.uint8)
    cv2.fillConvexPoly(shown, cv2.convexHull(np.round(landmarks).astype(np.int32)), 1)
    reach = max(round(MARGIN / 2 * len(image)), 1)
    shown = cv2.dilate(shown, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
    alone = image.copy()
    alone[shown == 0] = np.round(cv2.mean(image, shown)[:3]).astype(np.uint8)
    return alone


def _resampled(image: DisplayImage, affine: NDArray[np.float64], side: int, scale: float) -> DisplayImage:
    """The part of a picture that an affine map (2, 3), which does not enlarge, brings into a square."""
    soft = image if scale > 0.7 else cv2.GaussianBlur(image, (0, 0), 0.4 / scale)
    cropped: DisplayImage = cv2.warpAffine(
        soft, opencv_affine(affine), (side, side), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )
    return cropped
