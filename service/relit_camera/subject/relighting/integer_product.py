"""Products with large constant matrices that are kept in 8 bits and multiplied in integers, by ONNX Runtime.

Such a product waits for memory, so what counts are the matrix's bytes; and processors multiply 8-bit integers several
times as fast as floats. The other factor is split into two digits of 7 bits, -64 to 63, stored as unsigned bytes about
64: sums of two products of 7 and 8 bits fit into 16, in which processors without VNNI add them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.models.session_with_fallback import Session, SessionOptions, open_session
from relit_camera.subject.relighting.onnx_graph import ELEMENT_TYPES, model, node, tensor_value

Values = NDArray[np.float32]

HEAD_COLUMNS = 256
"""The first columns, whose factors are the largest, are kept in two codes a value, the second of what the first leaves;
the others in one. With 64 a lamp alone, without an environment, showed clusters in the dark of a face."""
MAX_CODE = 127
DIGIT_BITS, DIGIT_ZERO = 7, 64
MAX_FACTOR = (63 << DIGIT_BITS) + 63
PLACES_PER_TILE = 64
"""Larger clusters are divided into tiles of this: matrices that are packed and multiplied within the cache."""
OPSET, IR_VERSION = 21, 9
FLOAT = ELEMENT_TYPES["float32"]


@dataclass(frozen=True)
class QuantizedRows:
    """A matrix (rows, columns) as codes times scales (rows,)."""

    codes: NDArray[np.int8]
    scales: Values

    def restored(self) -> Values:
        """The matrix as it is after rounding."""
        return self.codes * self.scales[:, None]


def quantize(values: Values) -> QuantizedRows:
    """A matrix (rows, columns) rounded to 8 bits of each row's largest value."""
    scales = np.abs(values).max(axis=1) / MAX_CODE + np.float32(1e-30)
    return QuantizedRows(np.rint(values / scales[:, None]).astype(np.int8), scales)


def _digits(factors: Values, scales: Values) -> NDArray[np.uint8]:
    """High digits (count, …), then low ones, as (2 · count, …), of factors (count, …) in units of scales."""
    rounded = np.rint(factors / scales).astype(np.int16)
    high = (rounded + DIGIT_ZERO) >> DIGIT_BITS
    return (np.concatenate([high, rounded - (high << DIGIT_BITS)]) + DIGIT_ZERO).astype(np.uint8)


def _sum_of_digits(products: NDArray) -> Values:
    """What products (2 · count, …) of the digits amount to, (count, …)."""
    high, low = np.split(products, 2)
    return np.asarray(high * np.float32(1 << DIGIT_BITS) + low)


class IntegerProduct:
    """factors (count, columns) × the matrix (rows, columns), transposed. Thread-safe.

    Its error is that of 8 bits in the last columns, 16 bits in the first, and 14 bits in the factors.

    Attributes:
        nbytes: bytes of the matrix.
    """

    def __init__(self, rows: int, columns: int, blocks: Iterable[Values], threads: int = 1) -> None:
        """`blocks` are the matrix's rows (some, columns), in order, read one at a time."""
        self._rows = rows
        tiles = -(-rows // PLACES_PER_TILE)
        head = min(columns, HEAD_COLUMNS)
        widths = [head, head, columns - head][: 2 + (columns > head)]
        # Fed at each run, which copies nothing: as a part of the graph ONNX Runtime would hold every number twice.
        self._matrix: dict[str, NDArray[Any]] = {}
        for i, width in enumerate(widths):
            self._matrix[f"codes_{i}"] = np.zeros((tiles, width, PLACES_PER_TILE), np.int8)
            self._matrix[f"scales_{i}"] = np.zeros((tiles, 1, PLACES_PER_TILE), np.float32)
        start = 0
        for block in blocks:
            tile, place = np.divmod(np.arange(start, start + len(block)), PLACES_PER_TILE)
            for i, part in enumerate(_encode(block)):
                self._matrix[f"codes_{i}"][tile, :, place] = part.codes
                self._matrix[f"scales_{i}"][tile, 0, place] = part.scales
            start += len(block)
        self.nbytes = sum(each.nbytes for each in self._matrix.values())
        self._session = _product_session(widths, threads)

    def __call__(self, factors: Values) -> Values:
        """The product (count, rows) with factors (count, columns)."""
        scales = np.abs(factors).max(axis=1, keepdims=True) / MAX_FACTOR + np.float32(1e-30)
        digits = _digits(factors, scales)
        feed = {"head": digits[:, :HEAD_COLUMNS], "rest": digits[:, HEAD_COLUMNS:]}
        feed = {name: np.ascontiguousarray(each) for name, each in feed.items() if each.size}
        product = self._session.run({**feed, **self._matrix})["product"].reshape(2 * len(factors), -1)
        return np.asarray(_sum_of_digits(product[:, : self._rows]) * scales)


def _encode(block: Values) -> list[QuantizedRows]:
    head, rest = block[:, :HEAD_COLUMNS], block[:, HEAD_COLUMNS:]
    first = quantize(head)
    return [first, quantize(head - first.restored()), *([quantize(rest)] if rest.size else [])]


def _product_session(widths: Sequence[int], threads: int) -> Session:
    """`head` and `rest`, digits (count, columns), codes and scales of each part, → `product` (count, tiles, places)."""
    names = ["head", "head", "rest"][: len(widths)]
    nodes, inputs = [], []
    for i, (name, width) in enumerate(zip(names, widths, strict=True)):
        inputs += [
            tensor_value(f"codes_{i}", "int8", ["tiles", width, PLACES_PER_TILE]),
            tensor_value(f"scales_{i}", "float32", ["tiles", 1, PLACES_PER_TILE]),
        ]
        nodes += [
            node("MatMulInteger", [name, f"codes_{i}", "zero"], [f"sum_{i}"]),
            node("Cast", [f"sum_{i}"], [f"number_{i}"], to=FLOAT),
            node("Mul", [f"number_{i}", f"scales_{i}"], [f"product_{i}"]),
        ]
    nodes.append(node("Sum", [f"product_{i}" for i in range(len(widths))], ["tiles"]))
    nodes.append(node("Transpose", ["tiles"], ["product"], perm=[1, 0, 2]))
    inputs += [
        tensor_value(name, "uint8", ["count", width]) for name, width in dict(zip(names, widths, strict=True)).items()
    ]
    output = tensor_value("product", "float32", ["count", "tiles", PLACES_PER_TILE])
    return _session("relight-mixes", nodes, {}, inputs, output, threads)


class ClusterProducts:
    """In each cluster of pixels: amounts of its components × its values. Thread-safe.

    Attributes:
        size: how many products there are for one light.
        nbytes: bytes of the values.
    """

    def __init__(self, groups: Sequence[NDArray[np.int8]], threads: int = 1) -> None:
        """`groups` are values (clusters, 3, rank, places), with the same places each."""
        self._groups = [_tiled(values) for values in groups]
        self._places = groups[0].shape[3]
        self.nbytes = sum(values.nbytes for values in self._groups)
        self.size = sum(values.size // values.shape[3] for values in self._groups)
        clusters = [len(values) for values in groups]
        self._ranks = np.repeat([values.shape[2] for values in groups], clusters)
        self._tiles = np.repeat([values.shape[1] for values in self._groups], clusters)
        self._first = np.cumsum(self._ranks) - self._ranks
        self._values = {f"values_{i}": values for i, values in enumerate(self._groups)}
        self._session = _cluster_session(self._groups, threads)

    def positions(self) -> Iterator[NDArray[np.intp]]:
        """Where each place's channels stand among the products: (clusters, places, 3) of each group."""
        start = 0
        for values in self._groups:
            clusters, tiles, _, _, places = values.shape
            order = start + np.arange(clusters * tiles * 3 * places).reshape(clusters, tiles, 3, places)
            yield order.transpose(0, 1, 3, 2).reshape(clusters, -1, 3)[:, : self._places]
            start += order.size

    def __call__(self, amounts: Values) -> Values:
        """The products with amounts (3, count, components of all clusters): (count, size + 1).

        `positions` says which is which; the number behind all others is 0.
        """
        by_light = np.ascontiguousarray(amounts.transpose(1, 0, 2))
        scales = np.maximum.reduceat(np.abs(by_light), self._first, axis=2) / MAX_FACTOR + np.float32(1e-30)
        digits = _digits(by_light, np.repeat(scales, self._ranks, axis=2)).reshape(2, *by_light.shape)
        scales = np.repeat(scales.transpose(0, 2, 1), self._tiles, axis=1).reshape(len(by_light), -1, 1)
        return np.asarray(self._session.run({"digits": digits, "scales": scales, **self._values})["products"])


def _tiled(values: NDArray[np.int8]) -> NDArray[np.int8]:
    """Values (clusters, 3, rank, places) as (clusters, tiles, 3, rank, PLACES_PER_TILE), filled up with zeros."""
    clusters, _, rank, places = values.shape
    tiled = np.zeros((clusters, -(-places // PLACES_PER_TILE), 3, rank, PLACES_PER_TILE), np.int8)
    for tile in range(tiled.shape[1]):  # without a second copy of the whole, padded
        part = values[..., tile * PLACES_PER_TILE : (tile + 1) * PLACES_PER_TILE]
        tiled[:, tile, ..., : part.shape[-1]] = part
    return tiled


def _cluster_session(groups: Sequence[NDArray[np.int8]], threads: int) -> Session:
    """`digits` (2, count, 3, components) and `scales` (count, tiles · 3, 1) → `products` of `ClusterProducts`."""
    rows = sum(3 * len(values) * values.shape[1] for values in groups)
    places = PLACES_PER_TILE
    sizes = [len(values) * values.shape[3] for values in groups]
    names = [f"amounts_{i}" for i in range(len(groups))]
    constants: dict[str, NDArray] = {
        "sizes": np.array(sizes, np.int64),
        "by_channel": np.array([-1, rows, places], np.int64),
        "flat": np.array([-1, rows * places], np.int64),
        "by_digit": np.array([2, -1, rows * places], np.int64),
        "base": np.array(1 << DIGIT_BITS, np.float32),
        "one_more": np.array([0, 0, 0, 1], np.int64),
    }
    inputs = []
    nodes = [node("Split", ["digits", "sizes"], names, axis=3)]
    for i, values in enumerate(groups):
        constants[f"row_{i}"] = np.array([-1, len(values) * values.shape[1] * 3 * places], np.int64)
        inputs.append(tensor_value(f"values_{i}", "int8", values.shape))
        constants |= {f"shape_{i}": np.array([-1, 3, len(values), 1, values.shape[3]], np.int64)}
        nodes += [
            node("Reshape", [names[i], f"shape_{i}"], [f"by_light_{i}"]),
            node("Transpose", [f"by_light_{i}"], [f"by_cluster_{i}"], perm=[2, 3, 1, 0, 4]),
            node("MatMulInteger", [f"by_cluster_{i}", f"values_{i}", "zero"], [f"mixed_{i}"]),
            node("Transpose", [f"mixed_{i}"], [f"light_first_{i}"], perm=[3, 0, 1, 2, 4]),
            node("Reshape", [f"light_first_{i}", f"row_{i}"], [f"places_{i}"]),
        ]
    nodes += [
        node("Concat", [f"places_{i}" for i in range(len(groups))], ["sums"], axis=1),
        node("Cast", ["sums"], ["numbers"], to=FLOAT),
        node("Reshape", ["numbers", "by_digit"], ["pairs"]),
        node("Split", ["pairs"], ["high", "low"], axis=0, num_outputs=2),
        node("Mul", ["high", "base"], ["shifted"]),
        node("Add", ["shifted", "low"], ["whole"]),
        node("Reshape", ["whole", "by_channel"], ["unscaled"]),
        node("Mul", ["unscaled", "scales"], ["scaled"]),
        node("Reshape", ["scaled", "flat"], ["all"]),
        node("Pad", ["all", "one_more"], ["products"]),
    ]
    inputs += [
        tensor_value("digits", "uint8", [2, "count", 3, sum(sizes)]),
        tensor_value("scales", "float32", ["count", rows, 1]),
    ]
    output = tensor_value("products", "float32", ["count", rows * places + 1])
    return _session("relight-clusters", nodes, constants, inputs, output, threads)


def _session(
    name: str, nodes: list[bytes], constants: dict[str, NDArray], inputs: list[bytes], output: bytes, threads: int
) -> Session:
    constants = {**constants, "zero": np.array(DIGIT_ZERO, np.uint8)}
    serialized = model(name, nodes, inputs, output, constants, OPSET, IR_VERSION)
    return open_session(serialized, name, SessionOptions("cpu", threads))
