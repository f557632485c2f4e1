"""Where the source image tells something of a live picture: masks of its size, and the box that they fill."""

from __future__ import annotations

import cv2
import numpy as np

from relit_camera.base.images.image_types import Mask
from relit_camera.live.reenactment.control_points import feature_landmarks
from relit_camera.live.reenactment.source_image import SourceFace

MOVING_REACH, SOFT_PX = 1.25, 1.5
"""By how much the outlines of eyes and lips are enlarged, and how soft the borders are, in source pixels."""
EDGE_MARGIN = 0.02
"""Share of the source image's width at the matte's edge that is not trusted."""
NEAR = 0.6
"""Eye distances beyond the outline up to which noise is kept from being shown."""
BORDER_FADE = 0.08
"""Share of the source image's height, at its borders, over which it is trusted less and less: the body goes on."""
_NO_LIMIT = 1e9
"""Source pixels, more than any picture has."""


def ratio_confidence(matte: Mask) -> Mask:
    """How far the ratio counts, 0..1: in the matte, less toward its edge, whose rim light is not the live picture's.

    Less toward the picture's left, right and lower border as well: what lies beyond is the same person, of whom the
    picture at the border tells little. There the ratio goes on as their mean.
    """
    height, width = matte.shape
    reach = max(round(EDGE_MARGIN * width), 1)
    inner = cv2.erode(matte, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1)))
    x, y = np.arange(width) + 0.5, np.arange(height) + 0.5
    below, beside = height - y, np.minimum(x, width - x)
    fade = np.clip(np.minimum.outer(below, beside) / (BORDER_FADE * height), 0, 1).astype(np.float32)
    return np.asarray(cv2.GaussianBlur(inner, (0, 0), reach / 2) * fade, dtype=np.float32)


def near_person(confidence: Mask, eye_distance: float) -> Mask:
    """Where the person is, or is as soon as they turn, since a turned head is wider, 0..1: up to NEAR from the outline.

    Args:
        confidence: where the source image shows them.
        eye_distance: in its pixels.
    """
    blurred = cv2.GaussianBlur(confidence, (0, 0), NEAR / 1.28 * eye_distance, borderType=cv2.BORDER_REPLICATE)
    # Beside a straight outline a blur has fallen to a tenth after 1.28 sigma.
    return np.asarray(np.maximum(confidence, np.clip((blurred - 0.1) / 0.3, 0, 1)), np.float32)


def still_skin(face: SourceFace) -> Mask:
    """Where the source image shows what the live picture shows too, 0..1: not eyes and lips, which open and close."""
    skin = np.ones(face.size[::-1], np.float32)
    for feature in feature_landmarks(face.scheme):
        outline = cv2.convexHull(face.landmarks[list(feature)])[:, 0]
        grown = outline.mean(axis=0) + MOVING_REACH * (outline - outline.mean(axis=0))
        cv2.fillConvexPoly(skin, np.round(grown).astype(np.int32), 0.0)
    return np.asarray(cv2.GaussianBlur(skin, (0, 0), SOFT_PX), np.float32)


def inside_face(face: SourceFace) -> Mask:
    """Where the source image shows the face, 0..1."""
    drawn = np.zeros(face.size[::-1], np.float32)
    cv2.fillPoly(drawn, [np.round(face.landmarks[list(face.scheme.oval)]).astype(np.int32)], 1.0)
    return np.asarray(cv2.GaussianBlur(drawn, (0, 0), SOFT_PX), np.float32)


def limits(mask: Mask) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The least and the largest x and y, as OpenCV counts, whose surroundings are in a mask of the source image.

    Where that is at a border of the picture, which is repeated beyond, there is no limit.
    """
    left, top, width, height = cv2.boundingRect((mask > 0).astype(np.uint8))
    low, high = np.array([left, top]) - 1.0, np.array([left + width, top + height], np.float64)
    low[low < 0] = -_NO_LIMIT
    high[high >= mask.shape[::-1]] = _NO_LIMIT
    return tuple(low), tuple(high)
