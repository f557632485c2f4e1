"""A person's geometry, estimated from one-light pictures: normals, albedo, depth and horizons."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array
from relit_camera.base.images.image_types import LinearImage, Mask
from relit_camera.capture.geometry.horizon_map import HorizonMap, calibrate_horizon_map, compute_horizon_map
from relit_camera.capture.geometry.normal_completion import complete_normals
from relit_camera.capture.geometry.normal_integration import integrate_normals
from relit_camera.capture.geometry.photometric_stereo import photometric_stereo


@dataclass(frozen=True)
class Geometry:
    """Shape of a person, pixel by pixel.

    Attributes:
        normals: (height, width, 3) float32 unit vectors; (0, 0, 1) outside of the matte.
        albedo: (height, width, 3) float32 linear reflectance, 1 for a white wall; 0 outside.
        confidence: (height, width) float32, reliability of a pixel's own normal: 0 unknown to 1 certain.
        depth: (height, width) float32 in pixels toward the camera, mean 0; NaN outside.
        horizon: which lights the rest of the surface hides from each pixel.
    """

    normals: Float32Array
    albedo: LinearImage
    confidence: Mask
    depth: Float32Array
    horizon: HorizonMap

    def cosines(self, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Float32Array:
        """n·l, negative behind the surface, of unit vectors (count, 3) at row-major pixels (some,): (some, count)."""
        return self.normals.reshape(-1, 3)[pixels] @ directions.T.astype(np.float32)

    def visible(self, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Whether light reaches pixels directly, neither hidden nor from behind the surface: (some, count)."""
        return (self.horizon.margins(directions, pixels) > 0) & (self.cosines(directions, pixels) > 0)


def estimate_geometry(
    pictures: Float32Array, directions: NDArray[np.float64], matte: Mask, focal_px: float | None = None
) -> Geometry:
    """Normals and albedo by photometric stereo, depth by integration, visibility by horizons and observed shadows.

    Args:
        pictures: (lights, height, width, 3) linear, each under a distant light of unit irradiance.
        directions: (lights, 3) unit vectors.
        matte: (height, width) alpha of the person.
        focal_px: focal length in pixels where it is known; the depth is then right in perspective.
    """
    result = photometric_stereo(pictures, directions, matte)
    normals = complete_normals(result.normals, result.confidence, matte)
    depth = integrate_normals(normals, matte > 0.5, result.confidence, focal_px)
    horizon = calibrate_horizon_map(compute_horizon_map(depth), result.lit, directions)
    return Geometry(normals, result.albedo, result.confidence, depth, horizon)
