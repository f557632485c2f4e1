"""Relighting with few components: the picture of each, all pixels at once, in 8 bits.

Packed subjects have few, and those of few lights whose method needs no more. One product a channel takes less time than
the clusters' many small ones, even where it reads more bytes.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.models.session_with_fallback import Session
from relit_camera.subject.compression.local_basis import LocalBasis
from relit_camera.subject.relighting.integer_product import (
    DIGIT_BITS,
    DIGIT_ZERO,
    FLOAT,
    MAX_FACTOR,
    digits_of,
    quantize,
)
from relit_camera.subject.relighting.onnx_graph import cpu_session, node, tensor_value

_AT_A_TIME = 8
"""Components that are expanded at a time: as floats a picture of all would take hundreds of megabytes."""


def component_bytes(basis: LocalBasis) -> int:
    """Bytes of `ComponentPictures` of a basis, one pixel's more or less."""
    return 2 * 3 * basis.components * len(np.unique(basis.pixels))


class ComponentPictures:
    """The amounts of components × the pictures of these. Thread-safe.

    Each value is kept in two codes of 8 bits, the second of what the first leaves: with one code a lamp alone, without
    an environment, showed blotches in the dark.

    Attributes:
        nbytes: bytes of the pictures.
    """

    def __init__(self, basis: LocalBasis, size: int, threads: int = 1) -> None:
        """Expand the pictures of a basis for a picture of `size` pixels; those of no cluster come back black."""
        inside = np.unique(basis.pixels).astype(np.intp)
        count = basis.components
        # With one pixel more, which stays black, for all that are in no cluster.
        codes = np.zeros((3, 2, count, len(inside) + 1), np.int8)
        units = np.zeros(codes.shape[:3], np.float32)
        for first in range(0, count, _AT_A_TIME):
            some = np.s_[first : first + _AT_A_TIME]
            pictures = basis.at(np.eye(count, dtype=np.float32)[:, some], inside)
            for channel in range(3):
                rest = np.ascontiguousarray(pictures[..., channel])
                for half in range(2):
                    rounded = quantize(rest)
                    rest -= rounded.restored()
                    codes[channel, half, some, :-1], units[channel, half, some] = rounded.codes, rounded.scales
        self._units = units
        self._place = np.full(size, len(inside), np.intp)
        self._place[inside] = np.arange(len(inside))
        self._everywhere = len(inside) == size
        self.nbytes = codes.nbytes
        self._session = _session(codes.reshape(3, 2 * count, -1), threads)

    def __call__(self, amounts: NDArray[np.float32]) -> NDArray[np.float32]:
        """The picture (count, pixels, 3) for amounts (3, count, components) of each channel's light."""
        count = amounts.shape[1]
        factors = (amounts[:, :, None] * self._units[:, None]).reshape(3, count, -1)
        scales = np.abs(factors).max(axis=2, keepdims=True) / MAX_FACTOR + np.float32(1e-30)
        # The sums of both digits of a light times their units are another product.
        both = np.concatenate([np.eye(count) * (1 << DIGIT_BITS), np.eye(count)], axis=1, dtype=np.float32)
        feed: dict[str, NDArray] = {}
        for channel in range(3):
            feed[f"digits_{channel}"] = digits_of(factors[channel], scales[channel])
            feed[f"units_{channel}"] = scales[channel] * both
        found = self._session.run(feed)
        planes = [self._all_pixels(found[f"plane_{channel}"]) for channel in range(3)]
        return np.stack([cv2.merge([plane[i] for plane in planes]).reshape(-1, 3) for i in range(count)])

    def _all_pixels(self, plane: NDArray[np.float32]) -> NDArray[np.float32]:
        return plane[:, :-1] if self._everywhere else plane.take(self._place, axis=1, mode="clip")


def _session(codes: NDArray[np.int8], threads: int) -> Session:
    """Of each channel `digits` (2 · count, codes) × its codes, and that × `units` → `plane` (count, pixels)."""
    nodes, inputs, outputs = [], [], []
    constants: dict[str, NDArray] = {"zero": np.array(DIGIT_ZERO, np.uint8)}
    for channel, matrix in enumerate(codes):
        constants[f"codes_{channel}"] = matrix
        nodes += [
            node("MatMulInteger", [f"digits_{channel}", f"codes_{channel}", "zero"], [f"sums_{channel}"]),
            node("Cast", [f"sums_{channel}"], [f"numbers_{channel}"], to=FLOAT),
            node("MatMul", [f"units_{channel}", f"numbers_{channel}"], [f"plane_{channel}"]),
        ]
        inputs += [
            tensor_value(f"digits_{channel}", "uint8", ["digits", matrix.shape[0]]),
            tensor_value(f"units_{channel}", "float32", ["count", "digits"]),
        ]
        outputs.append(tensor_value(f"plane_{channel}", "float32", ["count", matrix.shape[1]]))
    return cpu_session("relight-pictures", nodes, inputs, outputs, constants, threads)
