"""Correction of the near field: a picture under a lamp a meter away becomes one under a distant lamp.

A nose is 9 cm nearer to such a lamp than an ear, and sees it in a direction 5 degrees off. With the head's shape known,
each pixel's own direction to the lamp and the inverse square of its own distance give the factor to the light of a
distant lamp in the direction in which the head's middle sees the near one.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from relit_camera.base.array_types import Float32Array, Float64Array

BEAM_EXPONENT = 2.0
"""The lamp's intensity is proportional to this power of the cosine off its axis: half at 45 degrees, as of the torches
of phones."""
_GRAZING = 0.15
"""Added to both cosines of a ratio: at grazing angles the cosine law does not hold for skin."""
_MIN_FACTOR, _MAX_FACTOR = 0.5, 2.0


@dataclass(frozen=True, eq=False)
class Surface:
    """The person's shape.

    Attributes:
        normals: (height, width, 3) float32 unit vectors, camera axes.
        points_cm: (height, width, 3) float32 positions from the head's middle, camera axes.
    """

    normals: Float32Array
    points_cm: Float32Array

    def resized(self, size: tuple[int, int]) -> Surface:
        """The surface resampled to this width and height."""
        normals, points = (
            cv2.resize(each, size, interpolation=cv2.INTER_LINEAR) for each in (self.normals, self.points_cm)
        )
        return Surface(normals / np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-6), points)


@dataclass(frozen=True, eq=False)
class CaptureLamp:
    """A lamp near the head, camera axes.

    Attributes:
        position_cm: (3,) from the head's middle.
        tilt: (3,) perpendicular to the direction to the lamp: gradient of the logarithm of its light across the head,
            per radian seen from the lamp; nonzero where the lamp points beside the head.
    """

    position_cm: Float64Array
    tilt: Float64Array

    @property
    def direction(self) -> Float64Array:
        """Unit vector (3,) toward the lamp from the head's middle."""
        return np.asarray(self.position_cm / np.linalg.norm(self.position_cm))


def near_field_irradiance(surface: Surface, lamp: CaptureLamp) -> tuple[Float32Array, Float32Array]:
    """Unit vectors (height, width, 3) toward a lamp, and its light (height, width) relative to the head's middle.

    The light depends on the inverse square of the distance, the angle off the beam's axis, and the tilt.
    """
    to_lamp = lamp.position_cm.astype(np.float32) - surface.points_cm
    squared = np.einsum("hwc,hwc->hw", to_lamp, to_lamp)
    toward = to_lamp / np.sqrt(squared)[..., None]
    off_axis = np.maximum(toward @ lamp.direction.astype(np.float32), 0)
    distance = float(np.linalg.norm(lamp.position_cm))
    tilted = np.exp(surface.points_cm @ (lamp.tilt / distance).astype(np.float32))
    return toward, np.float32(distance**2) / squared * off_axis**BEAM_EXPONENT * tilted


def distant_light_factor(surface: Surface, lamp: CaptureLamp) -> Float32Array:
    """Factor (height, width) from a picture under a near lamp to one under a distant lamp in the same direction."""
    toward, light = near_field_irradiance(surface, lamp)
    near = np.einsum("hwc,hwc->hw", surface.normals, toward)
    far = surface.normals @ lamp.direction.astype(np.float32)
    cosines = (np.maximum(far, 0) + np.float32(_GRAZING)) / (np.maximum(near, 0) + np.float32(_GRAZING))
    return np.asarray(np.clip(cosines / light, _MIN_FACTOR, _MAX_FACTOR), np.float32)
