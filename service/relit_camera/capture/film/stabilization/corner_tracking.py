"""Following corners of the face through pictures of the same light (thesis 4.2.6)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.alignment.rigid_transform import RigidTransform, fit_rigid_transform_ransac
from relit_camera.capture.film.face_circle import FaceCircle

Codes = NDArray[np.uint8]
Points = NDArray[np.float32]

TRACKED_RADIUS_SHARE = 0.6
"""Of the face's circle: brows, eyes, nose and mouth (thesis 4.2.6)."""

_CORNERS = 200
_QUALITY, _APART_PX = 0.01, 4
_WINDOW_PX = 21
_LEVELS = 2
"""Above the finest: three in all."""
_FORWARD_BACKWARD_PX = 0.5
_TOLERANCE_PX = 1.5
_LEAST_SHARE = 0.25
"""Of the corners that must be found again at once, lest the frame before be asked."""
_NEAR, _FAR = 0.15, 0.3
"""Sides of the squares of which contrast is taken, as shares of the picture's side."""


@dataclass(frozen=True)
class CornerMatch:
    """How a picture lies to the reference, and what speaks for it.

    Attributes:
        transform: from the picture to the reference, about its centre.
        inliers: corners that agree.
        residual_px: how far those are from where the transform has them (RMS).
    """

    transform: RigidTransform
    inliers: int
    residual_px: float


class CornerTracker:
    """Follows the corners of a reference picture; see `track`."""

    def __init__(self, reference: Codes, circle: FaceCircle, *, from_reference: bool = True) -> None:
        """Look for corners (Shi and Tomasi 1994).

        Args:
            reference: (height, width) uint8.
            circle: of the face in it.
            from_reference: find corners again as they are in the reference, so that errors do not add up; else each
                picture is compared with the one before alone, as the thesis does it.
        """
        mask = np.zeros_like(reference)
        centre, radius = (round(circle.x - 0.5), round(circle.y - 0.5)), round(circle.radius * TRACKED_RADIUS_SHARE)
        cv2.circle(mask, centre, radius, 255, -1)
        found = cv2.goodFeaturesToTrack(reference, _CORNERS, _QUALITY, _APART_PX, mask=mask)
        self._corners = np.zeros((0, 2), np.float32) if found is None else np.asarray(found[:, 0], np.float32)
        self._reference = self._before = reference
        self._points = self._corners
        self._from_reference = from_reference

    @property
    def corners(self) -> int:
        """How many there are."""
        return len(self._corners)

    def track(self, picture: Codes) -> CornerMatch | None:
        """How the next picture lies to the reference; None if the face is lost.

        Corners that are not found again go where the transform of the others takes them.
        """
        size = (picture.shape[1], picture.shape[0])
        moved = self._matched(self._before, picture, self._points, self._points, size)
        if self._from_reference:
            guess = self._points if moved is None else self._seen_at(moved.transform, size)
            moved = self._matched(self._reference, picture, self._corners, guess, size) or moved
        if moved is None:
            return None
        self._before = picture
        self._points = self._seen_at(moved.transform, size)
        return moved

    def _seen_at(self, transform: RigidTransform, size: tuple[int, int]) -> Points:
        """Where the reference's corners are in a picture of that transform."""
        return transform.inverse().apply(self._corners, size).astype(np.float32)

    def _matched(
        self, template: Codes, picture: Codes, points: Points, guess: Points, size: tuple[int, int]
    ) -> CornerMatch | None:
        """How the picture lies to the reference, by corners found again at `points` of the template."""
        if not len(points):
            return None
        there, seen = _flow(template, picture, points, guess)
        back, seen_back = _flow(picture, template, there, points)
        good = seen & seen_back & (np.linalg.norm(back - points, axis=1) < _FORWARD_BACKWARD_PX)
        if good.sum() < _LEAST_SHARE * len(points):
            return None
        fitted = fit_rigid_transform_ransac(there[good], self._corners[good], size, _TOLERANCE_PX)
        if fitted is None:
            return None
        transform, agreeing = fitted
        left = transform.apply(there[good][agreeing], size) - self._corners[good][agreeing]
        return CornerMatch(transform, len(left), float(np.sqrt(np.mean(np.sum(left**2, axis=1)))))


def _flow(template: Codes, picture: Codes, points: Points, guess: Points) -> tuple[Points, NDArray[np.bool_]]:
    """Where points of the template are in the picture, and whether they were found (Lucas and Kanade 1981)."""
    # OpenCV's points count from pixel centres.
    found, status, _ = cv2.calcOpticalFlowPyrLK(
        template,
        picture,
        points[:, None] - np.float32(0.5),
        guess[:, None].copy() - np.float32(0.5),
        winSize=(_WINDOW_PX, _WINDOW_PX),
        maxLevel=_LEVELS,
        criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 0.003),
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    return np.asarray(found[:, 0] + np.float32(0.5), np.float32), np.asarray(status[:, 0] > 0)


def local_contrast(picture: NDArray[np.float32]) -> Codes:
    """A picture (height, width) less its neighbourhood's mean, by its neighbourhood's spread, as codes about 128.

    What automatic exposure does from frame to frame, and where the room is brighter, is gone.
    """
    near, far = (2 * [round(share * max(picture.shape))] for share in (_NEAR, _FAR))
    detail = picture - cv2.blur(picture, near)
    # Sums of a moving square may come out a little below zero.
    spread = np.sqrt(np.maximum(cv2.blur(detail * detail, far), 0)) + 0.01
    return np.asarray(np.clip(128 + 45 * detail / spread, 0, 255), np.uint8)
