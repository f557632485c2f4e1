"""How a pixel looks under one light, by its normal and its horizon: a few terms, fitted to the pixel's own pictures.

Diffuse, wrapped diffuse and two highlights, all behind the horizon, and what is left in the dark: light that comes
from other parts of the person. Each is a law that goes on where no light was captured: highlights grow toward grazing
light from behind, as on every real surface, and light from the surroundings ends where none of them that can be seen
is lit. No amount is negative, so a fit that has little to go by stays sane.

What neighbours say of a pixel's highlights: a cheek's rim shows its own only under light that no capture has.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import Mask
from relit_camera.capture.geometry.shape_estimation import Geometry

Floats = NDArray[np.float32]

TERM_COUNT = 5
SPECULAR_TERMS = 2, 3
"""Which of the terms are highlights. They have the light's own colour: one amount for all channels."""
WRAP = 0.5
"""How far past the terminator wrapped light reaches, as a cosine: light that travels below the skin."""
NORMAL_INCIDENCE_REFLECTANCE = 0.028
"""Reflectance of skin seen straight on (refractive index 1.4; Tuchin 2007)."""
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
    """The terms (pixels, TERMS, count) of pixels under lights.

    Highlights are Blinn's lobes (1977) with Schlick's Fresnel factor (1994) and the geometry of Kelemen and
    Szirmay-Kalos (2001); light of the surroundings has the phase function of a white Lambertian ball.

    Args:
        cosines: (pixels, count) of normal and light.
        half_cosines: (pixels, count) of normal and the direction halfway from light to camera.
        margins: (pixels, count) radians of the light above the pixel's horizon.
        toward_camera: (count,) cosine of light and camera.
    """
    visible = _visible(margins)
    lit = visible * np.maximum(cosines, 0)
    half_way = np.sqrt(np.clip((1 + toward_camera) / 2, 0, 1))
    fresnel = 1 + (1 / NORMAL_INCIDENCE_REFLECTANCE - 1) * (1 - half_way) ** 5
    highlight = lit * (fresnel / np.maximum(half_way, GRAZING) ** 2)
    angle = np.arccos(np.clip(toward_camera, -1, 1))
    sheen, shine = _lobes(np.maximum(half_cosines, 0))
    terms = np.empty((len(cosines), TERM_COUNT, cosines.shape[1]), np.float32)
    terms[:, 0] = lit
    terms[:, 1] = visible * np.square(np.maximum((cosines + WRAP) / (1 + WRAP), 0))
    terms[:, 2] = highlight * sheen
    terms[:, 3] = highlight * shine
    terms[:, 4] = (np.sin(angle) + (np.pi - angle) * np.cos(angle)) / np.pi
    return terms


def _visible(margins: Floats) -> Floats:
    """How much of a light is seen, 0 to 1, at margins (pixels, count) over the horizon."""
    visible = margins / np.float32(-PENUMBRA)
    np.minimum(visible, 30, out=visible)
    np.exp(visible, out=visible)
    visible += 1
    return np.asarray(np.reciprocal(visible, out=visible))


def _lobes(cosines: Floats) -> tuple[Floats, Floats]:
    """Cosines to the powers 12, Blinn's exponent of skin's sheen, and 60, that of what is wet or oily.

    By multiplication: a power of any exponent takes many times as long.
    """
    fourth = np.square(np.square(cosines))
    sheen = fourth * np.square(fourth)
    return sheen, sheen * np.square(np.square(sheen))


def half_directions(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Halfway (count, 3) between unit vectors (count, 3) toward lights and the one toward the camera."""
    halves = directions + np.array([0.0, 0.0, 1.0])
    # A light straight behind the person has none; it is hidden anyway.
    return np.asarray(halves / np.maximum(np.linalg.norm(halves, axis=1, keepdims=True), 1e-6))


def distant_terms(geometry: Geometry, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Floats:
    """The terms (pixels, TERMS, count) of row-major pixels (some,) of a shape under distant lights (count, 3)."""
    return appearance_terms(
        geometry.cosines(directions, pixels),
        geometry.cosines(half_directions(directions), pixels),
        geometry.horizon.margins(directions, pixels),
        directions[:, 2].astype(np.float32),
    )


def direct_light_fractions(geometry: Geometry, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Floats:
    """How far distant lights (count, 3) reach row-major pixels (some,) directly: (some, count), 0 in shadow, 1 lit."""
    facing = np.clip(geometry.cosines(directions, pixels) / ONSET, 0, 1)
    return np.asarray(_visible(geometry.horizon.margins(directions, pixels)) * facing)


@dataclass(frozen=True)
class SpecularEstimate:
    """Highlights that are to be expected of pixels, or were found.

    Attributes:
        amounts: (pixels, len(LOBES)) float32.
        precision: (pixels, len(LOBES)) float32, how well the pictures tell each: the sum of weight · term² over the
            lights,
            over the variance of what no term explains.
    """

    amounts: Floats
    precision: Floats


def fit_appearance(
    terms: Floats, values: Floats, bright: float, expected: SpecularEstimate | None = None
) -> tuple[Floats, SpecularEstimate]:
    """How much of each term: non-negative least squares, iteratively reweighted against what no term explains.

    Args:
        terms: (pixels, TERMS, lights).
        values: (pixels, channels, lights) linear.
        bright: what counts as bright in all the pictures: one value.
        expected: highlights to fall back on as far as the pictures do not tell them; `precision` then says how surely.

    Returns:
        (pixels, channels, TERMS) float32: `amounts @ terms` are the values; and the highlights among them.
    """
    brightness = values.mean(axis=1)
    tolerance = TOLERANCE * np.percentile(brightness, 90, axis=1) + FLOOR * bright + 1e-9
    tolerance = tolerance.astype(np.float32)[:, None]
    weights = np.ones_like(brightness)
    amounts = np.zeros((len(values), values.shape[1], TERM_COUNT), np.float32)
    for _ in range(ROUNDS):
        weighed = (terms * weights[:, None]).transpose(0, 2, 1)
        products, projections = terms @ weighed, values @ weighed
        products += (
            RIDGE
            * np.trace(products, axis1=1, axis2=2)[:, None, None]
            / TERM_COUNT
            * np.eye(TERM_COUNT, dtype=np.float32)
        )
        precision = products[:, SPECULAR_TERMS, SPECULAR_TERMS] / tolerance**2
        if expected is not None:
            sure = expected.precision * tolerance**2
            products[:, SPECULAR_TERMS, SPECULAR_TERMS] += sure
            projections[:, :, SPECULAR_TERMS] += (sure * expected.amounts)[:, None]
        amounts = _non_negative(products, projections)
        off = brightness - (amounts.mean(axis=1, keepdims=True) @ terms)[:, 0]
        weights = 1 / (1 + np.square(off / tolerance))
    return amounts, SpecularEstimate(amounts[:, 0, SPECULAR_TERMS], precision)


def _non_negative(products: Floats, projections: Floats) -> Floats:
    """Least squares with no amount below 0, all pixels at once, by coordinate descent.

    Args:
        products: (pixels, terms, terms) of terms with terms.
        projections: (pixels, channels, terms) of values with terms.

    Returns:
        The amounts (pixels, channels, terms), of LOBES the same in all channels.
    """
    # Pixels last, for numpy's inner loops.
    products, projections = (np.ascontiguousarray(np.moveaxis(each, 0, -1)) for each in (products, projections))
    amounts = np.zeros_like(projections)
    for _ in range(SWEEPS):
        for term in range(len(products)):
            rest = projections[:, term] - (products[term] * amounts).sum(axis=1)
            best = amounts[:, term] + rest / (products[term, term] + np.float32(1e-12))
            amounts[:, term] = np.maximum(best.mean(axis=0) if term in SPECULAR_TERMS else best, 0)
    return np.ascontiguousarray(np.moveaxis(amounts, -1, 0))


REACH = 0.12
"""Standard deviation of a neighbour's say, as a share of the picture's larger side."""
BRIGHT = 90
"""Percentile of the person's amounts of a highlight by which one pixel is expected to differ from its neighbours."""
ALIKE = 10
"""Lights whose errors are alike, so that they count as one: they are neighbours, and the law holds only nearly."""
WHOLE = 1e-3
"""Weight of the whole person's mean beside the neighbours'."""


def specular_prior(found: SpecularEstimate, inside: NDArray[np.intp], matte: Mask) -> SpecularEstimate:
    """What is to be expected of each pixel's highlights before its own pictures are asked (empirical Bayes).

    A mean over the neighbours, those that tell theirs well counting most.

    Args:
        found: by each pixel's own pictures, of row-major pixels `inside`.
        inside: (pixels,) of the person.
        matte: (height, width).
    """
    height, width = matte.shape
    usual = np.percentile(found.amounts, BRIGHT, axis=0).astype(np.float32)
    sure = ALIKE / np.maximum(usual, 1e-6) ** 2
    trust = found.precision / (found.precision + sure) * (matte.ravel()[inside, None] > 0.5)
    sums, weights = np.zeros((2, height * width, len(SPECULAR_TERMS)), np.float32)
    sums[inside], weights[inside] = trust * found.amounts, trust
    blurred = (
        cv2.GaussianBlur(each.reshape(height, width, -1), (0, 0), REACH * max(height, width)).reshape(
            -1, len(SPECULAR_TERMS)
        )
        for each in (sums, weights)
    )
    near, say = (each[inside] for each in blurred)
    whole = (trust * found.amounts).sum(axis=0) / np.maximum(trust.sum(axis=0), 1e-6)
    mean = (near + WHOLE * whole) / (say + WHOLE)
    return SpecularEstimate(mean.astype(np.float32), np.broadcast_to(sure, mean.shape).astype(np.float32))
