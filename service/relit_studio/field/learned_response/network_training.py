"""Training of the small networks that say how a head answers light, by L-BFGS on all pixels at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from relit_camera.base.array_types import Float32Array, Float64Array
from relit_camera.capture.instant.response.response_network import LEAK, ResponseNetwork, Signs

Error = Callable[[Float32Array], tuple[float, Float32Array]]
"""The error of outputs (pixels, outputs), and its slope by them."""


@dataclass(frozen=True)
class TrainingSettings:
    """Settings of the optimization.

    Attributes:
        hidden: units of the layers between.
        rounds: of the optimizer.
        decay: weight of the squared weights.
        small: of each squared output.
        jitter: deviation of noise that is added to the inputs, in units of their own.
    """

    hidden: tuple[int, ...] = (48, 48)
    rounds: int = 400
    decay: float = 1e-5
    small: float | tuple[float, ...] = 1e-3
    jitter: float = 0.1


def train_network(
    inputs: Float32Array,
    of_inputs: Signs,
    of_outputs: Signs,
    error: Error,
    settings: TrainingSettings,
    rng: np.random.Generator,
) -> ResponseNetwork:
    """The network with the least error on some pixels and on their mirror images.

    Args:
        inputs: (pixels, inputs) what it sees.
        of_inputs: signs of what it sees in the mirror.
        of_outputs: the same of what it says.
        error: of what it says of these pixels.
        settings: of the optimization.
        rng: of the first weights and of the noise.
    """
    mean = np.where(of_inputs < 0, 0, inputs.mean(axis=0)).astype(np.float32)
    blank = ResponseNetwork(mean, (inputs.std(axis=0) + 1e-3).astype(np.float32), (), of_inputs, of_outputs)
    seen = blank.scaled(inputs)
    seen = np.concatenate([seen, seen * of_inputs])
    seen += np.float32(settings.jitter) * rng.standard_normal(seen.shape, np.float32)
    signs = np.repeat(np.stack([np.ones_like(of_outputs), of_outputs]), len(inputs), axis=0)
    sizes = (len(of_inputs), *settings.hidden, len(of_outputs))
    shapes = [shape for rows, columns in pairwise(sizes) for shape in ((rows, columns), (columns,))]
    small = np.broadcast_to(np.asarray(settings.small, np.float32), of_outputs.shape) / len(seen)

    def layers_of(flat: Float64Array) -> list[Float32Array]:
        ends = np.cumsum([int(np.prod(shape)) for shape in shapes])[:-1]
        return [
            part.reshape(shape).astype(np.float32) for part, shape in zip(np.split(flat, ends), shapes, strict=True)
        ]

    def loss(flat: Float64Array) -> tuple[float, Float64Array]:
        layers = layers_of(flat)
        values = [seen]
        for weights, offsets in zip(layers[:-2:2], layers[1:-2:2], strict=True):
            reached = values[-1] @ weights + offsets
            values.append(np.maximum(reached, LEAK * reached))
        given = (values[-1] @ layers[-2] + layers[-1]) * signs
        errors, slope = zip(*map(error, np.split(given, 2)), strict=True)
        total = float(np.mean(errors)) + float((small * given**2).sum())
        back = (np.concatenate(slope) / 2 + 2 * small * given) * signs
        slopes: list[NDArray[np.floating]] = []
        for index in range(len(values) - 1, -1, -1):
            weights = layers[2 * index]
            slopes[:0] = [values[index].T @ back + 2 * settings.decay * weights, back.sum(axis=0)]
            if index:
                back = (back @ weights.T) * np.where(values[index] > 0, np.float32(1), LEAK)
        total += settings.decay * sum(float((each**2).sum()) for each in layers[::2])
        return total, np.concatenate([each.ravel() for each in slopes]).astype(np.float64)

    found = minimize(
        loss,
        np.concatenate([each.ravel() for each in _first_layers(shapes, rng)]),
        jac=True,
        method="L-BFGS-B",
        options={"maxiter": settings.rounds, "maxfun": 2 * settings.rounds},
    )
    layers = layers_of(found.x)
    return replace(blank, layers=tuple(zip(layers[::2], layers[1::2], strict=True)))


def _first_layers(shapes: Sequence[tuple[int, ...]], rng: np.random.Generator) -> list[Float64Array]:
    """Weights with which values keep their size from layer to layer, the last ones a tenth of that."""
    first = [rng.normal(0, np.sqrt(2 / shape[0]), shape) if len(shape) == 2 else np.zeros(shape) for shape in shapes]
    first[-2] *= 0.1
    return first
