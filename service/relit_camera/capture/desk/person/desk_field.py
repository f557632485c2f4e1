"""The field of a desk capture: the appearance model, held where frontal light tells little.

All lights come from before the face. So what they do not show is tied to what they do: wrapped and surrounding light
to the diffuse color, highlights to those of skin, horizons and uncertain normals to the generic head's.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array
from relit_camera.base.concurrency.threads import worker_pool
from relit_camera.base.images.color import luminance
from relit_camera.base.images.image_types import Mask
from relit_camera.capture.desk.person.generic_head import GenericHead
from relit_camera.capture.geometry.horizon_map import HorizonMap
from relit_camera.capture.geometry.shape_estimation import Geometry
from relit_camera.capture.reflectance.appearance_model import (
    TERM_COUNT,
    SpecularEstimate,
    distant_terms,
    fit_appearance,
)
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.subject.reflectance_field import texel_vectors

_BLOCK = 512
"""Pixels at a time: 20 MB of terms for a light map."""


@dataclass(frozen=True)
class DeskFieldTunables:
    """What frontal light leaves open, from a study of frontal captures of a rendered head and two real faces.

    Attributes:
        wrap, surroundings: amounts of these terms, relative to the diffuse one.
        skin_sheen, skin_shine: expected amounts of the specular terms on skin, a white wall having 1.
        rough: the same elsewhere, relative to those on skin.
        specular_sureness: of these amounts: how many bright observations they count as.
        sure_confidence: of a normal, from which it is kept as it is.
        chroma_distance: of a pixel's albedo from the face's, below which it is skin.
        min_skin_brightness: of its albedo, relative to the face's.
    """

    wrap: float = 0.2
    surroundings: float = 0.012
    skin_sheen: float = 0.02
    skin_shine: float = 0.05
    rough: float = 0.2
    specular_sureness: float = 30.0
    sure_confidence: float = 0.3
    chroma_distance: float = 0.06
    min_skin_brightness: float = 0.5


TUNABLES = DeskFieldTunables()


@dataclass(frozen=True)
class DeskField:
    """The field of a desk capture.

    Attributes:
        geometry: shape of the person.
        amounts: (pixels, 3, TERM_COUNT) of the appearance model's terms.
    """

    geometry: Geometry
    amounts: Float32Array

    @property
    def size(self) -> tuple[int, int]:
        """Height and width in pixels."""
        height, width = self.geometry.depth.shape
        return height, width

    def dense(self, start: int, stop: int) -> Float32Array:
        """R of the pixels [start, stop) in row-major order: (stop − start, 2048, 3)."""
        return self._evaluate(texel_vectors(), np.arange(start, stop)).transpose(0, 2, 1)

    def at(self, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Float32Array:
        """R of row-major pixels (some,) under unit vectors (count, 3): (count, some, 3)."""
        return self._evaluate(directions, pixels).transpose(2, 0, 1)

    def _evaluate(self, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Float32Array:
        result = np.empty((len(pixels), 3, len(directions)), np.float32)
        for start in range(0, len(pixels), _BLOCK):
            block = pixels[start : start + _BLOCK]
            result[start : start + _BLOCK] = self.amounts[block] @ distant_terms(self.geometry, directions, block)
        return result

    def scaled(self, gain: Float32Array) -> DeskField:
        """The field times a gain (height · width, 3) of each pixel and channel."""
        return replace(self, amounts=self.amounts * gain[..., None])


def hold_geometry(geometry: Geometry, head: GenericHead, uncertain: NDArray[np.bool_]) -> Geometry:
    """The geometry with uncertain normals drawn to the generic head's, and the mean of both horizons.

    Args:
        geometry: estimated from the pictures.
        head: generic head in the same picture.
        uncertain: (height, width) mask of places whose normals are unknown.
    """
    sure = np.clip(geometry.confidence / TUNABLES.sure_confidence, 0, 1)
    sure = np.where(uncertain, 0, sure)[..., None]
    normals = geometry.normals * sure + head.normals * (1 - sure)
    normals[head.matte <= 0] = (0, 0, 1)
    normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    heights = (geometry.horizon.heights.astype(np.float32) + head.horizon.heights.astype(np.float32)) / 2
    return replace(geometry, normals=normals.astype(np.float32), horizon=HorizonMap(heights.astype(np.float16)))


def skin_mask(albedo: Float32Array, face: NDArray[np.bool_]) -> Mask:
    """How much (height, width) of a pixel is skin, 0..1: the face, and what has its color and is bright enough."""
    reference = np.median(albedo[face], axis=0)
    chroma = albedo / np.maximum(albedo.sum(axis=-1, keepdims=True), 1e-3)
    near = np.linalg.norm(chroma - reference / max(reference.sum(), 1e-6), axis=-1) < TUNABLES.chroma_distance
    bright = albedo.mean(axis=-1) > TUNABLES.min_skin_brightness * reference.mean()
    return np.asarray(cv2.GaussianBlur(((near & bright) | face).astype(np.float32), (0, 0), 1.0), np.float32)


def certain_skin(skin: Mask, matte: Mask) -> NDArray[np.bool_]:
    """Mask (height, width) of what is skin for certain, and the person's alone."""
    return np.asarray((skin > 0.5) & (matte > 0.9))


def fit_desk_field(samples: OlatSamples, geometry: Geometry, skin: Mask, skin_luminance: float) -> DeskField:
    """The appearance model fitted to each pixel of the matte.

    Args:
        samples: pictures under distant lights.
        geometry: what light reaches a pixel.
        skin: (height, width) of `skin_mask`.
        skin_luminance: of bright skin, a white wall having 1. Skin of all tones mirrors alike, so highlights are
            expected to be strong beside dark skin, weak beside light skin.
    """
    inside = np.flatnonzero(samples.matte.ravel() > 0)
    flat = samples.pictures.reshape(len(samples.directions), -1, 3)
    some = np.flatnonzero(samples.matte.ravel() > 0.5)[::8]
    bright = float(np.percentile(flat[:, some], 99)) if len(some) else 1.0
    on_skin = np.array([TUNABLES.skin_sheen, TUNABLES.skin_shine], np.float32)
    amounts = np.zeros((samples.matte.size, 3, TERM_COUNT), np.float32)
    certain = certain_skin(skin, samples.matte)
    unit = np.float32(np.percentile(luminance(geometry.albedo)[certain], 75) / skin_luminance if certain.any() else 1)

    def fit(start: int) -> None:
        block = inside[start : start + _BLOCK]
        terms = distant_terms(geometry, samples.directions, block)
        terms[:, 0] += TUNABLES.wrap * terms[:, 1] + TUNABLES.surroundings * terms[:, 4]
        terms[:, 1] = terms[:, 4] = 0
        share = (TUNABLES.rough + (1 - TUNABLES.rough) * skin.ravel()[block])[:, None]
        expected = unit * on_skin * share
        precision = TUNABLES.specular_sureness / (unit * on_skin) ** 2
        prior = SpecularEstimate(expected, np.broadcast_to(precision, expected.shape).astype(np.float32))
        values = np.ascontiguousarray(flat[:, block].transpose(1, 2, 0))
        found, _ = fit_appearance(terms, values, bright, prior)
        found[..., 1] = TUNABLES.wrap * found[..., 0]
        found[..., 4] = TUNABLES.surroundings * found[..., 0]
        amounts[block] = found

    with worker_pool() as pool:
        # Consuming the results raises what a worker raised.
        list(pool.map(fit, range(0, len(inside), _BLOCK)))
    return DeskField(geometry, amounts)
