"""How a generic head of known skin answers light: its reflectance field, without a picture of it under any lamp.

The field is R[p, c, l] = albedo[p, c] · D[p, l] + gloss[p] · G[p, l]: what is diffuse, wrapped or reflected by the
surroundings has the color of the pixel, what is glossy that of the light. D and G follow from the shape alone and are
known at half the picture's resolution; albedo and gloss are its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from relit_camera.base.array_types import Float32Array, Indices
from relit_camera.base.concurrency.threads import worker_pool
from relit_camera.base.images.image_types import LinearImage, Mask
from relit_camera.capture.geometry.shape_estimation import Geometry
from relit_camera.capture.reflectance import appearance_model
from relit_camera.capture.reflectance.appearance_model import appearance_terms, half_vectors
from relit_camera.subject.reflectance_field import TEXELS, texel_vectors

BLOCK = 512
"""Pixels whose terms are computed at a time."""


@dataclass(frozen=True)
class GenericAmounts:
    """Amounts of the appearance model's terms, means of fits to captured people.

    Attributes:
        diffuse, wrap, surroundings: those that have the color of the pixel, in units of its albedo.
        sheen, shine: the glossy ones, of skin.
        body_gloss: gloss of hair and clothes, where skin has 1.
        penumbra_rad: scale over which a shadow's edge is spread: about the error of a generic head's horizons.
        vague_diffuse, vague_wrap: those of a surface of which only the side is known that it lies on, as of hair: the
            mean over what its normals may be. It has no horizon.
    """

    diffuse: float = 0.95
    wrap: float = 0.08
    surroundings: float = 0.02
    sheen: float = 0.010
    shine: float = 0.025
    body_gloss: float = 0.5
    penumbra_rad: float = 0.15
    vague_diffuse: float = 0.3
    vague_wrap: float = 0.6


AMOUNTS = GenericAmounts()
HIDDEN_BY_NOTHING = np.float32(2.0)
"""Radians by which lights are raised above the horizon of a vague surface."""


def gloss_amounts(face: NDArray[np.bool_], blur_px: float) -> Mask:
    """Amount of gloss (height, width): 1 on the face (height, width), less elsewhere, the edge blurred."""
    gloss = np.where(face, 1.0, AMOUNTS.body_gloss).astype(np.float32)
    return np.asarray(cv2.GaussianBlur(gloss, (0, 0), blur_px), np.float32)


@dataclass(frozen=True)
class ShapeResponse:
    """The part of the field that follows from the shape.

    Attributes:
        size: height and width of the pixels below, half of the picture's.
        pixels: (some,) row-major pixels that have a response, the person's and a margin.
        diffuse: (some, 2048) float32, D.
        glossy: (some, 2048) float32, G.
    """

    size: tuple[int, int]
    pixels: Indices
    diffuse: Float32Array
    glossy: Float32Array

    @cached_property
    def interpolation(self) -> csr_array:
        """Bilinear weights (pixels of the whole resolution, some); rows sum to 1 where a neighbor has a response."""
        height, width = self.size
        number = np.full(height * width, -1)
        number[self.pixels] = np.arange(len(self.pixels))
        rows, columns = (each.ravel() for each in np.mgrid[: 2 * height, : 2 * width])
        found = []
        for row, row_share in _neighbors(rows, height):
            for column, column_share in _neighbors(columns, width):
                found.append((number[row * width + column], row_share * column_share))
        corner, share = (np.stack(each, axis=1) for each in zip(*found, strict=True))
        share = np.where(corner >= 0, share, 0)
        share /= np.maximum(share.sum(axis=1, keepdims=True), 1e-9)
        whole = np.repeat(np.arange(len(share)), share.shape[1])
        entries = share.ravel().astype(np.float32), (whole, np.maximum(corner, 0).ravel())
        weights = csr_array(entries, shape=(len(share), len(self.pixels)))
        weights.eliminate_zeros()
        return weights

    def spread(self, values: Float32Array, pixels: NDArray[np.integer] | slice = slice(None)) -> Float32Array:
        """Values (some, channels) at row-major pixels of the whole resolution: (pixels, channels)."""
        return np.asarray(self.interpolation[pixels] @ values, np.float32)


def _neighbors(index: Indices, count: int) -> Iterator[tuple[Indices, NDArray[np.float64]]]:
    """The two pixels of half the resolution next to pixels `index`, no further than the last, and their shares."""
    position = (index + 0.5) / 2 - 0.5
    lower = np.floor(position).astype(np.intp)
    for neighbor, share in ((lower, lower + 1 - position), (lower + 1, position - lower)):
        yield np.clip(neighbor, 0, count - 1), share


def shape_response(geometry: Geometry, certainty: Mask, matte: Mask) -> ShapeResponse:
    """The response of a shape at half the picture's resolution, for the pixels of the matte and their neighbors.

    Args:
        geometry: of the shape.
        certainty: (height, width) from 1, where it is that of a face, to 0, where it is vague.
        matte: (height, width) of the person.
    """
    pixels = np.flatnonzero(cv2.dilate((matte > 0).astype(np.uint8), np.ones((3, 3))))
    directions = texel_vectors()
    halves, toward = half_vectors(directions), directions[:, 2].astype(np.float32)
    softer = np.float32(appearance_model.TUNABLES.penumbra_rad / AMOUNTS.penumbra_rad)
    diffuse, glossy = np.empty((2, len(pixels), TEXELS), np.float32)
    sure = certainty.ravel()

    def fill(start: int) -> None:
        block = pixels[start : start + BLOCK]
        terms = appearance_terms(
            geometry.cosines(directions, block),
            geometry.cosines(halves, block),
            geometry.horizon.margins(directions, block) * softer + (HIDDEN_BY_NOTHING * (1 - sure[block]))[:, None],
            toward,
        )
        known = sure[block][:, None]
        part = slice(start, start + len(block))
        diffuse[part] = (
            (AMOUNTS.vague_diffuse + (AMOUNTS.diffuse - AMOUNTS.vague_diffuse) * known) * terms[:, 0]
            + (AMOUNTS.vague_wrap + (AMOUNTS.wrap - AMOUNTS.vague_wrap) * known) * terms[:, 1]
            + AMOUNTS.surroundings * terms[:, 4]
        )
        glossy[part] = AMOUNTS.sheen * terms[:, 2] + AMOUNTS.shine * terms[:, 3]

    with worker_pool() as pool:
        # Consuming the results raises what a worker raised.
        list(pool.map(fill, range(0, len(pixels), BLOCK)))
    return ShapeResponse(matte.shape, pixels, diffuse, glossy)


@dataclass(frozen=True)
class GenericField:
    """The field of a head, see the module.

    Attributes:
        response: of its shape.
        albedo: (height, width, 3) float32.
        gloss: (height, width) float32, 1 for the gloss of skin.
    """

    response: ShapeResponse
    albedo: LinearImage
    gloss: Mask

    @property
    def size(self) -> tuple[int, int]:
        """Height and width in pixels."""
        return self.albedo.shape[0], self.albedo.shape[1]

    def pictures(self, light: NDArray[np.float32]) -> Float32Array:
        """Linear pictures (count, height, width, 3) under lights (count, 2048, 3), radiance times solid angle."""
        found = np.empty((len(light), *self.size, 3), np.float32)
        for picture, each in zip(found, light, strict=True):
            picture[:] = self._picture(each)
        return found

    def _picture(self, light: Float32Array) -> Float32Array:
        response = self.response
        seen = response.spread(np.concatenate([response.diffuse @ light, response.glossy @ light], axis=1))
        seen = seen.reshape(*self.size, 6)
        return np.asarray(self.albedo * seen[..., :3] + self.gloss[..., None] * seen[..., 3:])

    def rows(self, pixels: NDArray[np.integer], texels: slice = slice(None)) -> Float32Array:
        """R of row-major pixels (some,) under a part of the texels: (some, texels, 3)."""
        diffuse, glossy = (
            self.response.spread(each[:, texels], pixels) for each in (self.response.diffuse, self.response.glossy)
        )
        albedo, gloss = self.albedo.reshape(-1, 3)[pixels], self.gloss.ravel()[pixels]
        return np.asarray(diffuse[..., None] * albedo[:, None] + (gloss[:, None] * glossy)[..., None], np.float32)

    def dense(self, start: int, stop: int) -> Float32Array:
        """R of the pixels [start, stop) in row-major order: (stop − start, 2048, 3)."""
        return self.rows(np.arange(start, stop))
