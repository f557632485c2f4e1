"""The subject: one person's compressed reflectance field with its matte, geometry, landmarks and header."""

from __future__ import annotations

import mmap
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from relit_camera.base.config.look import ANYONE
from relit_camera.base.images.image_types import DisplayImage, Mask, Points
from relit_camera.subject.compression.local_basis import LocalBasis
from relit_camera.subject.expression_stills import ExpressionStill
from relit_camera.subject.measured_light import measured_texels
from relit_camera.subject.reflectance_field import TEXELS
from relit_camera.subject.rungs import Rung

FORMAT_VERSION: Literal[2] = 2
MIN_SIDE_PX, MAX_SIDE_PX = 8, 8192
"""Least and largest side of a subject's picture, in pixels."""
HORIZON_STEP_RAD = np.pi / 255
"""Step of the quantized horizons: code v of 0..255 is the height v · HORIZON_STEP_RAD − π/2, in radians."""


class SubjectMetadata(BaseModel):
    """The header of a subject file."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    format_version: Literal[1, 2] = FORMAT_VERSION
    """1: one set of principal pictures for all pixels, in packed subjects; 2: local bases."""
    width: Annotated[int, Field(ge=MIN_SIDE_PX, le=MAX_SIDE_PX)]
    height: Annotated[int, Field(ge=MIN_SIDE_PX, le=MAX_SIDE_PX)]
    light_map: tuple[int, int] = (64, 32)
    """Width and height of the light maps that light it."""
    method: str
    """Name of the reflectance method that built the field."""
    lights: Annotated[int, Field(ge=1)]
    components: Annotated[int, Field(ge=1)]
    source: str
    """File name of what it was built from; never a full path, which would reveal the person's folders."""
    psnr_db: float
    """Worst PSNR of the compressed field over the captured lights, each against its own frame."""
    texel_psnr_db: float | None = None
    """Worst PSNR over the texels of a light map, each alone, against the field before compression."""
    map_psnr_db: float | None = None
    """The same under the built-in environments."""
    bytes_share: float | None = None
    """Bytes of the compressed field over those of its dense float32 matrix."""
    gamma: str = "srgb"
    display_gain: Annotated[float, Field(gt=0, le=100)] = 1.0
    """Factor from pictures to displayed values, where the captured frames are not in units of a white wall."""
    over_black: bool = False
    """Whether the captured frames show the person over black: their colors then have the matte as a factor."""
    rung: Rung | None = None
    """How it was captured; None in files that older versions wrote."""
    expected_db: float | None = None
    """Mean PSNR under environments that subjects of this rung reach on people whose truth is known."""
    measured_fraction: Annotated[float, Field(ge=0, le=1)] | None = None
    """Share of the sphere of light directions from which light was measured; from the rest it is modelled."""
    created_by: str
    created_at: str


@dataclass(frozen=True)
class Subject:
    """One person's compressed field and what belongs to it.

    The field is R[p, c, l] = Σ_g row[p, c, g] · coefficients[g, l], with the rows of `basis`.

    Attributes:
        metadata: the file's header.
        basis: the rows; like all arrays memory-mapped when it comes from a file.
        coefficients: (components, 2048) float32.
        light_directions: (lights, 3) float32 unit vectors, the captured directions.
        light_coefficients: (components, lights) float32: the captured frames in the same basis.
        matte: (height, width) float32 straight alpha.
        neutral: (height, width, 3) uint8 sRGB, the face under soft light from the front, for trackers.
        landmarks: points (count, 2) on `neutral` for each landmark scheme that is known.
        normals: (height, width, 3) float16 unit vectors, (0, 0, 1) outside of the matte; or None.
        albedo: (height, width, 3) float16 linear, 0 outside; or None.
        depth: (height, width) float32 in pixels toward the camera, mean 0, 0 outside; or None.
        horizons: (height, width, sectors) uint8, heights of the horizons (`capture.geometry.horizon_map`), in
            steps of `HORIZON_STEP_RAD`; or None.
        stills: of expressions and turns that the source image does not show; may be none.
    """

    metadata: SubjectMetadata
    basis: LocalBasis
    coefficients: NDArray[np.float32]
    light_directions: NDArray[np.float32]
    light_coefficients: NDArray[np.float32]
    matte: Mask
    neutral: DisplayImage
    landmarks: Mapping[str, Points] = field(default_factory=dict)
    normals: NDArray[np.float16] | NDArray[np.float32] | None = None
    albedo: NDArray[np.float16] | NDArray[np.float32] | None = None
    depth: NDArray[np.float32] | None = None
    horizons: NDArray[np.uint8] | None = None
    stills: tuple[ExpressionStill, ...] = ()

    def __post_init__(self) -> None:
        """Check every shape against the header.

        Raises:
            ValueError: one does not fit; the message has both shapes.
        """
        meta = self.metadata
        picture = (meta.height, meta.width)
        expected: dict[str, tuple[NDArray | None, tuple[int, ...]]] = {
            "coefficients": (self.coefficients, (meta.components, TEXELS)),
            "light_directions": (self.light_directions, (meta.lights, 3)),
            "light_coefficients": (self.light_coefficients, (meta.components, meta.lights)),
            "matte": (self.matte, picture),
            "neutral": (self.neutral, (*picture, 3)),
            "normals": (self.normals, (*picture, 3)),
            "albedo": (self.albedo, (*picture, 3)),
            "depth": (self.depth, picture),
            "horizons": (self.horizons, (*picture, 0 if self.horizons is None else self.horizons.shape[-1])),
        }
        if self.basis.components != meta.components:
            raise ValueError(f"the basis has {self.basis.components} components, not {meta.components}")
        if self.basis.pixels.max(initial=-1) >= meta.width * meta.height:
            raise ValueError(f"the basis has pixels beyond {meta.width}x{meta.height}")
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

    @cached_property
    def measured_texels(self) -> NDArray[np.bool_]:
        """Which texels (32, 64) of a light map lie in measured directions."""
        return measured_texels(self.light_directions)

    @property
    def is_anyone(self) -> bool:
        """Whether it is the head that stands for anybody of whom nothing is known (`capture.instant.anyone`)."""
        return self.metadata.method == ANYONE

    def drop_pages(self) -> None:
        """Give back the memory of what was read of the mapped file; the system reads it again where it is needed."""
        for array in (self.coefficients, self.basis.values):
            owner: object = array
            while isinstance(owner, np.ndarray):
                owner = owner.base
            if isinstance(owner, mmap.mmap) and hasattr(mmap, "MADV_DONTNEED"):
                owner.madvise(mmap.MADV_DONTNEED)

    def pictures(self, amounts: NDArray[np.float32]) -> NDArray[np.float32]:
        """The linear pictures (count, height, width, 3) of amounts (components, count) of the shared basis."""
        meta = self.metadata
        return self.basis.at(amounts, np.arange(meta.height * meta.width)).reshape(-1, meta.height, meta.width, 3)
