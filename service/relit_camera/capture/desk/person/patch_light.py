"""The light of the screen's patches at each point of the head: direction, distance and extent of each patch.

Axes are those of the camera (X right in the picture, Y up, Z toward the camera), the origin is the middle of the face,
the unit is the centimeter. What the person sees on the right lies at the picture's left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array, Float64Array
from relit_camera.capture.desk.desk_recording import DeskSetup

EXTENT_SAMPLES = 3
"""A patch counts as this many points along each side: with so few its light is right to a percent at 40 cm."""
_GRAZING = 0.15
"""Added to both cosines of a ratio: at grazing angles the cosine law does not hold for skin."""
_MIN_FACTOR, _MAX_FACTOR = 0.5, 2.0


@dataclass(frozen=True, eq=False)
class Patches:
    """The patches of a screen before a head.

    Attributes:
        centers_cm: (patches, 3) from the middle of the face.
        size_cm: width and height of a patch.
    """

    centers_cm: Float64Array
    size_cm: tuple[float, float]

    @property
    def directions(self) -> Float64Array:
        """Unit vectors (patches, 3) from the middle of the face toward the patches."""
        return np.asarray(self.centers_cm / np.linalg.norm(self.centers_cm, axis=1, keepdims=True))

    def irradiance(self, points_cm: NDArray[np.floating], patch: int) -> Float32Array:
        """Vector irradiance (..., 3) of one patch at points (..., 3): n · it is the light on a surface of normal n.

        Of unit radiance, times the patch's mean over its extent; Lambert's emission law. A point's light has the length
        of this vector, and its direction.
        """
        total = np.zeros(points_cm.shape, np.float32)
        steps = (np.arange(EXTENT_SAMPLES) + 0.5) / EXTENT_SAMPLES - 0.5
        area = np.float32(self.size_cm[0] * self.size_cm[1] / EXTENT_SAMPLES**2)
        for across in steps * self.size_cm[0]:
            for up in steps * self.size_cm[1]:
                toward = (self.centers_cm[patch] + (across, up, 0)).astype(np.float32) - points_cm.astype(np.float32)
                squared = np.einsum("...c,...c->...", toward, toward)
                total += toward * (area * np.maximum(toward[..., 2], 0) / squared**2)[..., None]
        return total

    def strengths(self) -> Float32Array:
        """Light (patches,) of each patch at the middle of the face."""
        middle = np.zeros((1, 3))
        return np.array([np.linalg.norm(self.irradiance(middle, k)) for k in range(len(self.centers_cm))], np.float32)

    def distant_light_factor(self, points_cm: Float32Array, normals: Float32Array, patch: int) -> Float32Array:
        """Factor (...) from a picture under a patch to one under a distant light of the same direction and strength.

        The strength is that at the middle of the face.

        Args:
            points_cm: (..., 3) of the surface.
            normals: (..., 3) of the surface.
            patch: index.
        """
        near = self.irradiance(points_cm, patch)
        light = np.linalg.norm(near, axis=-1)
        center = self.irradiance(np.zeros((1, 3)), patch)[0]
        strength = float(np.linalg.norm(center))
        near_cosine = np.einsum("...c,...c->...", normals, near) / np.maximum(light, 1e-12)
        far_cosine = normals @ (center / strength)
        cosines = (np.maximum(far_cosine, 0) + np.float32(_GRAZING)) / (
            np.maximum(near_cosine, 0) + np.float32(_GRAZING)
        )
        return np.asarray(np.clip(cosines * strength / np.maximum(light, 1e-12), _MIN_FACTOR, _MAX_FACTOR), np.float32)


def place_patches(setup: DeskSetup, face_from_axis_cm: tuple[float, float] = (0.0, 0.0)) -> Patches:
    """The patches before a face.

    Args:
        setup: screen, distance and camera.
        face_from_axis_cm: how far to the picture's right and up the middle of the face lies from the camera's axis.
    """
    grid, screen = setup.patches, setup.screen
    width, height = screen.width_cm / grid.columns, screen.height_cm / grid.rows
    # As the person sees the screen, from its middle.
    right = (np.arange(grid.columns) + 0.5) * width - screen.width_cm / 2
    up = screen.height_cm / 2 - (np.arange(grid.rows) + 0.5) * height
    across = -(np.tile(right, grid.rows) - setup.camera.right_cm) - face_from_axis_cm[0]
    above = np.repeat(up, grid.columns) - setup.camera.up_cm - face_from_axis_cm[1]
    return Patches(np.stack([across, above, np.full(grid.count, setup.distance_cm)], axis=1), (width, height))
