"""Skin aging in the scan's texture space: folds beside nose and mouth, bags, crow's feet, forehead lines, spots."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from relit_camera.base.array_types import Float64Array

SIDE = 2048
_MIDDLE = 512.0
"""Column of the face's middle, in pixels of 1024 x 1024, in which all outlines here are."""


class _Fold(NamedTuple):
    points: tuple[tuple[float, float], ...]
    depth: float
    width: float


_BOTH_SIDES = (
    _Fold(((471, 412), (455, 432), (443, 458), (437, 484), (438, 500)), 1.0, 4.5),
    _Fold(((447, 486), (441, 505), (441, 524)), 0.6, 3.0),
    _Fold(((466, 330), (450, 343), (428, 346), (408, 338)), 0.75, 4.0),
    _Fold(((396, 310), (382, 305), (368, 294)), 0.55, 1.8),
    _Fold(((396, 317), (380, 318), (366, 316)), 0.6, 1.8),
    _Fold(((397, 324), (384, 332), (372, 340)), 0.55, 1.8),
    _Fold(((503, 286), (501, 272), (498, 258)), 0.5, 1.8),
)
"""Outlines in the left half of the texture; the right half mirrors them."""
_ACROSS = tuple(
    _Fold(tuple((x, row + sag * ((x - _MIDDLE) / 90) ** 2) for x in range(425, 601, 16)), depth, 2.0)
    for row, sag, depth in ((208, 8, 0.45), (226, 6, 0.5), (242, 5, 0.35))
)


def folds(seed: int) -> Float64Array:
    """Depth 0..1 (2048, 2048) of the folds."""
    rng = np.random.default_rng(seed + 600)
    total = np.zeros((SIDE, SIDE), np.float32)
    for fold in _BOTH_SIDES:
        total = np.maximum(total, _drawn(fold, rng))
        mirrored = tuple((2 * _MIDDLE - x, y) for x, y in fold.points)
        total = np.maximum(total, _drawn(fold._replace(points=mirrored), rng))
    for fold in _ACROSS:
        total = np.maximum(total, _drawn(fold, rng))
    return total.astype(np.float64)


def age_spots(seed: int, age: float) -> Float64Array:
    """Strength 0..1 (2048, 2048) of pale brown spots; older skin has more of them."""
    rng = np.random.default_rng(seed + 700)
    canvas = np.zeros((SIDE, SIDE), np.float32)
    for _ in range(int(45 * age**2)):
        middle = (int(rng.integers(640, 1410)), int(rng.integers(350, 1000)))
        axes = (int(rng.integers(3, 10)), int(rng.integers(3, 8)))
        cv2.ellipse(canvas, middle, axes, float(rng.uniform(0, 180)), 0, 360, float(rng.uniform(0.1, 0.3)), -1)
    return np.asarray(cv2.GaussianBlur(canvas, (0, 0), 2.5), np.float64)


def _drawn(fold: _Fold, rng: np.random.Generator) -> np.ndarray:
    """One fold, (2048, 2048) float32, of random depth, fading at its ends."""
    canvas = np.zeros((SIDE, SIDE), np.float32)
    points = 2 * (np.array(fold.points) + 1.5 * rng.normal(size=(len(fold.points), 2)))
    along = np.linspace(0, len(points) - 1, 60)
    line = np.stack([np.interp(along, np.arange(len(points)), points[:, axis]) for axis in (0, 1)], axis=1)
    line = cv2.GaussianBlur(line, (1, 15), 0, borderType=cv2.BORDER_REPLICATE)
    strength = fold.depth * rng.uniform(0.5, 1.1) * np.sin(np.pi * np.linspace(0.06, 0.94, len(line) - 1)) ** 0.6
    for start, end, depth in zip(line[:-1], line[1:], strength, strict=True):
        first, second = (tuple(round(16 * float(value)) for value in point) for point in (start, end))
        cv2.line(canvas, first, second, float(depth), max(1, round(2 * fold.width)), cv2.LINE_AA, 4)
    return np.asarray(cv2.GaussianBlur(canvas, (0, 0), fold.width))
