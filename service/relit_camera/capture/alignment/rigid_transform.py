"""Rigid transforms in the picture (thesis 4.2.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.affine import opencv_affine

Floats = NDArray[np.float64]
Size = tuple[int, int]
"""Width and height of the picture in pixels."""


_MIN_PAIRS = 4
_TREND_S = 0.2


@dataclass(frozen=True)
class RigidTransform:
    """A turn about the picture's centre, then a shift: it takes points of a frame to where they are in the reference.

    Attributes:
        rotation_deg: counter-clockwise positive.
        x, y: pixels to the right and down.
    """

    rotation_deg: float = 0.0
    x: float = 0.0
    y: float = 0.0

    def matrix(self, size: Size) -> Floats:
        """(2, 3): it maps points (x, y, 1), pixel centres at integers + ½, of a picture of this size."""
        cosine, sine = np.cos(np.radians(self.rotation_deg)), np.sin(np.radians(self.rotation_deg))
        turn = np.array([[cosine, sine], [-sine, cosine]])  # y goes down
        centre = np.array(size) / 2
        return np.concatenate([turn, (centre - turn @ centre + (self.x, self.y))[:, None]], axis=1)

    def apply(self, points: NDArray, size: Size) -> Floats:
        """Points (count, 2) of the frame, in the reference."""
        matrix = self.matrix(size)
        return np.asarray(points @ matrix[:, :2].T + matrix[:, 2])

    def then(self, later: RigidTransform) -> RigidTransform:
        """Both, `later` after this one."""
        turn = later.matrix((0, 0))[:, :2]
        x, y = turn @ (self.x, self.y) + (later.x, later.y)
        return RigidTransform(self.rotation_deg + later.rotation_deg, float(x), float(y))

    def scaled(self, factor: float) -> RigidTransform:
        """The same in a picture so many times as large."""
        return RigidTransform(self.rotation_deg, self.x * factor, self.y * factor)

    def inverse(self) -> RigidTransform:
        """From the reference to the frame."""
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
    """The same of those pairs that agree within a tolerance, and which they are; None if fewer than four do.

    By random samples (Fischler and Bolles 1981).
    """
    if len(points) < _MIN_PAIRS:
        return None
    _, agreeing = cv2.estimateAffinePartial2D(
        np.float32(points), np.float32(targets), method=cv2.RANSAC, ransacReprojThreshold=tolerance_px
    )
    if agreeing is None or int(agreeing.sum()) < _MIN_PAIRS:
        return None
    inside = agreeing[:, 0] > 0
    return fit_rigid_transform(points[inside], targets[inside], size), inside


def warp_to_reference(picture: NDArray[np.float32], transform: RigidTransform) -> NDArray[np.float32]:
    """The frame's picture (height, width[, channels]) as it would be in the reference; its border repeats outside."""
    height, width = picture.shape[:2]
    return warp_affine(picture, transform.matrix((width, height)), (width, height))


def warp_affine(picture: NDArray[np.float32], matrix: Floats, size: Size) -> NDArray[np.float32]:
    """`picture` resampled to `size` by a (2, 3) matrix from its points to the result's; bicubic, border repeated."""
    moved = cv2.warpAffine(picture, opencv_affine(matrix), size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(moved, np.float32)


def interpolate_transforms(times_s: Floats, known_s: Floats, known: Sequence[RigidTransform]) -> list[RigidTransform]:
    """Transforms at times (count,) between those known at growing times (thesis 4.3.3).

    Before the first and after the last they go on as they went over the nearest fifth of a second.
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


def transforms_to_array(transforms: Sequence[RigidTransform]) -> Floats:
    """Rotation in degrees, x and y: (count, 3)."""
    return np.array([[each.rotation_deg, each.x, each.y] for each in transforms]).reshape(-1, 3)


def transforms_from_array(rows: Floats) -> list[RigidTransform]:
    """The inverse of `transforms_to_array`."""
    return [RigidTransform(*row) for row in rows.tolist()]


def _complex(points: NDArray) -> NDArray[np.complex128]:
    return np.asarray(points[:, 0] - 1j * points[:, 1])
