"""Baseline stabilizers of thesis 4.2: each finds rigid transforms of a face in a sequence of face crops."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import Points
from relit_camera.capture.alignment.rigid_transform import (
    RigidTransform,
    fit_rigid_transform,
    fit_rigid_transform_ransac,
)
from relit_camera.capture.film.face_circle import FaceCircle
from relit_camera.capture.film.stabilization.corner_tracking import TRACKED_RADIUS_SHARE, CornerTracker, local_contrast

GrayImages = NDArray[np.uint8]
Stabilizer = Callable[[GrayImages, FaceCircle], "list[RigidTransform | None]"]
"""Squares (count, side, side) and the face's circle in the first → the transform, about the square's center, that takes
each to one of them; None where it is not found."""

_TOLERANCE_PX = 1.5
_GRID_PX = 6
_TEMPLATE_PX, _SEARCHED_PX = 32, 12
"""Side of the patches (the thesis tries 16 to 64), and the search distance."""


def dense_flow(squares: GrayImages, circle: FaceCircle) -> list[RigidTransform | None]:
    """Dense flow from the brightest frame, which is lit from the front (4.2.1; flow of Kroeger et al. 2016)."""
    anchor = squares[squares.mean(axis=(1, 2)).argmax()]
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    place = np.arange(0, len(anchor), _GRID_PX)
    x, y = (grid.ravel() for grid in np.meshgrid(place, place))
    inside = np.hypot(x + 0.5 - circle.x, y + 0.5 - circle.y) < TRACKED_RADIUS_SHARE * circle.radius
    points = np.stack([x[inside], y[inside]], axis=1).astype(np.float32) + np.float32(0.5)
    moved = (points + flow.calc(anchor, square, None)[y[inside], x[inside]] for square in squares)
    return [_fit_transform(there, points, squares.shape) for there in moved]


def template_matching(squares: GrayImages, circle: FaceCircle) -> list[RigidTransform | None]:
    """Patches around corners, matched from each frame to the next, whose light is similar (4.2.4)."""
    mask = np.zeros_like(squares[0])
    center, radius = (round(circle.x), round(circle.y)), round(circle.radius * TRACKED_RADIUS_SHARE)
    cv2.circle(mask, center, radius, 255, -1)
    found = cv2.goodFeaturesToTrack(squares[0], 60, 0.01, _TEMPLATE_PX / 4, mask=mask)
    corners = np.zeros((0, 2), np.float32) if found is None else np.asarray(found[:, 0] + np.float32(0.5), np.float32)
    transforms: list[RigidTransform | None] = [RigidTransform()]
    now = RigidTransform()
    size = (squares.shape[2], squares.shape[1])
    for before, square in pairwise(squares):
        points = now.inverse().apply(corners, size)
        there = np.array([_match_template(before, square, point) for point in points]).reshape(-1, 2)
        seen = np.isfinite(there).all(axis=1)
        step = _fit_transform(there[seen], corners[seen], squares.shape)
        now = step or now
        transforms.append(step)
    return transforms


def sparse_flow(squares: GrayImages, circle: FaceCircle) -> list[RigidTransform | None]:
    """Corners tracked from each frame to the next by the Lucas-Kanade method (4.2.6)."""
    contrasts = [local_contrast(square.astype(np.float32) / 255) for square in squares]
    tracker = CornerTracker(contrasts[0], circle, from_reference=False)
    matches = [tracker.track(contrast) for contrast in contrasts]
    return [match.transform if match else None for match in matches]


BASELINE_STABILIZERS: Mapping[str, Stabilizer] = {
    "dense flow": dense_flow,
    "template matching": template_matching,
    "sparse flow": sparse_flow,
}


def register_landmarks(landmarks: Sequence[Points], size: tuple[int, int]) -> list[RigidTransform | None]:
    """Landmarks (count, 2) of each frame, (0, 2) where there is no face, to the first ones seen (4.2.5).

    The transforms are about the center of a picture of `size`.
    """
    known = next((points for points in landmarks if len(points)), None)
    if known is None:
        return [None] * len(landmarks)
    return [fit_rigid_transform(points, known, size) if len(points) else None for points in landmarks]


def _fit_transform(
    there: NDArray[np.floating], known: NDArray[np.floating], shape: tuple[int, ...]
) -> RigidTransform | None:
    fitted = fit_rigid_transform_ransac(there, known, (shape[2], shape[1]), _TOLERANCE_PX)
    return fitted[0] if fitted else None


def _match_template(before: GrayImages, square: GrayImages, point: NDArray[np.floating]) -> NDArray[np.float64]:
    """Subpixel position (2,) in `square` of the patch around a point of `before`; NaN outside the square."""
    left, top = (int(value) for value in np.round(point - _TEMPLATE_PX / 2))
    reach = _TEMPLATE_PX + _SEARCHED_PX
    if min(left, top) < _SEARCHED_PX or max(left, top) + reach > len(square):
        return np.full(2, np.nan)
    patch = before[top : top + _TEMPLATE_PX, left : left + _TEMPLATE_PX]
    searched = square[top - _SEARCHED_PX : top + reach, left - _SEARCHED_PX : left + reach]
    score = cv2.matchTemplate(searched, patch, cv2.TM_CCOEFF_NORMED)
    row, column = (int(value) for value in np.unravel_index(score.argmax(), score.shape))
    shift = np.array([_subpixel_peak(score[row], column), _subpixel_peak(score[:, column], row)]) - _SEARCHED_PX
    return np.asarray(point + shift)


def _subpixel_peak(values: NDArray[np.float32], place: int) -> float:
    """Position of the vertex of a parabola through the highest value, at `place`, and its neighbors."""
    if not 0 < place < len(values) - 1:
        return float(place)
    before, here, after = (float(value) for value in values[place - 1 : place + 2])
    bend = before - 2 * here + after
    return place + (0.5 * (before - after) / bend if bend else 0.0)
