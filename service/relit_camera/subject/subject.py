"""The subject: one person's compressed reflectance field and what goes with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from relit_camera.space.images import DisplayImage, Mask, Points
from relit_camera.subject.field import TEXELS

FORMAT_VERSION: Literal[1] = 1


class SubjectMetadata(BaseModel):
    """The header of a subject file."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    format_version: Literal[1] = FORMAT_VERSION
    width: Annotated[int, Field(ge=8, le=8192)]
    height: Annotated[int, Field(ge=8, le=8192)]
    light_map: tuple[int, int] = (64, 32)
    """Width and height of the light maps that it answers to."""
    method: str
    """Name of the reflectance method that built the field."""
    lights: Annotated[int, Field(ge=1)]
    components: Annotated[int, Field(ge=1)]
    source: str
    """File name of what it was built from; never a full path, which would tell of the person's machine."""
    psnr_db: float
    """Worst PSNR of the compressed field over the captured lights, each against its own frame."""
    gamma: str = "srgb"
    display_gain: Annotated[float, Field(gt=0, le=100)] = 1.0
    """What pictures are multiplied by to be shown, where the captured frames are not in units of a white wall."""
    over_black: bool = False
    """Whether the captured frames hold the person over black: then their colours carry the matte as a factor."""
    created_by: str
    created_at: str


@dataclass(frozen=True)
class Subject:
    """A person who can be relit.

    The field is R[p, c, l] = Σ_k basis[c, k, p] · coefficients[k, l].

    Attributes:
        metadata: the file's header.
        basis: (3, components, height, width) float16; like all arrays memory-mapped when it comes from a file.
        coefficients: (components, 2048) float32.
        light_directions: (lights, 3) float32 unit vectors, the captured directions.
        light_coefficients: (components, lights) float32: the captured frames in the same basis.
        matte: (height, width) float32 straight alpha.
        neutral: (height, width, 3) uint8 sRGB, the face under soft light from the front: what trackers look at.
        landmarks: points (count, 2) on `neutral` for each landmark scheme that is known.
        normals: (height, width, 3) float32 unit vectors, or None where the method gives none.
        albedo: (height, width, 3) float32 linear, or None.
        depth: (height, width) float32 centimetres toward the camera, or None.
    """

    metadata: SubjectMetadata
    basis: NDArray[np.float16]
    coefficients: NDArray[np.float32]
    light_directions: NDArray[np.float32]
    light_coefficients: NDArray[np.float32]
    matte: Mask
    neutral: DisplayImage
    landmarks: Mapping[str, Points] = field(default_factory=dict)
    normals: NDArray[np.float32] | None = None
    albedo: NDArray[np.float32] | None = None
    depth: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        """Check every shape against the header.

        Raises:
            ValueError: one does not fit; the message has both shapes.
        """
        meta = self.metadata
        picture = (meta.height, meta.width)
        expected: dict[str, tuple[NDArray | None, tuple[int, ...]]] = {
            "basis": (self.basis, (3, meta.components, *picture)),
            "coefficients": (self.coefficients, (meta.components, TEXELS)),
            "light_directions": (self.light_directions, (meta.lights, 3)),
            "light_coefficients": (self.light_coefficients, (meta.components, meta.lights)),
            "matte": (self.matte, picture),
            "neutral": (self.neutral, (*picture, 3)),
            "normals": (self.normals, (*picture, 3)),
            "albedo": (self.albedo, (*picture, 3)),
            "depth": (self.depth, picture),
        }
        for name, (array, shape) in expected.items():
            if array is not None and array.shape != shape:
                raise ValueError(f"{name} has shape {array.shape}, not {shape}")
        for scheme, points in self.landmarks.items():
            if points.ndim != 2 or points.shape[1] != 2:
                raise ValueError(f"landmarks of {scheme} have shape {points.shape}, not (count, 2)")

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.metadata.width, self.metadata.height
