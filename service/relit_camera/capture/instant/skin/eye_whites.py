"""The whites of the eyes beside the skin under them: they tell dark skin from light skin in any light and exposure."""

from __future__ import annotations

import cv2
import numpy as np

from relit_camera.base.images.color import luminance
from relit_camera.base.images.image_types import LinearImage, Points
from relit_camera.face.landmarks.landmark_schemes import EyeLandmarks, LandmarkScheme

FINER = 4
"""Factor by which the picture is enlarged: an eye has few pixels."""
IRIS_MARGIN = 1.1
"""Radii of the iris that are left out."""
RING = (0.15, 0.35)
"""Skin that is compared lies so far below the lids, in widths of the eye."""
MIN_PIXELS = 10
PERCENTILE = 75.0
"""Of the white's luminances: lids and lashes shade the rest."""


def eye_white_ratio(picture: LinearImage, landmarks: Points, scheme: LandmarkScheme) -> float | None:
    """Luminance of the whites of the eyes over that of the skin under them; of both eyes the smaller.

    The larger one is where a shadow ends beside an eye. None where the eyes are too small or shut.
    """
    finer = np.asarray(
        cv2.resize(luminance(picture), None, fx=FINER, fy=FINER, interpolation=cv2.INTER_LINEAR), np.float32
    )
    points = np.asarray(landmarks, np.float64) * FINER
    found = [_ratio(finer, points, eye) for eye in (scheme.right_eye, scheme.left_eye)]
    known = [each for each in found if each is not None]
    return min(known) if len(known) == len(found) else None


def _ratio(finer: np.ndarray, points: np.ndarray, eye: EyeLandmarks) -> float | None:
    lids = points[list(eye.lids)]
    opening = np.zeros(finer.shape, np.uint8)
    cv2.fillPoly(opening, [lids.astype(np.int32)], 1)
    white = opening.copy()
    center, edge = points[eye.iris[0]], points[eye.iris[1]]
    radius = int(IRIS_MARGIN * np.linalg.norm(edge - center))
    cv2.circle(white, (int(center[0]), int(center[1])), radius, 0, -1)
    white = cv2.erode(white, np.ones((3, 3)))
    near, far = (np.ones((int(share * np.ptp(lids[:, 0])) | 1,) * 2, np.uint8) for share in RING)
    below = np.arange(len(finer))[:, None] > lids[:, 1].mean()
    skin = (cv2.dilate(opening, far) > cv2.dilate(opening, near)) & below
    if white.sum() < MIN_PIXELS or skin.sum() < MIN_PIXELS:
        return None
    return float(np.percentile(finer[white > 0], PERCENTILE) / max(float(np.median(finer[skin])), 1e-4))
