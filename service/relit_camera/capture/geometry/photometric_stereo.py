"""Normals and albedo from pictures under one light at a time, shadows and highlights left out.

Lambert's law for one pixel under distant lights l of unit irradiance is I = ρ·max(0, n·l): three unknowns, ρ·n, and as
many equations as lights (Woodham 1980). Some are false: light blocked by another part of the face, highlights, light
that comes from the skin around. They are found as what does not fit, by iteratively reweighted least squares.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import luminance
from relit_camera.base.images.image_types import LinearImage, Mask
from relit_camera.base.threads import worker_pool

Floats = NDArray[np.float32]

BLOCK = 1 << 12
"""Pixels solved at a time: 1 MB an array at 64 lights, which stays in the cache."""
ITERATIONS = 10

BRIGHT_PERCENTILE = 90.0
"""Of a pixel's values: its unit, below its highlights."""
SHADOW, LIT = 0.05, 0.25
"""In that unit: what is darker than the first counts for nothing at first, what is brighter than the other wholly."""
SPREAD = 0.05
"""Least residual, in the pixel's unit, that makes an equation count half: so strobes vary, and skin from the law."""
GRAZING = 0.3
"""Cosine below which a light counts less: there indirect light and errors of direction weigh most."""
QUANTUM = 0.004
"""Noise of a picture in the whole set's unit: a step of 8 bits."""
TRUSTED_DEG = 8.0
"""Expected error of a normal that is trusted by half."""
OBLIQUE = 0.15
"""Cosine below which a light says nothing about what blocks it."""


@dataclass(frozen=True)
class PhotometricStereoResult:
    """What photometric stereo finds, every pixel by itself.

    Attributes:
        normals: (height, width, 3) float32 unit vectors; (0, 0, 1) where nothing is known.
        albedo: (height, width, 3) float32 linear: what a white wall under the same light would have as 1.
        confidence: (height, width) float32, 0 unknown to 1 certain, by the error expected of the normal.
        lit: (lights, height, width) float16, share 0..1 of what the normal predicts that arrived; NaN where the light
            is behind the surface or nearly so.
    """

    normals: Floats
    albedo: LinearImage
    confidence: Mask
    lit: NDArray[np.float16]


def photometric_stereo(pictures: Floats, directions: NDArray[np.float64], matte: Mask) -> PhotometricStereoResult:
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
    noise = QUANTUM * float(np.percentile(luminance(flat[:, inside[:: max(1, len(inside) // 4096)]]), 99))

    def solve(block: NDArray[np.intp]) -> None:
        colours = flat[:, block]
        values = np.ascontiguousarray(luminance(colours).T)
        scaled, weights, error_deg = _fit(values, toward, noise)
        length = np.linalg.norm(scaled, axis=1, keepdims=True)
        known = length[:, 0] > 0
        normals[block[known]] = scaled[known] / length[known]
        confidence[block] = np.where(known, 1 / (1 + (error_deg / TRUSTED_DEG) ** 2), 0)
        cosine = np.maximum(normals[block] @ toward.T, 0)
        shares = weights * cosine
        albedo[block] = (
            np.einsum("pl,lpc->pc", shares, colours) / np.maximum(np.einsum("pl,pl->p", shares, cosine), 1e-6)[:, None]
        )
        arrived = np.clip(values / np.maximum(length * cosine, 1e-6), 0, 1)
        arrived[(cosine < OBLIQUE) | ~known[:, None]] = np.nan
        lit[:, block] = arrived.T

    with worker_pool() as pool:
        # Asked for, so that what goes wrong is raised.
        list(pool.map(solve, (inside[start : start + BLOCK] for start in range(0, len(inside), BLOCK))))
    return PhotometricStereoResult(
        normals.reshape(height, width, 3),
        albedo.reshape(height, width, 3),
        confidence.reshape(height, width),
        lit.reshape(lights, height, width),
    )


def _fit(values: Floats, toward: Floats, noise: float) -> tuple[Floats, Floats, Floats]:
    """ρ·n (pixels, 3) of values (pixels, lights), the weights used, and the normals' expected error (pixels,) in °."""
    unit = np.percentile(values, BRIGHT_PERCENTILE, axis=1, keepdims=True).astype(np.float32)
    values = np.asarray(values / np.maximum(unit, 1e-9), np.float32)
    spread = np.hypot(SPREAD, noise / np.maximum(unit, 1e-9))
    brightness = np.clip((values - SHADOW) / (LIT - SHADOW), 0, 1)
    weights = brightness
    for _ in range(ITERATIONS):
        scaled, _ = _solve(weights, values, toward)
        predicted = np.maximum(scaled @ toward.T, 0)
        residual = np.abs(values - predicted)
        typical = np.einsum("pl,pl->p", weights, residual) / np.maximum(weights.sum(axis=1), 1e-6)
        scale = np.maximum(spread, typical[:, None])
        length = np.linalg.norm(scaled, axis=1, keepdims=True)
        facing = np.clip(predicted / np.maximum(GRAZING * length, 1e-9), 0, 1)
        weights = facing * np.minimum(brightness * 2, 1) / (1 + (residual / scale) ** 2)
    scaled, inverse = _solve(weights, values, toward)
    misfit = np.sqrt(np.einsum("pl,pl->p", weights, residual**2) / np.maximum(weights.sum(axis=1), 1e-6))
    across = np.sqrt(np.trace(inverse, axis1=1, axis2=2)) / np.maximum(np.linalg.norm(scaled, axis=1), 1e-6)
    error_deg = np.degrees(np.maximum(misfit, spread[:, 0]) * across)
    dark = unit[:, 0] <= 1e-9
    scaled[dark] = 0
    return (scaled * unit).astype(np.float32), weights, error_deg.astype(np.float32)


def _solve(weights: Floats, values: Floats, toward: Floats) -> tuple[Floats, Floats]:
    """Weighted least squares of ρ·n (pixels, 3), and the inverse (pixels, 3, 3) of its normal matrix."""
    products = (toward[:, :, None] * toward[:, None, :]).reshape(-1, 9)
    # A trace of a unit matrix, so that pixels with fewer than three lights have a solution, one of little worth.
    normal_matrix = (weights @ products).reshape(-1, 3, 3) + np.float32(1e-3) * np.eye(3, dtype=np.float32)
    inverse = np.linalg.inv(normal_matrix)
    return np.einsum("pij,pj->pi", inverse, (weights * values) @ toward), inverse
