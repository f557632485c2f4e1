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
Floats64 = NDArray[np.float64]

BEAM_EXPONENT = 2.0
"""A lamp's intensity falls as this power of the cosine off its axis: half at 45 degrees, as phones' torches have it."""
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


@dataclass(frozen=True, eq=False)
class CaptureLamp:
    """A lamp, seen from the head's middle, camera axes.

    Attributes:
        position_cm: (3,) where it is.
        tilt: (3,) across the way to it: how its light grows from place to place beside the head, as a logarithm by
            radian seen from the lamp; it is not 0 where the lamp points beside the head.
    """

    position_cm: Floats64
    tilt: Floats64

    @property
    def direction(self) -> Floats64:
        """Unit vector (3,) toward it."""
        return np.asarray(self.position_cm / np.linalg.norm(self.position_cm))


def near_field_irradiance(surface: Surface, lamp: CaptureLamp) -> tuple[Floats, Floats]:
    """Unit vectors (height, width, 3) toward a lamp, and the light there (height, width) relative to the head's middle.

    By the inverse square, the beam about the way to the head, and the tilt.
    """
    way = lamp.position_cm.astype(np.float32) - surface.points_cm
    squared = np.einsum("hwc,hwc->hw", way, way)
    toward = way / np.sqrt(squared)[..., None]
    off_axis = np.maximum(toward @ lamp.direction.astype(np.float32), 0)
    distance = float(np.linalg.norm(lamp.position_cm))
    beside = np.exp(surface.points_cm @ (lamp.tilt / distance).astype(np.float32))
    return toward, np.float32(distance**2) / squared * off_axis**BEAM_EXPONENT * beside


def distant_light_factor(surface: Surface, lamp: CaptureLamp) -> Floats:
    """Factor (height, width) from a picture under a near lamp to one far away, alike seen from the head's middle."""
    toward, light = near_field_irradiance(surface, lamp)
    near = np.einsum("hwc,hwc->hw", surface.normals, toward)
    far = surface.normals @ lamp.direction.astype(np.float32)
    cosines = (np.maximum(far, 0) + np.float32(_GRAZING)) / (np.maximum(near, 0) + np.float32(_GRAZING))
    return np.asarray(np.clip(cosines / light, _LEAST, _MOST), np.float32)
