"""A lamp a metre away as one far away: what each pixel gets more or less than the head's middle.

On a head's size both differ by some ten decibels less than what counts: a nose is 9 cm nearer to the lamp than an ear,
and sees it 5 degrees off. With the head's shape known, each pixel's own direction and the inverse square of its own
distance turn a picture into what a lamp far off in the direction of the head's middle would give.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

_GRAZING = 0.15
"""Added to both cosines whose ratio is taken: at the shadow's edge the law of the cosine says nothing of skin."""
_LEAST, _MOST = 0.5, 2.0


@dataclass(frozen=True, eq=False)
class Surface:
    """The person's shape as the lamp needs it.

    Attributes:
        normals: (height, width, 3) float32 unit vectors.
        points_cm: (height, width, 3) float32, from the head's middle, camera axes.
    """

    normals: Floats
    points_cm: Floats

    def resized(self, size: tuple[int, int]) -> Surface:
        """The same for pictures of this width and height."""
        normals, points = (
            cv2.resize(each, size, interpolation=cv2.INTER_LINEAR) for each in (self.normals, self.points_cm)
        )
        return Surface(normals / np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-6), points)


def light_at(surface: Surface, lamp_cm: NDArray[np.float64]) -> tuple[Floats, Floats]:
    """Unit vectors (height, width, 3) toward a lamp, and the light there (height, width) relative to the head's middle.

    Args:
        surface: the person's.
        lamp_cm: (3,) from the head's middle.
    """
    way = lamp_cm.astype(np.float32) - surface.points_cm
    squared = np.einsum("hwc,hwc->hw", way, way)
    return way / np.sqrt(squared)[..., None], np.float32(lamp_cm @ lamp_cm) / squared


def to_distant(surface: Surface, lamp_cm: NDArray[np.float64]) -> Floats:
    """Factor (height, width) that takes a picture under a near lamp to one far away, seen from the head's middle alike.

    Args:
        surface: the person's.
        lamp_cm: (3,) from the head's middle.
    """
    toward, light = light_at(surface, lamp_cm)
    near = np.einsum("hwc,hwc->hw", surface.normals, toward)
    far = surface.normals @ (lamp_cm / np.linalg.norm(lamp_cm)).astype(np.float32)
    cosines = (np.maximum(far, 0) + np.float32(_GRAZING)) / (np.maximum(near, 0) + np.float32(_GRAZING))
    return np.asarray(np.clip(cosines / light, _LEAST, _MOST), np.float32)
