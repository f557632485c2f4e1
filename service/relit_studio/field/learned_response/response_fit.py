"""Fitting the network of the learned response to people whose response is known.

What counts is by which factor a pixel changes from one light to another: mode live multiplies by it, whatever the
pixel's albedo is. So the error is that of logarithms, a constant for each pixel apart. Skin is of one color within a
person, or nearly, and the light of a room is told by it: there a part of that constant counts too, robustly, since
brows, beards and make-up are among it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from relit_camera.base.array_types import Float32Array
from relit_camera.capture.instant.response.learned_response import LEAST_SHARE, input_signs
from relit_camera.capture.instant.response.response_network import ResponseNetwork, harmonic_signs
from relit_studio.field.learned_response.known_response import KnownResponse
from relit_studio.field.learned_response.network_training import TrainingSettings, train_network


@dataclass(frozen=True)
class FitSettings:
    """Settings of the fit; only `believed` matters much.

    Attributes:
        training: of the optimization.
        pixels: of each person that are used.
        skin: of the constant of a pixel of skin, where its other errors have 1.
        believed: share of that constant that is learned. For rendered people all of it would be right; on real faces
            (Extended Yale Face Database B) the forehead is hardly lighter than the cheeks, and eye sockets no darker.
        outlier: of that constant, in units of the logarithm, from which it loses weight (Cauchy).
        brightness: exponent of a pixel's brightness relative to skin by which it is weighed, about that of the display;
            pixels count up to `brightest` times as much as skin.
        seed: of weights, noise and the choice of pixels.
    """

    training: TrainingSettings = field(default_factory=TrainingSettings)
    pixels: int = 3000
    skin: float = 1.0
    believed: float = 0.5
    outlier: float = 0.15
    brightness: float = 0.8
    brightest: float = 3.0
    seed: int = 0


def fit_response_network(people: Sequence[KnownResponse], settings: FitSettings | None = None) -> ResponseNetwork:
    """The network with the least error on these people and their mirror images; their lights must be the same."""
    settings = settings or FitSettings()
    rng = np.random.default_rng(settings.seed)
    known, weight = _some_pixels(people, settings, rng)

    def error(given: Float32Array) -> tuple[float, Float32Array]:
        return _error(given, known, weight, settings)

    return train_network(known.inputs, input_signs(), harmonic_signs(), error, settings.training, rng)


def response_error(
    network: ResponseNetwork | None, person: KnownResponse, settings: FitSettings | None = None
) -> float:
    """How wrong the response of a person is, as the root of what the fit makes least; None is the generic one."""
    settings = settings or FitSettings()
    nothing = np.zeros((len(person.inputs), person.harmonics.shape[1]), np.float32)
    added = network.outputs(person.inputs) if network else nothing
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


def _some_pixels(
    people: Sequence[KnownResponse], settings: FitSettings, rng: np.random.Generator
) -> tuple[KnownResponse, Float32Array]:
    """Some pixels of all people, and their weights."""
    chosen = []
    for person in people:
        pixels = rng.permutation(len(person.inputs))[: settings.pixels]
        parts = person.inputs, person.expected, person.truth, person.skin, _weights(person, settings)
        chosen.append([part[pixels] for part in parts])
    inputs, expected, truth, skin, weight = (np.concatenate(each) for each in zip(*chosen, strict=True))
    return KnownResponse(inputs, expected, truth, skin, people[0].harmonics), weight
