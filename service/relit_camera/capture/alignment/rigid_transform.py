"""Rigid transforms in the picture plane (thesis 4.2.2): fitting, applying and interpolating them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float64Array
from relit_camera.base.images.affine import opencv_affine

Size = tuple[int, int]
"""Width and height of the picture in pixels."""


_MIN_PAIRS = 4
"""Least number of agreeing point pairs that RANSAC accepts."""
_TREND_S = 0.2
"""Duration over which the trend at either end is measured, to extrapolate by."""


@dataclass(frozen=True)
class RigidTransform:
    """A rotation about the picture's center, then a shift: it takes points of a frame to the reference frame.

    Attributes:
        rotation_deg: counter-clockwise positive.
        x, y: pixels to the right and down.
    """

    rotation_deg: float = 0.0
    x: float = 0.0
    y: float = 0.0

    def matrix(self, size: Size) -> Float64Array:
        """The (2, 3) matrix that maps points (x, y, 1) of a picture of this size, pixel centers at integers + ½."""
        cosine, sine = np.cos(np.radians(self.rotation_deg)), np.sin(np.radians(self.rotation_deg))
        turn = np.array([[cosine, sine], [-sine, cosine]])  # y goes down
        center = np.array(size) / 2
        return np.concatenate([turn, (center - turn @ center + (self.x, self.y))[:, None]], axis=1)

    def apply(self, points: NDArray, size: Size) -> Float64Array:
        """Points (count, 2) of the frame, mapped to the reference."""
        matrix = self.matrix(size)
        return np.asarray(points @ matrix[:, :2].T + matrix[:, 2])

    def then(self, later: RigidTransform) -> RigidTransform:
        """The composition: this transform, then `later`."""
        turn = later.matrix((0, 0))[:, :2]
        x, y = turn @ (self.x, self.y) + (later.x, later.y)
        return RigidTransform(self.rotation_deg + later.rotation_deg, float(x), float(y))

    def scaled(self, factor: float) -> RigidTransform:
        """The same transform in a picture `factor` times as large."""
        return RigidTransform(self.rotation_deg, self.x * factor, self.y * factor)

    def inverse(self) -> RigidTransform:
        """The inverse transform, from the reference to the frame."""
        x, y = -RigidTransform(-self.rotation_deg).matrix((0, 0))[:, :2] @ (self.x, self.y)
        return RigidTransform(-self.rotation_deg, float(x), float(y))


def fit_rigid_transform(points: NDArray, targets: NDArray, size: Size) -> RigidTransform:
    """The transform that takes points (count, 2) nearest to targets (count, 2): least squares (Kabsch 1976)."""
    here, there = points.mean(axis=0), targets.mean(axis=0)
    # In the complex plane with y up a turn counter-clockwise is a product.
    start, end = (_complex(points - here), _complex(targets - there))
    rotation = RigidTransform(float(np.degrees(np.angle(np.vdot(start, end)))))
    x, y = there - rotation.apply(here[None], size)[0]
    return RigidTransform(rotation.rotation_deg, float(x), float(y))


def fit_rigid_transform_ransac(
    points: NDArray, targets: NDArray, size: Size, tolerance_px: float
) -> tuple[RigidTransform, NDArray[np.bool_]] | None:
    """The least-squares transform of the inliers that RANSAC (Fischler and Bolles 1981) finds, and their mask.

    None where fewer than four pairs of points and targets (count, 2) agree within the tolerance.
    """
    if len(points) < _MIN_PAIRS:
        return None
    _, inliers = cv2.estimateAffinePartial2D(
        np.float32(points), np.float32(targets), method=cv2.RANSAC, ransacReprojThreshold=tolerance_px
    )
    if inliers is None or int(inliers.sum()) < _MIN_PAIRS:
        return None
    inside = inliers[:, 0] > 0
    return fit_rigid_transform(points[inside], targets[inside], size), inside


def warp_to_reference(picture: NDArray[np.float32], transform: RigidTransform) -> NDArray[np.float32]:
    """The frame's picture (height, width[, channels]) resampled in the reference frame, its border repeated."""
    height, width = picture.shape[:2]
    return warp_affine(picture, transform.matrix((width, height)), (width, height))


def warp_affine(picture: NDArray[np.float32], matrix: Float64Array, size: Size) -> NDArray[np.float32]:
    """`picture` resampled to `size` by a (2, 3) matrix from its points to the result's; bicubic, border repeated."""
    moved = cv2.warpAffine(picture, opencv_affine(matrix), size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(moved, np.float32)


def interpolate_transforms(
    times_s: Float64Array, known_s: Float64Array, known: Sequence[RigidTransform]
) -> list[RigidTransform]:
    """Transforms at times (count,), linear between those known at ascending times (thesis 4.3.3).

    Before the first and after the last they are extrapolated by the trend of the nearest fifth of a second.
    """
    rows = transforms_to_array(known)
    between = np.stack([np.interp(times_s, known_s, column) for column in rows.T], axis=1)
    for outside, end, inner in (
        (times_s < known_s[0], 0, int(np.searchsorted(known_s, known_s[0] + _TREND_S))),
        (times_s > known_s[-1], -1, int(np.searchsorted(known_s, known_s[-1] - _TREND_S, side="right")) - 1),
    ):
        if 0 <= inner < len(known_s) and known_s[inner] != known_s[end]:
            speed = (rows[inner] - rows[end]) / (known_s[inner] - known_s[end])
            between[outside] += (times_s[outside] - known_s[end])[:, None] * speed
    return transforms_from_array(between)


def transforms_to_array(transforms: Sequence[RigidTransform]) -> Float64Array:
    """Rows (count, 3) of rotation in degrees, x and y."""
    return np.array([[each.rotation_deg, each.x, each.y] for each in transforms]).reshape(-1, 3)


def transforms_from_array(rows: Float64Array) -> list[RigidTransform]:
    """Transforms from rows (count, 3) of rotation in degrees, x and y."""
    return [RigidTransform(*row) for row in rows.tolist()]


def _complex(points: NDArray) -> NDArray[np.complex128]:
    return np.asarray(points[:, 0] - 1j * points[:, 1])
