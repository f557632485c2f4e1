"""The light of the room, from the skin of a face whose shape and color are taken as known.

As mode live does with a captured subject (`live.modes.room_light_estimator`): amounts of soft lights, non-negative,
robust, with a ridge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array, Float64Array
from relit_camera.base.images.color import LUMINANCE
from relit_camera.capture.instant.response.generic_reflectance import ShapeResponse
from relit_camera.light.directions import texel_solid_angles
from relit_camera.light.soft_lights import SoftLights, regularized_nnls


@dataclass(frozen=True)
class RoomFitTunables:
    """Constants of the fit, chosen on a rendered person in three rooms and by looking at real ones.

    Attributes:
        ridge: pull toward even light, relative to the normal matrix's mean diagonal.
        color_ridge: pull of each channel toward the distribution of the luminance.
        rounds: of reweighting.
        outlier: residual, in units of the skin's mean, from which a pixel loses weight (Huber).
        relative: share of the skin's mean that is added to a pixel's own brightness, by whose inverse it is weighed:
            what counts is by which factor the light is wrong, where little of it arrives too.
        max_pixels: of the skin that are used.
    """

    ridge: float = 1e-2
    color_ridge: float = 0.1
    rounds: int = 4
    outlier: float = 0.12
    relative: float = 0.3
    max_pixels: int = 1500


TUNABLES = RoomFitTunables()


def fit_room_light(
    response: ShapeResponse, picture: Float32Array, skin: NDArray[np.bool_], albedo: Float64Array
) -> Float32Array:
    """Radiance times solid angle (2048, 3) in which skin of this albedo (3,) looks as it does in the picture.

    Args:
        response: of the shape.
        picture: (height, width, 3) linear, of the response's size.
        skin: (height, width) where the fit looks.
        albedo: of the skin.
    """
    pixels = response.pixels
    chosen = np.flatnonzero(skin.ravel()[pixels])
    chosen = chosen[:: max(1, len(chosen) // TUNABLES.max_pixels)]
    lights = SoftLights().maps() * texel_solid_angles().reshape(-1, 1).astype(np.float32)
    diffuse, glossy = (each[chosen] @ lights for each in (response.diffuse, response.glossy))
    seen = picture.reshape(-1, 3)[pixels[chosen]].astype(np.float64)
    luma = np.asarray(LUMINANCE, np.float64)
    even = np.ones(lights.shape[1])
    gray = _fit(float(albedo @ luma) * diffuse + glossy, seen @ luma, even, TUNABLES.ridge)
    channels = []
    for channel in range(3):
        design = albedo[channel] * diffuse + glossy
        level = seen[:, channel].mean() / max(float((design @ gray).mean()), 1e-9)
        channels.append(_fit(design, seen[:, channel], level * gray, TUNABLES.color_ridge, scaled=True))
    return np.asarray(lights @ np.stack(channels, axis=1), np.float32)


def _fit(
    design: NDArray[np.floating], values: Float64Array, prior: Float64Array, ridge: float, scaled: bool = False
) -> Float64Array:
    """Amounts (lights,) with which `design` (pixels, lights) gives the values.

    The prior's scale is fitted first, unless it is `scaled` already.
    """
    level = max(float(values.mean()), 1e-6)
    if not scaled:
        prior = prior * (level / max(float((design @ prior).mean()), 1e-9))
    closeness = 1 / (values / level + TUNABLES.relative)
    weight = closeness
    fitted = prior
    for _ in range(TUNABLES.rounds):
        fitted = regularized_nnls(design, values.astype(np.float32), weight, prior, ridge)
        error = np.abs(design @ fitted - values) / level * closeness
        weight = closeness * np.minimum(1, TUNABLES.outlier / np.maximum(error, 1e-9))
    return fitted
