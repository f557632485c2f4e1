"""Fitting the network of the learned desk field to people before screens whose response is known.

The error is that of logarithms, in two parts: by which factor a pixel changes from one light to another, and its mean,
robustly. That mean counts as much: what a pixel sends under a screen tells of other lights only through it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import expit

from relit_camera.base.array_types import Float32Array
from relit_camera.capture.desk.person.learned_field import input_signs, output_signs
from relit_camera.capture.instant.response.learned_response import LEAST_SHARE
from relit_camera.capture.instant.response.response_network import HARMONICS, ResponseNetwork
from relit_studio.field.learned_response.known_field import KnownField
from relit_studio.field.learned_response.network_training import TrainingSettings, train_network


@dataclass(frozen=True)
class FieldFitSettings:
    """Settings of the fit.

    Attributes:
        training: of the optimization.
        pixels: of each person that are used.
        outlier: of a pixel's mean error, in units of the logarithm, from which it loses weight (Cauchy).
        brightness: exponent of a pixel's brightness relative to skin by which it is weighed, about that of the display;
            pixels count up to `brightest` times as much as skin.
        seed: of weights, noise and the choice of pixels.
    """

    training: TrainingSettings = field(
        default_factory=lambda: TrainingSettings(rounds=150, decay=1e-4, small=(*[1e-3] * HARMONICS, 1e-4))
    )
    pixels: int = 2000
    outlier: float = 0.3
    brightness: float = 0.8
    brightest: float = 3.0
    seed: int = 0


def fit_field_network(people: Sequence[KnownField], settings: FieldFitSettings | None = None) -> ResponseNetwork:
    """The network with the least error on these people and their mirror images; their lights must be the same."""
    settings = settings or FieldFitSettings()
    rng = np.random.default_rng(settings.seed)
    chosen = []
    for person in people:
        pixels = rng.permutation(len(person.inputs))[: settings.pixels]
        weight = _weights(person, settings)[pixels]
        parts = person.inputs, person.measured, person.painted, person.truth, person.brightness
        chosen.append([*(part[pixels] for part in parts), weight / weight.sum()])
    inputs, measured, painted, truth, brightness, weight = (np.concatenate(each) for each in zip(*chosen, strict=True))
    known = KnownField(inputs, measured, painted, truth, brightness, people[0].harmonics)

    def error(given: Float32Array) -> tuple[float, Float32Array]:
        return _error(given, known, weight, settings)

    return train_network(known.inputs, input_signs(), output_signs(), error, settings.training, rng)


def field_error(network: ResponseNetwork | None, person: KnownField, settings: FieldFitSettings | None = None) -> float:
    """How wrong a person's field is, as the root of what the fit makes least; None is the measured field's.

    All that the network says is believed, of which captures do half.
    """
    settings = settings or FieldFitSettings()
    as_measured = np.zeros((len(person.inputs), len(output_signs())), np.float32)
    as_measured[:, -1] = _ALL_MEASURED
    given = network.outputs(person.inputs) if network else as_measured
    return float(np.sqrt(_error(given, person, _weights(person, settings), settings)[0]))


_ALL_MEASURED = 30.0
"""A logit whose share is 1."""


def _error(
    given: Float32Array, known: KnownField, weight: Float32Array, settings: FieldFitSettings
) -> tuple[float, Float32Array]:
    """The mean error of outputs (pixels, 10), each pixel by its weight (pixels,), and its slope by them."""
    share = expit(given[:, -1:])
    apart = known.measured - known.painted
    mixed = known.painted + share * apart
    reached = mixed + given[:, :-1] @ known.harmonics.T
    least = LEAST_SHARE * mixed
    free = reached > least
    reached = np.where(free, reached, least)
    wrong = np.log(reached) - known.truth
    mean = wrong.mean(axis=1, keepdims=True)
    wrong -= mean
    farther = 1 + (mean / settings.outlier) ** 2
    counted = (weight / weight.sum())[:, None]
    error = float((counted * (wrong**2).mean(axis=1, keepdims=True)).sum())
    error += float((counted * settings.outlier**2 * np.log(farther)).sum())
    by_reached = 2 / wrong.shape[1] * counted * (wrong + mean / farther) / reached
    by_harmonics = (by_reached * free) @ known.harmonics
    by_mixed = np.where(free, by_reached, LEAST_SHARE * by_reached)
    by_share = (by_mixed * apart).sum(axis=1, keepdims=True) * share * (1 - share)
    return error, np.concatenate([by_harmonics, by_share], axis=1).astype(np.float32)


def _weights(person: KnownField, settings: FieldFitSettings) -> Float32Array:
    """How much each pixel (pixels,) counts, by its brightness."""
    return np.asarray(np.minimum(person.brightness**settings.brightness, settings.brightest), np.float32)
