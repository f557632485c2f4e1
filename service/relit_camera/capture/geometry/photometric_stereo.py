"""Photometric stereo: normals and albedo from pictures under one light at a time, robust to shadows and highlights.

Lambert's law for one pixel under distant lights l of unit irradiance is I = ρ·max(0, n·l): three unknowns, ρ·n, and as
many equations as lights (Woodham 1980). Some do not hold: light blocked by another part of the face, highlights,
light that the skin around reflects. Iteratively reweighted least squares gives those little weight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array
from relit_camera.base.concurrency.threads import worker_pool
from relit_camera.base.images.color import luminance
from relit_camera.base.images.image_types import LinearImage, Mask

BLOCK = 1 << 12
"""Pixels solved at a time: 1 MB an array at 64 lights, which stays in the cache."""


@dataclass(frozen=True)
class PhotometricStereoTunables:
    """Constants of the robust fit, chosen by `relit evaluate olat` and `relit evaluate field` (docs/reflectance.md).

    Attributes:
        iterations: of reweighting.
        unit_percentile: of a pixel's values over the lights; that value, below its highlights, is the pixel's unit.
        shadow: value in that unit below which an observation has no weight at first.
        lit: value in that unit above which it has full weight at first.
        spread: least residual, in the pixel's unit, at which an observation has half its weight: what strobes vary by,
            and what skin deviates from Lambert's law.
        grazing_cosine: cosine below which a light has less weight: there indirect light and errors of direction weigh
            most.
        noise: of a picture, as a fraction of the bright values of all pictures: a step of 8 bits.
        half_confidence_deg: expected error of a normal whose confidence is one half.
        oblique_cosine: cosine below which a light tells nothing about what blocks it.
    """

    iterations: int = 10
    unit_percentile: float = 90.0
    shadow: float = 0.05
    lit: float = 0.25
    spread: float = 0.05
    grazing_cosine: float = 0.3
    noise: float = 0.004
    half_confidence_deg: float = 8.0
    oblique_cosine: float = 0.15


TUNABLES = PhotometricStereoTunables()


@dataclass(frozen=True)
class PhotometricStereoResult:
    """Normals and albedo of every pixel, fitted independently of its neighbours.

    Attributes:
        normals: (height, width, 3) float32 unit vectors; (0, 0, 1) where nothing is known.
        albedo: (height, width, 3) float32 linear reflectance, 1 for a white wall.
        confidence: (height, width) float32, 0 unknown to 1 certain, by the expected error of the normal.
        lit: (lights, height, width) float16, measured light as a fraction 0..1 of what the normal predicts; NaN where
            the light is behind the surface or nearly so.
    """

    normals: Float32Array
    albedo: LinearImage
    confidence: Mask
    lit: NDArray[np.float16]


def photometric_stereo(pictures: Float32Array, directions: NDArray[np.float64], matte: Mask) -> PhotometricStereoResult:
    """Fit Lambert's law to every pixel of the matte.

    Args:
        pictures: (lights, height, width, 3) linear, each under a distant light of unit irradiance.
        directions: (lights, 3) unit vectors; they may all come from the front.
        matte: (height, width); pixels where it is 0 are left out.
    """
    lights, height, width, _ = pictures.shape
    inside = np.flatnonzero(matte.ravel() > 0)
    flat = pictures.reshape(lights, -1, 3)
    toward = directions.astype(np.float32)
    normals = np.tile(np.array([0, 0, 1], np.float32), (height * width, 1))
    albedo = np.zeros((height * width, 3), np.float32)
    confidence = np.zeros(height * width, np.float32)
    lit = np.full((lights, height * width), np.nan, np.float16)
    noise = TUNABLES.noise * float(np.percentile(luminance(flat[:, inside[:: max(1, len(inside) // 4096)]]), 99))

    def solve(block: NDArray[np.intp]) -> None:
        colors = flat[:, block]
        values = np.ascontiguousarray(luminance(colors).T)
        scaled, weights, error_deg = _fit(values, toward, noise)
        length = np.linalg.norm(scaled, axis=1, keepdims=True)
        known = length[:, 0] > 0
        normals[block[known]] = scaled[known] / length[known]
        confidence[block] = np.where(known, 1 / (1 + (error_deg / TUNABLES.half_confidence_deg) ** 2), 0)
        cosine = np.maximum(normals[block] @ toward.T, 0)
        fractions = weights * cosine
        albedo[block] = (
            np.einsum("pl,lpc->pc", fractions, colors)
            / np.maximum(np.einsum("pl,pl->p", fractions, cosine), 1e-6)[:, None]
        )
        arrived = np.clip(values / np.maximum(length * cosine, 1e-6), 0, 1)
        arrived[(cosine < TUNABLES.oblique_cosine) | ~known[:, None]] = np.nan
        lit[:, block] = arrived.T

    with worker_pool() as pool:
        # Consuming the results raises what a worker raised.
        list(pool.map(solve, (inside[start : start + BLOCK] for start in range(0, len(inside), BLOCK))))
    return PhotometricStereoResult(
        normals.reshape(height, width, 3),
        albedo.reshape(height, width, 3),
        confidence.reshape(height, width),
        lit.reshape(lights, height, width),
    )


def _fit(values: Float32Array, toward: Float32Array, noise: float) -> tuple[Float32Array, Float32Array, Float32Array]:
    """ρ·n (pixels, 3) fitted to values (pixels, lights), the final weights, and the expected error in degrees."""
    unit = np.percentile(values, TUNABLES.unit_percentile, axis=1, keepdims=True).astype(np.float32)
    values = np.asarray(values / np.maximum(unit, 1e-9), np.float32)
    spread = np.hypot(TUNABLES.spread, noise / np.maximum(unit, 1e-9))
    brightness = np.clip((values - TUNABLES.shadow) / (TUNABLES.lit - TUNABLES.shadow), 0, 1)
    weights = brightness
    for _ in range(TUNABLES.iterations):
        scaled, _ = _solve(weights, values, toward)
        predicted = np.maximum(scaled @ toward.T, 0)
        residual = np.abs(values - predicted)
        typical = np.einsum("pl,pl->p", weights, residual) / np.maximum(weights.sum(axis=1), 1e-6)
        scale = np.maximum(spread, typical[:, None])
        length = np.linalg.norm(scaled, axis=1, keepdims=True)
        facing = np.clip(predicted / np.maximum(TUNABLES.grazing_cosine * length, 1e-9), 0, 1)
        weights = facing * np.minimum(brightness * 2, 1) / (1 + (residual / scale) ** 2)
    scaled, inverse = _solve(weights, values, toward)
    misfit = np.sqrt(np.einsum("pl,pl->p", weights, residual**2) / np.maximum(weights.sum(axis=1), 1e-6))
    across = np.sqrt(np.trace(inverse, axis1=1, axis2=2)) / np.maximum(np.linalg.norm(scaled, axis=1), 1e-6)
    error_deg = np.degrees(np.maximum(misfit, spread[:, 0]) * across)
    dark = unit[:, 0] <= 1e-9
    scaled[dark] = 0
    return (scaled * unit).astype(np.float32), weights, error_deg.astype(np.float32)


def _solve(weights: Float32Array, values: Float32Array, toward: Float32Array) -> tuple[Float32Array, Float32Array]:
    """Weighted least squares of ρ·n (pixels, 3), and the inverse (pixels, 3, 3) of its normal matrix."""
    products = (toward[:, :, None] * toward[:, None, :]).reshape(-1, 9)
    # A small multiple of the unit matrix, so that pixels with fewer than three lights have a (poor) solution.
    normal_matrix = (weights @ products).reshape(-1, 3, 3) + np.float32(1e-3) * np.eye(3, dtype=np.float32)
    inverse = np.linalg.inv(normal_matrix)
    return np.einsum("pij,pj->pi", inverse, (weights * values) @ toward), inverse
