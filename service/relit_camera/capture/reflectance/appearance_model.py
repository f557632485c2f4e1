"""The appearance model: what a pixel shows under one light, as a non-negative sum of five terms.

The terms are diffuse, wrapped diffuse and two specular lobes, all visible only above the pixel's horizon, and light
that the surroundings reflect. They hold for lights that were not captured too: highlights grow toward grazing light
from behind, as on real surfaces, and light of the surroundings ends where none of the visible ones is lit. Amounts are
fitted per pixel by robust non-negative least squares, so a fit with little data stays plausible.

`specular_prior` supplies what a pixel's own pictures cannot tell: a cheek's rim shows its highlight only under lights
that no capture has, so it is expected to be that of its neighbors.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array
from relit_camera.base.images.image_types import Mask
from relit_camera.capture.geometry.shape_estimation import Geometry

TERM_COUNT = 5
SPECULAR_TERMS = 2, 3
"""Indices of the two specular terms. A highlight has the light's own color: one amount for all channels."""


@dataclass(frozen=True)
class AppearanceTunables:
    """Constants of the appearance model, chosen by `relit evaluate olat` (docs/reflectance.md) or from a source.

    Attributes:
        wrap: how far past the terminator wrapped diffuse light reaches, as a cosine: light that travels below the skin.
        normal_incidence_reflectance: of skin (refractive index 1.4; Tuchin 2007).
        grazing_cosine: of half the angle from light to camera; below it the factors that grow toward grazing light stay
            as they are there, because no model is reliable.
        onset_cosine: cosine of normal and light from which a pixel counts as fully lit by direct light.
        penumbra_rad: scale of the logistic curve of visibility over the margin above the horizon: about the error of
            the horizons.
        reweighting_rounds: of the robust fit.
        tolerance: residual at which an observation has half its weight, as a fraction of the pixel's bright values.
        tolerance_floor: summand of that residual, as a fraction of the bright values of all pictures.
        descent_sweeps: of coordinate descent in the non-negative least squares.
        ridge: of the normal equations, as a fraction of their mean diagonal.
        prior_reach: standard deviation of the blur that averages neighbors' highlights, as a fraction of the picture's
            larger side.
        prior_percentile: of the person's specular amounts; it is the expected difference between neighboring pixels.
        correlated_lights: number of neighboring lights whose errors are so correlated that they count as one.
        prior_mean_weight: of the whole person's mean beside the neighbors'.
    """

    wrap: float = 0.5
    normal_incidence_reflectance: float = 0.028
    grazing_cosine: float = 0.3
    onset_cosine: float = 0.1
    penumbra_rad: float = 0.06
    reweighting_rounds: int = 3
    tolerance: float = 0.16
    tolerance_floor: float = 0.02
    descent_sweeps: int = 30
    ridge: float = 1e-3
    prior_reach: float = 0.12
    prior_percentile: float = 90
    correlated_lights: float = 10
    prior_mean_weight: float = 1e-3


TUNABLES = AppearanceTunables()


def appearance_terms(
    cosines: Float32Array, half_vector_cosines: Float32Array, margins: Float32Array, toward_camera: Float32Array
) -> Float32Array:
    """The five terms (pixels, TERM_COUNT, count) of pixels under lights.

    Highlights are Blinn's lobes (1977) with Schlick's Fresnel factor (1994) and the visibility factor of Kelemen
    and Szirmay-Kalos (2001); light of the surroundings has the phase function of a white Lambertian ball.

    Args:
        cosines: (pixels, count) of normal and light.
        half_vector_cosines: (pixels, count) of normal and the direction halfway from light to camera.
        margins: (pixels, count) radians of the light above the pixel's horizon.
        toward_camera: (count,) cosine of light and camera.
    """
    visible = _visible(margins)
    lit = visible * np.maximum(cosines, 0)
    half_way = np.sqrt(np.clip((1 + toward_camera) / 2, 0, 1))
    fresnel = 1 + (1 / TUNABLES.normal_incidence_reflectance - 1) * (1 - half_way) ** 5
    highlight = lit * (fresnel / np.maximum(half_way, TUNABLES.grazing_cosine) ** 2)
    angle = np.arccos(np.clip(toward_camera, -1, 1))
    sheen, shine = _lobes(np.maximum(half_vector_cosines, 0))
    terms = np.empty((len(cosines), TERM_COUNT, cosines.shape[1]), np.float32)
    terms[:, 0] = lit
    terms[:, 1] = visible * np.square(np.maximum((cosines + TUNABLES.wrap) / (1 + TUNABLES.wrap), 0))
    terms[:, 2] = highlight * sheen
    terms[:, 3] = highlight * shine
    terms[:, 4] = (np.sin(angle) + (np.pi - angle) * np.cos(angle)) / np.pi
    return terms


def _visible(margins: Float32Array) -> Float32Array:
    """Share 0..1 of a light that reaches a pixel, by its margin (pixels, count) in radians above the horizon."""
    visible = margins / np.float32(-TUNABLES.penumbra_rad)
    np.minimum(visible, 30, out=visible)
    np.exp(visible, out=visible)
    visible += 1
    return np.asarray(np.reciprocal(visible, out=visible))


def _lobes(cosines: Float32Array) -> tuple[Float32Array, Float32Array]:
    """Blinn's lobes: cosines to the power 12, for the sheen of skin, and 60, for wet or oily skin."""
    # By multiplication: `**` with such an exponent takes many times as long.
    fourth = np.square(np.square(cosines))
    sheen = fourth * np.square(fourth)
    return sheen, sheen * np.square(np.square(sheen))


def half_vectors(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors (count, 3) halfway between those toward lights (count, 3) and the one toward the camera."""
    halves = directions + np.array([0.0, 0.0, 1.0])
    # For a light straight behind the person there is none; that light is hidden anyway.
    return np.asarray(halves / np.maximum(np.linalg.norm(halves, axis=1, keepdims=True), 1e-6))


def distant_terms(geometry: Geometry, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Float32Array:
    """The terms (pixels, TERM_COUNT, count) of row-major pixels of a shape under distant lights (count, 3)."""
    return appearance_terms(
        geometry.cosines(directions, pixels),
        geometry.cosines(half_vectors(directions), pixels),
        geometry.horizon.margins(directions, pixels),
        directions[:, 2].astype(np.float32),
    )


def direct_light_fractions(
    geometry: Geometry, directions: NDArray[np.float64], pixels: NDArray[np.intp]
) -> Float32Array:
    """Share (pixels, count) of distant lights (count, 3) that reaches row-major pixels directly: 0 shadow, 1 lit."""
    facing = np.clip(geometry.cosines(directions, pixels) / TUNABLES.onset_cosine, 0, 1)
    return np.asarray(_visible(geometry.horizon.margins(directions, pixels)) * facing)


@dataclass(frozen=True)
class SpecularEstimate:
    """Amounts of the two specular terms per pixel, fitted or expected, with their precision.

    Attributes:
        amounts: (pixels, 2) float32.
        precision: (pixels, 2) float32, inverse variance of each amount: the sum of weight · term² over the lights, over
            the variance of what no term explains.
    """

    amounts: Float32Array
    precision: Float32Array


def fit_appearance(
    terms: Float32Array, values: Float32Array, bright: float, expected: SpecularEstimate | None = None
) -> tuple[Float32Array, SpecularEstimate]:
    """Amounts of the terms: non-negative least squares, iteratively reweighted so that outliers count little.

    Args:
        terms: (pixels, TERM_COUNT, lights).
        values: (pixels, channels, lights) linear.
        bright: the level that counts as bright, one value for all pictures.
        expected: prior of the specular amounts, weighted by its precision against the pixel's own pictures.

    Returns:
        Amounts (pixels, channels, TERM_COUNT) float32, so that `amounts @ terms` approximates the values; and the
        specular ones among them with their precision.
    """
    brightness = values.mean(axis=1)
    tolerance = TUNABLES.tolerance * np.percentile(brightness, 90, axis=1) + TUNABLES.tolerance_floor * bright + 1e-9
    tolerance = tolerance.astype(np.float32)[:, None]
    weights = np.ones_like(brightness)
    amounts = np.zeros((len(values), values.shape[1], TERM_COUNT), np.float32)
    for _ in range(TUNABLES.reweighting_rounds):
        weighed = (terms * weights[:, None]).transpose(0, 2, 1)
        products, projections = terms @ weighed, values @ weighed
        products += (
            TUNABLES.ridge
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
        residual = brightness - (amounts.mean(axis=1, keepdims=True) @ terms)[:, 0]
        weights = 1 / (1 + np.square(residual / tolerance))
    return amounts, SpecularEstimate(amounts[:, 0, SPECULAR_TERMS], precision)


def _non_negative(products: Float32Array, projections: Float32Array) -> Float32Array:
    """Non-negative least squares of all pixels at once, by coordinate descent.

    Args:
        products: (pixels, terms, terms) of terms with terms.
        projections: (pixels, channels, terms) of values with terms.

    Returns:
        The amounts (pixels, channels, terms); those of the specular terms are the same in all channels.
    """
    # Pixels last, for numpy's inner loops.
    products, projections = (np.ascontiguousarray(np.moveaxis(each, 0, -1)) for each in (products, projections))
    amounts = np.zeros_like(projections)
    for _ in range(TUNABLES.descent_sweeps):
        for term in range(len(products)):
            rest = projections[:, term] - (products[term] * amounts).sum(axis=1)
            best = amounts[:, term] + rest / (products[term, term] + np.float32(1e-12))
            amounts[:, term] = np.maximum(best.mean(axis=0) if term in SPECULAR_TERMS else best, 0)
    return np.ascontiguousarray(np.moveaxis(amounts, -1, 0))


def specular_prior(found: SpecularEstimate, inside: NDArray[np.intp], matte: Mask) -> SpecularEstimate:
    """Prior of each pixel's specular amounts (empirical Bayes): its neighbors' mean, weighted by precision.

    Args:
        found: fitted to each pixel's own pictures, for row-major pixels `inside`.
        inside: (pixels,) row-major indices of the person's pixels.
        matte: (height, width) alpha of the person.
    """
    height, width = matte.shape
    typical = np.percentile(found.amounts, TUNABLES.prior_percentile, axis=0).astype(np.float32)
    sure = TUNABLES.correlated_lights / np.maximum(typical, 1e-6) ** 2
    trust = found.precision / (found.precision + sure) * (matte.ravel()[inside, None] > 0.5)
    sums, weights = np.zeros((2, height * width, len(SPECULAR_TERMS)), np.float32)
    sums[inside], weights[inside] = trust * found.amounts, trust
    blurred = (
        cv2.GaussianBlur(each.reshape(height, width, -1), (0, 0), TUNABLES.prior_reach * max(height, width)).reshape(
            -1, len(SPECULAR_TERMS)
        )
        for each in (sums, weights)
    )
    neighbor_sums, neighbor_weights = (each[inside] for each in blurred)
    whole = (trust * found.amounts).sum(axis=0) / np.maximum(trust.sum(axis=0), 1e-6)
    mean = (neighbor_sums + TUNABLES.prior_mean_weight * whole) / (neighbor_weights + TUNABLES.prior_mean_weight)
    return SpecularEstimate(mean.astype(np.float32), np.broadcast_to(sure, mean.shape).astype(np.float32))
