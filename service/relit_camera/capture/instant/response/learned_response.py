"""What rendered people taught about how a head answers light.

A generic head has a mean skull and neck and a body inflated from its outline: no ears, no collar, no hair that stands
off, and skin of one color from the forehead to the chin. A small network tells what to add to its response: nine
spherical harmonics of light for each pixel, from where the pixel lies on the head and what the generic head answers
there. It sees the shape alone, never the picture: no color of skin can be answered otherwise than another.

`python -m relit_studio learn` trains it (docs/studio.md); its card is in docs/models.md.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from relit_camera.base.array_types import Float32Array, Indices
from relit_camera.base.images.image_types import Mask
from relit_camera.capture.instant.head_shape import HeadShape
from relit_camera.capture.instant.response.generic_reflectance import ShapeResponse
from relit_camera.capture.instant.response.response_network import (
    DEGREE,
    ResponseNetwork,
    Signs,
    harmonic_signs,
    read_network,
)
from relit_camera.light.directions import texel_solid_angles
from relit_camera.light.spherical_harmonics import texel_basis

DEEPEST_CM = 6.0
"""Distance from the outline from which a pixel counts as well inside."""
LEAST_SHARE = np.float32(0.15)
"""Of a response that is corrected, that stays however much is taken away."""
PLACE_SIGNS: Signs = np.array([-1, 1, 1], np.float32)
"""Signs of a place on the head, see `head_places`."""


@lru_cache(maxsize=1)
def learned_network() -> ResponseNetwork:
    """The network that comes with the program."""
    return read_network(Path(__file__).with_name("learned_response.npz"), input_signs(), harmonic_signs())


def input_signs() -> Signs:
    """Signs (12,) of the network's inputs: the place on the head, and the harmonics of the generic response."""
    return np.concatenate([PLACE_SIGNS, harmonic_signs()])


def head_places(pixels: Indices, shape: HeadShape, matte: Mask) -> Float32Array:
    """Where row-major pixels (count,) lie: (count, 3) float32, centimeters to the right, up, and from the outline.

    Right and up are the head's own, from the middle of its face.

    Args:
        pixels: of the shape's size.
        shape: the generic head.
        matte: (height, width) of the person.
    """
    rows, columns = np.nonzero(shape.face)
    across = shape.pose.rotation.as_matrix()[:2, 0]
    across = across / np.linalg.norm(across)
    y, x = np.divmod(pixels, matte.shape[1])
    right, up = (x - columns.mean()) / shape.pixels_per_cm, (rows.mean() - y) / shape.pixels_per_cm
    inside = cv2.distanceTransform((matte > 0.5).astype(np.uint8), cv2.DIST_L2, 5).ravel()[pixels]
    place = (
        right * across[0] + up * across[1],
        up * across[0] - right * across[1],
        np.minimum(inside / shape.pixels_per_cm, DEEPEST_CM),
    )
    return np.column_stack(place).astype(np.float32)


def response_inputs(response: ShapeResponse, shape: HeadShape, matte: Mask) -> Float32Array:
    """What the network sees of each pixel of a response: (pixels, 12) float32.

    The place is in the head's axes; the harmonics stay in the picture's, since heads were upright when it was trained.

    Args:
        response: of the shape alone.
        shape: the generic head, of the response's size.
        matte: (height, width) of the person.
    """
    return np.column_stack([head_places(response.pixels, shape, matte), response.diffuse @ harmonic_measure()])


def harmonic_measure() -> Float32Array:
    """What turns a response (pixels, 2048) into its harmonics (pixels, 9): (2048, 9) float32."""
    return (texel_basis(DEGREE) * texel_solid_angles().reshape(-1, 1)).astype(np.float32)


def with_learned_response(
    response: ShapeResponse, shape: HeadShape, matte: Mask, network: ResponseNetwork | None = None
) -> ShapeResponse:
    """A response of the generic head, as heads of its kind were found to answer light; see `response_inputs`."""
    added = (network or learned_network()).outputs(response_inputs(response, shape, matte))
    diffuse = added @ texel_basis(DEGREE).astype(np.float32).T
    diffuse += response.diffuse
    np.maximum(diffuse, LEAST_SHARE * response.diffuse, out=diffuse)
    return replace(response, diffuse=diffuse)
