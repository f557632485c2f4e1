"""Products with large constant matrices that are kept in 8 bits and multiplied in integers, by ONNX Runtime.

Such a product waits for memory, so what counts are the matrix's bytes; and processors multiply 8-bit integers several
times as fast as floats. The other factor is split into two digits of 7 bits, -64 to 63, stored as unsigned bytes about
64: sums of two products of 7 and 8 bits fit into 16, in which processors without VNNI add them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.models.session_with_fallback import Session
from relit_camera.subject.relighting.onnx_graph import ELEMENT_TYPES, cpu_session, node, tensor_value

Values = NDArray[np.float32]

HEAD_COLUMNS = 256
"""The first columns, whose factors are the largest, are kept in two codes a value, the second of what the first leaves;
the others in one. With 64 a lamp alone, without an environment, showed clusters in the dark of a face."""
MAX_CODE = 127
DIGIT_BITS, DIGIT_ZERO = 7, 64
MAX_FACTOR = (63 << DIGIT_BITS) + 63
PLACES_PER_TILE = 64
"""Larger clusters are divided into tiles of this: matrices that are packed and multiplied within the cache."""
CHANNEL_STEPS = range(0, 3 * PLACES_PER_TILE, PLACES_PER_TILE)
"""From where a pixel's red stands among the products of `ClusterProducts` to its red, green and blue."""
FLOAT = ELEMENT_TYPES["float32"]
_ZERO = {"zero": np.array(DIGIT_ZERO, np.uint8)}


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


def digits_of(factors: Values, scales: Values) -> NDArray[np.uint8]:
    """High digits (count, …), then low ones, as (2 · count, …), of factors (count, …) in units of scales."""
    rounded = np.rint(factors / scales).astype(np.int16)
    high = (rounded + DIGIT_ZERO) >> DIGIT_BITS
    return (np.concatenate([high, rounded - (high << DIGIT_BITS)]) + DIGIT_ZERO).astype(np.uint8)


class IntegerProduct:
    """factors (count, columns) × the matrix (rows, columns), transposed. Thread-safe.

    Its error is that of 8 bits in the last columns, 16 bits in the first, and 14 bits in the factors.

    Attributes:
        nbytes: bytes of the matrix.
    """

    def __init__(self, rows: int, columns: int, blocks: Iterable[Values], threads: int = 1) -> None:
        """`blocks` are the matrix's rows (some, columns), in order, read one at a time."""
        head = min(columns, HEAD_COLUMNS)
        widths = [head, head, columns - head][: 2 + (columns > head)]
        codes = [np.empty((width, rows), np.int8) for width in widths]
        scales = [np.empty((1, rows), np.float32) for _ in widths]
        start = 0
        for block in blocks:
            part = slice(start, start + len(block))
            for encoded, code, scale in zip(_encode(block), codes, scales, strict=True):
                code[:, part], scale[0, part] = encoded.codes.T, encoded.scales
            start = part.stop
        if start != rows:
            raise ValueError(f"{start} of {rows} rows were given")
        self.nbytes = sum(code.nbytes + scale.nbytes for code, scale in zip(codes, scales, strict=True))
        self._session = _product_session(codes, scales, threads)

    def __call__(self, factors: Values) -> Values:
        """The product (count, rows) with factors (count, columns)."""
        scales = np.abs(factors).max(axis=1, keepdims=True) / MAX_FACTOR + np.float32(1e-30)
        digits = digits_of(factors, scales)
        feed = {"head": digits[:, :HEAD_COLUMNS], "rest": digits[:, HEAD_COLUMNS:]}
        feed = {name: np.ascontiguousarray(each) for name, each in feed.items() if each.size}
        high, low = np.split(self._session.run(feed)["product"], 2)
        return np.asarray((high * np.float32(1 << DIGIT_BITS) + low) * scales)


def _encode(block: Values) -> list[QuantizedRows]:
    head, rest = block[:, :HEAD_COLUMNS], block[:, HEAD_COLUMNS:]
    first = quantize(head)
    return [first, quantize(head - first.restored()), *([quantize(rest)] if rest.size else [])]


def _product_session(codes: Sequence[NDArray[np.int8]], scales: Sequence[Values], threads: int) -> Session:
    """`head` and `rest`, digits (count, columns), → `product` (count, rows), the sum over the parts.

    ONNX Runtime keeps a constant matrix in the order in which it multiplies it, and not as it was. One that is fed is
    brought into that order at each run, which takes longer than the product.
    """
    names = ["head", "head", "rest"][: len(codes)]
    matrices: dict[str, NDArray] = {f"codes_{i}": each for i, each in enumerate(codes)}
    matrices |= {f"scales_{i}": each for i, each in enumerate(scales)}
    nodes = []
    for i, name in enumerate(names):
        nodes += [
            node("MatMulInteger", [name, f"codes_{i}", "zero"], [f"sum_{i}"]),
            node("Cast", [f"sum_{i}"], [f"number_{i}"], to=FLOAT),
            node("Mul", [f"number_{i}", f"scales_{i}"], [f"product_{i}"]),
        ]
    nodes.append(node("Sum", [f"product_{i}" for i in range(len(codes))], ["product"]))
    widths = {name: len(code) for name, code in zip(names, codes, strict=True)}
    inputs = [tensor_value(name, "uint8", ["count", width]) for name, width in widths.items()]
    outputs = [tensor_value("product", "float32", ["count", codes[0].shape[1]])]
    return cpu_session("relight-mixes", nodes, inputs, outputs, {**_ZERO, **matrices}, threads)


@dataclass(frozen=True)
class _Group:
    """Clusters of one rank, and where they stand among those of all groups.

    Attributes:
        values: (clusters, tiles, 3, rank, PLACES_PER_TILE) int8.
        clusters: their place among all clusters.
        components: the place of their components among those of all clusters.
        products: the place of their products among all products of one light.
    """

    values: NDArray[np.int8]
    clusters: slice
    components: slice
    products: slice

    def amounts(self, digits: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Its part of the digits (some, 3, components) as (clusters, 1, 3, some, rank)."""
        clusters, _, channels, rank, _ = self.values.shape
        part = digits[:, :, self.components].reshape(-1, channels, clusters, 1, rank)
        return np.ascontiguousarray(part.transpose(2, 3, 1, 0, 4))

    def write(self, sums: NDArray[np.int32], scales: Values, products: Values) -> None:
        """Write what sums (clusters, tiles, 3, 2 · count, places) amount to into the products (count, all).

        Scales (count, 3, clusters of all groups) are the unit of a cluster's amounts.
        """
        clusters, tiles, channels, _, places = self.values.shape
        count = len(products)
        whole = np.multiply(sums[..., :count, :], np.float32(1 << DIGIT_BITS), dtype=np.float32)
        whole += sums[..., count:, :]
        scale = scales[:, :, self.clusters].transpose(0, 2, 1)[:, :, None, :, None]
        into = products[:, self.products].reshape(count, clusters, tiles, channels, places, copy=False)
        np.multiply(whole.transpose(3, 0, 1, 2, 4), scale, out=into)


class ClusterProducts:
    """In each cluster of pixels: amounts of its components × its values. Thread-safe.

    Attributes:
        size: how many products there are for one light.
        nbytes: bytes of the values.
    """

    def __init__(self, groups: Sequence[NDArray[np.int8]], threads: int = 1) -> None:
        """`groups` are values (clusters, 3, rank, places), with the same places each."""
        self._places = groups[0].shape[3]
        self._groups: list[_Group] = []
        clusters = components = products = 0
        for values in map(_tiled, groups):
            ends = clusters + len(values), components + len(values) * values.shape[3], products + _products(values)
            starts = clusters, components, products
            self._groups.append(_Group(values, *map(slice, starts, ends)))
            clusters, components, products = ends
        self.size = products
        self.nbytes = sum(group.values.nbytes for group in self._groups)
        self._ranks = np.repeat([values.shape[2] for values in groups], [len(values) for values in groups])
        self._first = np.cumsum(self._ranks) - self._ranks
        # Fed at each run, which copies nothing. ONNX Runtime brings no stack of matrices into the order of its products
        # beforehand, so as constants they would be no faster.
        self._values = {f"values_{i}": group.values for i, group in enumerate(self._groups)}
        self._session = _cluster_session([group.values.shape for group in self._groups], threads)

    def positions(self) -> Iterator[NDArray[np.intp]]:
        """Where each place's red stands among the products: (clusters, places) of each group; see `CHANNEL_STEPS`."""
        for group in self._groups:
            clusters, tiles, channels, _, places = group.values.shape
            order = np.arange(group.products.start, group.products.stop).reshape(clusters, tiles, channels, places)
            yield order[:, :, 0].reshape(clusters, -1)[:, : self._places]

    def __call__(self, amounts: Values) -> Values:
        """The products with amounts (3, count, components of all clusters): (count, size + 1).

        `positions` and `CHANNEL_STEPS` say which is which; the number behind all others is 0.
        """
        by_light = np.ascontiguousarray(amounts.transpose(1, 0, 2))
        largest = np.maximum.reduceat(np.abs(by_light), self._first, axis=2)
        scales = np.asarray(largest / MAX_FACTOR + np.float32(1e-30), np.float32)
        digits = digits_of(by_light, np.repeat(scales, self._ranks, axis=2))
        feed = {f"amounts_{i}": group.amounts(digits) for i, group in enumerate(self._groups)}
        sums = self._session.run({**feed, **self._values})
        products = np.empty((len(by_light), self.size + 1), np.float32)
        products[:, -1] = 0
        for i, group in enumerate(self._groups):
            group.write(sums[f"sums_{i}"], scales, products)
        return products


def _products(values: NDArray[np.int8]) -> int:
    """How many products values (clusters, tiles, 3, rank, places) have with one light."""
    return int(values.size // values.shape[3])


def _tiled(values: NDArray[np.int8]) -> NDArray[np.int8]:
    """Values (clusters, 3, rank, places) as (clusters, tiles, 3, rank, PLACES_PER_TILE), filled up with zeros."""
    clusters, _, rank, places = values.shape
    tiled = np.zeros((clusters, -(-places // PLACES_PER_TILE), 3, rank, PLACES_PER_TILE), np.int8)
    for tile in range(tiled.shape[1]):  # without a second copy of the whole, padded
        part = values[..., tile * PLACES_PER_TILE : (tile + 1) * PLACES_PER_TILE]
        tiled[:, tile, ..., : part.shape[-1]] = part
    return tiled


def _cluster_session(groups: Sequence[tuple[int, ...]], threads: int) -> Session:
    """Of each group `amounts`, digits (clusters, 1, 3, 2 · count, rank), × `values` of such a shape → `sums`, int32."""
    nodes, inputs, outputs = [], [], []
    for i, (clusters, tiles, channels, rank, places) in enumerate(groups):
        nodes.append(node("MatMulInteger", [f"amounts_{i}", f"values_{i}", "zero"], [f"sums_{i}"]))
        inputs += [
            tensor_value(f"amounts_{i}", "uint8", [clusters, 1, channels, "digits", rank]),
            tensor_value(f"values_{i}", "int8", [clusters, tiles, channels, rank, places]),
        ]
        outputs.append(tensor_value(f"sums_{i}", "int32", [clusters, tiles, channels, "digits", places]))
    return cpu_session("relight-clusters", nodes, inputs, outputs, _ZERO, threads)
