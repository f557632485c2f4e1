"""Tracking of corners of the face through pictures under the same light (thesis 4.2.6)."""

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
"""Fraction of the radius of the face's circle where corners are sought: brows, eyes, nose and mouth (thesis 4.2.6)."""


@dataclass(frozen=True)
class CornerTunables:
    """How corners are tracked; `relit evaluate stabilisation` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        max_corners, quality, min_distance_px: of the corners, for `cv2.goodFeaturesToTrack`.
        window_px: side of the window that is matched.
        levels: of the image pyramid above the finest.
        max_round_trip_px: largest distance of a corner from itself after tracking there and back.
        tolerance_px: distance within which a corner agrees with a transform (RANSAC).
        min_found: fraction of the corners that must be found for the face not to be lost.
        near, far: sides of the squares over which mean and contrast are taken, as fractions of the picture's longer
            side.
    """

    max_corners: int = 200
    quality: float = 0.01
    min_distance_px: float = 4
    window_px: int = 21
    levels: int = 2
    max_round_trip_px: float = 0.5
    tolerance_px: float = 1.5
    min_found: float = 0.25
    near: float = 0.15
    far: float = 0.3


_TUNABLES = CornerTunables()


@dataclass(frozen=True)
class CornerMatch:
    """Transform from a picture to the reference, by matched corners.

    Attributes:
        transform: about the picture's center.
        inliers: number of corners that agree.
        residual_px: root mean square distance of those from where the transform takes them.
    """

    transform: RigidTransform
    inliers: int
    residual_px: float


class CornerTracker:
    """Tracks the corners of a reference picture through a sequence of pictures."""

    def __init__(self, reference: Codes, circle: FaceCircle, *, from_reference: bool = True) -> None:
        """Find corners (Shi and Tomasi 1994).

        Args:
            reference: (height, width) uint8.
            circle: of the face in it.
            from_reference: match corners with the reference, so that errors do not accumulate; else with the previous
                picture alone, as the thesis does.
        """
        mask = np.zeros_like(reference)
        center, radius = (round(circle.x - 0.5), round(circle.y - 0.5)), round(circle.radius * TRACKED_RADIUS_SHARE)
        cv2.circle(mask, center, radius, 255, -1)
        found = cv2.goodFeaturesToTrack(
            reference, _TUNABLES.max_corners, _TUNABLES.quality, _TUNABLES.min_distance_px, mask=mask
        )
        self._corners = np.zeros((0, 2), np.float32) if found is None else np.asarray(found[:, 0], np.float32)
        self._reference = self._previous = reference
        self._points = self._corners
        self._from_reference = from_reference

    @property
    def corners(self) -> int:
        """Number of corners."""
        return len(self._corners)

    def track(self, picture: Codes) -> CornerMatch | None:
        """Match the next picture (height, width) uint8 with the reference; None if the face is lost.

        Corners that are not found go where the transform of the others takes them.
        """
        size = (picture.shape[1], picture.shape[0])
        moved = self._match(self._previous, picture, self._points, self._points, size)
        if self._from_reference:
            guess = self._points if moved is None else self._corners_in(moved.transform, size)
            moved = self._match(self._reference, picture, self._corners, guess, size) or moved
        if moved is None:
            return None
        self._previous = picture
        self._points = self._corners_in(moved.transform, size)
        return moved

    def _corners_in(self, transform: RigidTransform, size: tuple[int, int]) -> Points:
        """Positions (corners, 2) of the corners in a picture with this transform to the reference."""
        return transform.inverse().apply(self._corners, size).astype(np.float32)

    def _match(
        self, template: Codes, picture: Codes, points: Points, guess: Points, size: tuple[int, int]
    ) -> CornerMatch | None:
        """Match a picture with the reference.

        Args:
            template: picture in which the corners are at `points`.
            picture: to match.
            points: (corners, 2) in the template.
            guess: (corners, 2) about where they are in the picture.
            size: width and height of the pictures.
        """
        if not len(points):
            return None
        there, found = _flow(template, picture, points, guess)
        back, found_back = _flow(picture, template, there, points)
        good = found & found_back & (np.linalg.norm(back - points, axis=1) < _TUNABLES.max_round_trip_px)
        if good.sum() < _TUNABLES.min_found * len(points):
            return None
        fitted = fit_rigid_transform_ransac(there[good], self._corners[good], size, _TUNABLES.tolerance_px)
        if fitted is None:
            return None
        transform, inliers = fitted
        residual = transform.apply(there[good][inliers], size) - self._corners[good][inliers]
        return CornerMatch(transform, len(residual), float(np.sqrt(np.mean(np.sum(residual**2, axis=1)))))


def _flow(template: Codes, picture: Codes, points: Points, guess: Points) -> tuple[Points, NDArray[np.bool_]]:
    """Positions in the picture of points (count, 2) of the template, and which were found (Lucas and Kanade 1981)."""
    # OpenCV has pixel centers at integers.
    found, status, _ = cv2.calcOpticalFlowPyrLK(
        template,
        picture,
        points[:, None] - np.float32(0.5),
        guess[:, None].copy() - np.float32(0.5),
        winSize=(_TUNABLES.window_px, _TUNABLES.window_px),
        maxLevel=_TUNABLES.levels,
        criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 0.003),
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    return np.asarray(found[:, 0] + np.float32(0.5), np.float32), np.asarray(status[:, 0] > 0)


def local_contrast(picture: NDArray[np.float32]) -> Codes:
    """A picture (height, width) normalized by the mean and spread of each pixel's neighborhood, as codes about 128.

    This removes the changes of automatic exposure, and differences of brightness over the room.
    """
    near, far = (2 * [round(fraction * max(picture.shape))] for fraction in (_TUNABLES.near, _TUNABLES.far))
    detail = picture - cv2.blur(picture, near)
    # Rounding of the running sums may give values slightly below zero.
    spread = np.sqrt(np.maximum(cv2.blur(detail * detail, far), 0)) + 0.01
    return np.asarray(np.clip(128 + 45 * detail / spread, 0, 255), np.uint8)
