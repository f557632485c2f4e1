"""A small network for how a head answers light, the same for both sides of a face."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array
from relit_camera.light.spherical_harmonics import coefficient_count

DEGREE = 2
"""Of the harmonics: what is left of a face's answer to the light of a room beyond them is small."""
HARMONICS = coefficient_count(DEGREE)
MOST_SPREADS = 4.0
"""Limit of an input, in standard deviations of what the network was trained with."""
LEAK = np.float32(0.1)
"""Slope of the network's units below zero."""

Signs = NDArray[np.float32]
"""1, or -1 for what changes its sign in the mirrored person, whose left is this one's right."""


@dataclass(frozen=True)
class ResponseNetwork:
    """A network of fully connected layers, leaky rectifiers between them.

    Attributes:
        mean, spread: (inputs,) float32: inputs are taken relative to them.
        layers: weights (inputs, outputs) and offsets (outputs,) float32 of each layer.
        of_inputs, of_outputs: signs of the network's inputs and outputs.
    """

    mean: Float32Array
    spread: Float32Array
    layers: tuple[tuple[Float32Array, Float32Array], ...]
    of_inputs: Signs
    of_outputs: Signs

    def scaled(self, inputs: Float32Array) -> Float32Array:
        """Inputs (pixels, inputs) as the first layer takes them."""
        scaled = (inputs - self.mean) / self.spread
        return np.asarray(np.clip(scaled, -MOST_SPREADS, MOST_SPREADS), np.float32)

    def outputs(self, inputs: Float32Array) -> Float32Array:
        """Outputs (pixels, outputs), the mean of what the network says of a pixel and of its mirror image."""
        mirrored = self._one_side(inputs * self.of_inputs) * self.of_outputs
        return np.asarray((self._one_side(inputs) + mirrored) / 2, np.float32)

    def _one_side(self, inputs: Float32Array) -> Float32Array:
        values = self.scaled(inputs)
        for weights, offsets in self.layers[:-1]:
            values = values @ weights + offsets
            values = np.maximum(values, LEAK * values)
        weights, offsets = self.layers[-1]
        return np.asarray(values @ weights + offsets, np.float32)

    def write(self, path: Path) -> None:
        """Write it to a .npz file, without the signs."""
        layers: dict[str, Any] = {
            f"{name}{index}": values
            for index, layer in enumerate(self.layers)
            for name, values in zip(("weights", "offsets"), layer, strict=True)
        }
        np.savez_compressed(path, mean=self.mean, spread=self.spread, **layers)


def read_network(path: Path, of_inputs: Signs, of_outputs: Signs) -> ResponseNetwork:
    """The network that `ResponseNetwork.write` has written, with the signs of what it sees and says."""
    with np.load(path, allow_pickle=False) as stored:
        count = sum(name.startswith("weights") for name in stored.files)
        layers = tuple((stored[f"weights{index}"], stored[f"offsets{index}"]) for index in range(count))
        return ResponseNetwork(stored["mean"], stored["spread"], layers, of_inputs, of_outputs)


def harmonic_signs() -> Signs:
    """Signs (9,) of the harmonics: those of negative order are odd across the picture."""
    orders = [order for degree in range(DEGREE + 1) for order in range(-degree, degree + 1)]
    return np.array([-1 if order < 0 else 1 for order in orders], np.float32)
