"""Fitting the network of the learned response to people whose response is known.

What counts is by which factor a pixel changes from one light to another: mode ratio multiplies by it, whatever the
pixel's albedo is. So the error is that of logarithms, a constant for each pixel apart. Skin is of one color within a
person, or nearly, and the light of a room is told by it: there a part of that constant counts too, robustly, since
brows, beards and make-up are among it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from relit_camera.base.array_types import Float32Array, Float64Array
from relit_camera.capture.instant.response.learned_response import (
    INPUTS,
    LEAK,
    LEAST_SHARE,
    ResponseNetwork,
    mirror_signs,
)
from relit_studio.field.learned_response.known_response import KnownResponse


@dataclass(frozen=True)
class FitSettings:
    """Settings of the fit; only `believed` matters much.

    Attributes:
        hidden: units of the layers between.
        pixels: of each person that are used.
        rounds: of the optimizer (L-BFGS).
        decay: weight of the squared weights.
        small: of the squared harmonics.
        skin: of the constant of a pixel of skin, where its other errors have 1.
        believed: share of that constant that is learned. For rendered people all of it would be right; on real faces
            (Extended Yale Face Database B) the forehead is hardly lighter than the cheeks, and eye sockets no darker.
        outlier: of that constant, in units of the logarithm, from which it loses weight (Cauchy).
        brightness: exponent of a pixel's brightness relative to skin by which it is weighed, about that of the display;
            pixels count up to `brightest` times as much as skin.
        jitter: deviation of noise that is added to the inputs, in units of their own.
        seed: of weights, noise and the choice of pixels.
    """

    hidden: tuple[int, ...] = (48, 48)
    pixels: int = 3000
    rounds: int = 400
    decay: float = 1e-5
    small: float = 1e-3
    skin: float = 1.0
    believed: float = 0.5
    outlier: float = 0.15
    brightness: float = 0.8
    brightest: float = 3.0
    jitter: float = 0.1
    seed: int = 0


def fit_network(people: Sequence[KnownResponse], settings: FitSettings | None = None) -> ResponseNetwork:
    """The network with the least error on these people and their mirror images; their lights must be the same."""
    settings = settings or FitSettings()
    rng = np.random.default_rng(settings.seed)
    of_inputs, of_harmonics = mirror_signs()
    known, weight = _some_pixels_twice(people, settings, rng)
    mirrored = (np.arange(len(known.inputs)) >= len(known.inputs) // 2)[:, None]
    mean = np.where(of_inputs < 0, 0, known.inputs.mean(axis=0)).astype(np.float32)
    blank = ResponseNetwork(mean, (known.inputs.std(axis=0) + 1e-3).astype(np.float32), ())
    inputs = blank.scaled(known.inputs)
    inputs = np.where(mirrored, inputs * of_inputs, inputs)
    inputs += np.float32(settings.jitter) * rng.standard_normal(inputs.shape, np.float32)
    signs = np.where(mirrored, of_harmonics, np.float32(1))
    sizes = (INPUTS, *settings.hidden, len(of_harmonics))
    shapes = [shape for rows, columns in pairwise(sizes) for shape in ((rows, columns), (columns,))]

    def layers_of(flat: Float64Array) -> list[Float32Array]:
        ends = np.cumsum([int(np.prod(shape)) for shape in shapes])[:-1]
        return [
            part.reshape(shape).astype(np.float32) for part, shape in zip(np.split(flat, ends), shapes, strict=True)
        ]

    def loss(flat: Float64Array) -> tuple[float, Float64Array]:
        layers = layers_of(flat)
        values = [inputs]
        for weights, offsets in zip(layers[:-2:2], layers[1:-2:2], strict=True):
            reached = values[-1] @ weights + offsets
            values.append(np.maximum(reached, LEAK * reached))
        given = (values[-1] @ layers[-2] + layers[-1]) * signs
        error, slope = _error(given, known, weight, settings)
        back = (slope + 2 * settings.small / len(given) * given) * signs
        slopes: list[NDArray[np.floating]] = []
        for index in range(len(values) - 1, -1, -1):
            weights = layers[2 * index]
            slopes[:0] = [values[index].T @ back + 2 * settings.decay * weights, back.sum(axis=0)]
            if index:
                back = (back @ weights.T) * np.where(values[index] > 0, np.float32(1), LEAK)
        error += settings.small * float((given**2).sum()) / len(given)
        error += settings.decay * sum(float((each**2).sum()) for each in layers[::2])
        return error, np.concatenate([each.ravel() for each in slopes]).astype(np.float64)

    start = [rng.normal(0, np.sqrt(2 / shape[0]), shape) if len(shape) == 2 else np.zeros(shape) for shape in shapes]
    start[-2] *= 0.1
    found = minimize(
        loss,
        np.concatenate([each.ravel() for each in start]),
        jac=True,
        method="L-BFGS-B",
        options={"maxiter": settings.rounds, "maxfun": 2 * settings.rounds},
    )
    layers = layers_of(found.x)
    return ResponseNetwork(mean, blank.spread, tuple(zip(layers[::2], layers[1::2], strict=True)))


def mean_error(network: ResponseNetwork | None, person: KnownResponse, settings: FitSettings | None = None) -> float:
    """How wrong the response of a person is, as the root of what the fit makes least; None is the generic one."""
    settings = settings or FitSettings()
    nothing = np.zeros((len(person.inputs), person.harmonics.shape[1]), np.float32)
    added = network.corrections(person.inputs) if network else nothing
    return float(np.sqrt(_error(added, person, _weights(person, settings), settings)[0]))


def _error(
    given: Float32Array, known: KnownResponse, weight: Float32Array, settings: FitSettings
) -> tuple[float, Float32Array]:
    """The mean square error of harmonics (pixels, 9), each pixel by its weight (pixels,), and its slope by them."""
    reached = known.expected + given @ known.harmonics.T
    least = LEAST_SHARE * known.expected
    free = reached > least
    reached = np.where(free, reached, least)
    wrong = np.log(reached) - known.truth
    constant = wrong.mean(axis=1, keepdims=True)
    wrong -= constant
    generic = (np.log(known.expected) - known.truth).mean(axis=1, keepdims=True)
    constant = constant - (1 - settings.believed) * generic
    farther = 1 + (constant / settings.outlier) ** 2
    skin = settings.skin * known.skin[:, None]
    share = (weight / weight.sum())[:, None]
    error = float((share * (wrong**2).mean(axis=1, keepdims=True)).sum())
    error += float((share * skin * settings.outlier**2 * np.log(farther)).sum())
    wrong += skin * constant / farther
    slope = (2 / wrong.shape[1] * share * wrong / reached * free) @ known.harmonics
    return error, np.asarray(slope, np.float32)


def _weights(person: KnownResponse, settings: FitSettings) -> Float32Array:
    """How much each pixel (pixels,) counts, by its brightness."""
    bright = np.exp(person.truth).mean(axis=1)
    bright /= np.median(bright[person.skin > 0])
    return np.asarray(np.minimum(bright**settings.brightness, settings.brightest), np.float32)


def _some_pixels_twice(
    people: Sequence[KnownResponse], settings: FitSettings, rng: np.random.Generator
) -> tuple[KnownResponse, Float32Array]:
    """Some pixels of all people, first as they are, then all once more to be mirrored; and their weights."""
    chosen = []
    for person in people:
        pixels = rng.permutation(len(person.inputs))[: settings.pixels]
        parts = person.inputs, person.expected, person.truth, person.skin, _weights(person, settings)
        chosen.append([part[pixels] for part in parts])
    inputs, expected, truth, skin, weight = (np.concatenate(each * 2) for each in zip(*chosen, strict=True))
    return KnownResponse(inputs, expected, truth, skin, people[0].harmonics), weight
