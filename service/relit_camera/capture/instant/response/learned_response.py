"""What rendered people taught about how a head answers light.

A generic head has a mean skull and neck and a body inflated from its outline: no ears, no collar, no hair that stands
off, and skin of one color from the forehead to the chin. A small network tells what to add to its response: nine
spherical harmonics of light for each pixel, from where the pixel lies on the head and what the generic head answers
there. It sees the shape alone, never the picture: no color of skin can be answered otherwise than another.

`python -m relit_studio learn` trains it (docs/studio.md); its card is in docs/models.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array
from relit_camera.base.images.image_types import Mask
from relit_camera.capture.instant.head_shape import HeadShape
from relit_camera.capture.instant.response.generic_reflectance import ShapeResponse
from relit_camera.light.directions import texel_solid_angles
from relit_camera.light.spherical_harmonics import coefficient_count, texel_basis

DEGREE = 2
"""Of the harmonics: what is left of a face's answer to the light of a room beyond them is small."""
INPUTS = 3 + coefficient_count(DEGREE)
"""Place to the right and up, distance from the outline, and the harmonics of the generic response."""
DEEPEST_CM = 6.0
"""Distance from the outline from which a pixel counts as well inside."""
MOST_SPREADS = 4.0
"""Limit of an input, in standard deviations of what the network was trained with."""
LEAK = np.float32(0.1)
"""Slope of the network's units below zero."""
LEAST_SHARE = np.float32(0.15)
"""Of the generic response, that stays however much is taken away."""


@dataclass(frozen=True)
class ResponseNetwork:
    """A network of fully connected layers, leaky rectifiers between them.

    Attributes:
        mean, spread: (12,) float32: inputs are taken relative to them.
        layers: weights (inputs, outputs) and offsets (outputs,) float32 of each layer; the last one has 9 outputs.
    """

    mean: Float32Array
    spread: Float32Array
    layers: tuple[tuple[Float32Array, Float32Array], ...]

    def scaled(self, inputs: Float32Array) -> Float32Array:
        """Inputs (pixels, 12) as the first layer takes them."""
        scaled = (inputs - self.mean) / self.spread
        return np.asarray(np.clip(scaled, -MOST_SPREADS, MOST_SPREADS), np.float32)

    def corrections(self, inputs: Float32Array) -> Float32Array:
        """Harmonics (pixels, 9) to add to the generic response, of `response_inputs`.

        The mean of what the network says of the pixel and of its mirror image: both sides of a head are alike.
        """
        of_inputs, of_harmonics = mirror_signs()
        mirrored = self._output(inputs * of_inputs) * of_harmonics
        return np.asarray((self._output(inputs) + mirrored) / 2, np.float32)

    def _output(self, inputs: Float32Array) -> Float32Array:
        values = self.scaled(inputs)
        for weights, offsets in self.layers[:-1]:
            values = values @ weights + offsets
            values = np.maximum(values, LEAK * values)
        weights, offsets = self.layers[-1]
        return np.asarray(values @ weights + offsets, np.float32)

    def write(self, path: Path) -> None:
        """Write it to a .npz file."""
        layers: dict[str, Any] = {
            f"{name}{index}": values
            for index, layer in enumerate(self.layers)
            for name, values in zip(("weights", "offsets"), layer, strict=True)
        }
        np.savez_compressed(path, mean=self.mean, spread=self.spread, **layers)


def read_network(path: Path) -> ResponseNetwork:
    """The network that `ResponseNetwork.write` has written."""
    with np.load(path, allow_pickle=False) as stored:
        count = sum(name.startswith("weights") for name in stored.files)
        layers = tuple((stored[f"weights{index}"], stored[f"offsets{index}"]) for index in range(count))
        return ResponseNetwork(stored["mean"], stored["spread"], layers)


@lru_cache(maxsize=1)
def learned_network() -> ResponseNetwork:
    """The network that comes with the program."""
    return read_network(Path(__file__).with_name("learned_response.npz"))


def mirror_signs() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Signs of the inputs (12,) and of the harmonics (9,) of the mirrored person, whose left is this one's right."""
    # Those of negative order are odd across the picture.
    harmonics = [-1 if order < 0 else 1 for degree in range(DEGREE + 1) for order in range(-degree, degree + 1)]
    return np.array([-1, 1, 1, *harmonics], np.float32), np.array(harmonics, np.float32)


def response_inputs(response: ShapeResponse, shape: HeadShape, matte: Mask) -> Float32Array:
    """What the network sees of each pixel of a response: (pixels, 12) float32.

    The place is in the head's axes; the harmonics stay in the picture's, since heads were upright when it was trained.

    Args:
        response: of the shape alone.
        shape: the generic head, of the response's size.
        matte: (height, width) of the person.
    """
    rows, columns = np.nonzero(shape.face)
    across = shape.pose.rotation.as_matrix()[:2, 0]
    across = across / np.linalg.norm(across)
    y, x = np.divmod(response.pixels, matte.shape[1])
    right, up = (x - columns.mean()) / shape.pixels_per_cm, (rows.mean() - y) / shape.pixels_per_cm
    inside = cv2.distanceTransform((matte > 0.5).astype(np.uint8), cv2.DIST_L2, 5).ravel()[response.pixels]
    place = (
        right * across[0] + up * across[1],
        up * across[0] - right * across[1],
        np.minimum(inside / shape.pixels_per_cm, DEEPEST_CM),
    )
    measured = texel_basis(DEGREE) * texel_solid_angles().reshape(-1, 1)
    return np.column_stack([*place, response.diffuse @ measured.astype(np.float32)]).astype(np.float32)


def with_learned_response(
    response: ShapeResponse, shape: HeadShape, matte: Mask, network: ResponseNetwork | None = None
) -> ShapeResponse:
    """A response of the generic head, as heads of its kind were found to answer light; see `response_inputs`."""
    added = (network or learned_network()).corrections(response_inputs(response, shape, matte))
    diffuse = added @ texel_basis(DEGREE).astype(np.float32).T
    diffuse += response.diffuse
    np.maximum(diffuse, LEAST_SHARE * response.diffuse, out=diffuse)
    return replace(response, diffuse=diffuse)
