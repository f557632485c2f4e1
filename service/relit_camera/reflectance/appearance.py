"""How a pixel looks under one light, by its normal and its horizon: a few terms, fitted to the pixel's own pictures.

Diffuse, wrapped diffuse and two highlights, all behind the horizon, and what is left in the dark: light that comes
from other parts of the person. Each is a law that goes on where no light was captured: highlights grow toward grazing
light from behind, as on every real surface, and light from the surroundings ends where none of them that can be seen
is lit. No amount is negative, so a fit that has little to go by stays sane.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.geometry.geometry import Geometry

Floats = NDArray[np.float32]

TERMS = 5
WRAP = 0.5
"""How far past the terminator wrapped light reaches, as a cosine: light that travels below the skin."""
GLOSS, SHINE = 12.0, 60.0
"""Blinn's exponents: of skin's sheen, of what is wet or oily."""
MIRROR = 0.04
"""Reflectance of skin, hair and cloth seen straight on (refractive index 1.5)."""
GRAZING = 0.3
"""Cosine of half the angle from light to camera below which highlights grow no more: no model is sure there."""
ONSET = 0.1
"""Cosine over which a pixel that turns to the light becomes a lit one."""
PENUMBRA = 0.06
"""Radians of margin over the horizon in which visibility grows from a quarter to three: what horizons are off by."""
ROUNDS = 3
"""Of reweighting."""
TOLERANCE, FLOOR = 0.16, 0.02
"""A picture that is off by this share of the pixel's bright values, and this share of what is bright, counts half."""
SWEEPS = 30
"""Of coordinate descent."""
RIDGE = 1e-3


def appearance_terms(cosines: Floats, half_cosines: Floats, margins: Floats, toward_camera: Floats) -> Floats:
    """The terms (count, pixels, TERMS) of lights at pixels.

    Highlights are Blinn's lobes (1977) with Schlick's Fresnel factor (1994) and the geometry of Kelemen and
    Szirmay-Kalos (2001); light of the surroundings has the phase function of a white Lambertian ball.

    Args:
        cosines: (count, pixels) of normal and light.
        half_cosines: (count, pixels) of normal and the direction halfway from light to camera.
        margins: (count, pixels) radians of the light above the pixel's horizon.
        toward_camera: (count, 1) or (count, pixels) cosine of light and camera.
    """
    visible = _visible(margins)
    lit = visible * np.maximum(cosines, 0)
    half_way = np.sqrt(np.clip((1 + toward_camera) / 2, 0, 1))
    fresnel = 1 + (1 / MIRROR - 1) * (1 - half_way) ** 5
    highlight = lit * fresnel / np.maximum(half_way, GRAZING) ** 2
    halves = np.maximum(half_cosines, 0)
    angle = np.arccos(np.clip(toward_camera, -1, 1))
    terms = np.empty((*cosines.shape, TERMS), np.float32)
    terms[..., 0] = lit
    terms[..., 1] = visible * np.maximum((cosines + WRAP) / (1 + WRAP), 0) ** 2
    terms[..., 2] = highlight * halves**GLOSS
    terms[..., 3] = highlight * halves**SHINE
    terms[..., 4] = (np.sin(angle) + (np.pi - angle) * np.cos(angle)) / np.pi
    return terms


def half_directions(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Halfway (count, 3) between unit vectors (count, 3) toward lights and the one toward the camera."""
    halves = directions + np.array([0.0, 0.0, 1.0])
    # A light straight behind the person has none; it is hidden anyway.
    return np.asarray(halves / np.maximum(np.linalg.norm(halves, axis=1, keepdims=True), 1e-6))


def distant_terms(geometry: Geometry, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Floats:
    """The terms (count, pixels, TERMS) of distant lights (count, 3) at row-major pixels (some,) of a shape."""
    return appearance_terms(
        geometry.cosines(directions, pixels).T,
        geometry.cosines(half_directions(directions), pixels).T,
        geometry.horizon.margins(directions, pixels).T,
        directions[:, 2:].astype(np.float32),
    )


def lit_shares(geometry: Geometry, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Floats:
    """How far distant lights (count, 3) reach row-major pixels (some,) directly: (count, some), 0 in shadow, 1 lit."""
    facing = np.clip(geometry.cosines(directions, pixels).T / ONSET, 0, 1)
    return np.asarray(_visible(geometry.horizon.margins(directions, pixels).T) * facing)


def _visible(margins: Floats) -> Floats:
    return np.asarray(1 / (1 + np.exp(np.clip(margins / -PENUMBRA, -30, 30))), np.float32)


def fit_appearance(terms: Floats, values: Floats, bright: float) -> Floats:
    """How much of each term: non-negative least squares, iteratively reweighted against what no term explains.

    Args:
        terms: (lights, pixels, TERMS).
        values: (lights, pixels, channels) linear.
        bright: what counts as bright in all the pictures: one value.

    Returns:
        (pixels, TERMS, channels) float32.
    """
    brightness = values.mean(axis=2)
    tolerance = TOLERANCE * np.percentile(brightness, 90, axis=0) + FLOOR * bright + 1e-9
    weights = np.ones_like(brightness)
    by_pixel = np.ascontiguousarray(terms.transpose(1, 0, 2))
    seen = np.ascontiguousarray(values.transpose(1, 0, 2))
    amounts = np.zeros((values.shape[1], TERMS, values.shape[2]), np.float32)
    for _ in range(ROUNDS):
        weighed = (by_pixel * weights.T[..., None]).transpose(0, 2, 1)
        amounts = _non_negative(weighed @ by_pixel, weighed @ seen)
        off = brightness - (by_pixel @ amounts.mean(axis=2)[..., None])[..., 0].T
        weights = (1 / (1 + (off / tolerance) ** 2)).astype(np.float32)
    return amounts


def _non_negative(products: Floats, projections: Floats) -> Floats:
    """Least squares with no amount below 0, all pixels at once, by coordinate descent.

    Args:
        products: (pixels, terms, terms) of terms with terms.
        projections: (pixels, terms, channels) of terms with values.
    """
    count = products.shape[1]
    ridge = RIDGE * np.trace(products, axis1=1, axis2=2) / count + 1e-12
    products = products + ridge[:, None, None] * np.eye(count, dtype=np.float32)
    amounts = np.zeros_like(projections)
    for _ in range(SWEEPS):
        for term in range(count):
            rest = projections[:, term] - np.einsum("pt,ptc->pc", products[:, term], amounts)
            amounts[:, term] = np.maximum(amounts[:, term] + rest / products[:, term, term, None], 0)
    return amounts
