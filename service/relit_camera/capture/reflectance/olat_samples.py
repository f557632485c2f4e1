"""Samples, the result of a capture: aligned pictures of one person, each under one known light."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import Mask
from relit_camera.capture.geometry.shape_estimation import Geometry, estimate_geometry


@dataclass(frozen=True)
class OlatSamples:
    """One-light-at-a-time pictures of a person.

    Attributes:
        pictures: (lights, height, width, 3) float32 linear RGB, each under a distant light of unit irradiance.
        directions: (lights, 3) float64 unit vectors toward the lights.
        matte: (height, width) float32 straight alpha of the person.
        known_geometry: the person's geometry, where it is known already.
    """

    pictures: NDArray[np.float32]
    directions: NDArray[np.float64]
    matte: Mask
    known_geometry: Geometry | None = None

    def __post_init__(self) -> None:
        lights, height, width = self.pictures.shape[:3]
        if self.directions.shape != (lights, 3) or self.matte.shape != (height, width):
            shapes = self.pictures.shape, self.directions.shape, self.matte.shape
            raise ValueError(f"pictures, directions and matte do not fit together: {shapes}")

    @cached_property
    def geometry(self) -> Geometry:
        """The person's geometry: `known_geometry`, else estimated from the pictures on first use."""
        return self.known_geometry or estimate_geometry(self.pictures, self.directions, self.matte)
