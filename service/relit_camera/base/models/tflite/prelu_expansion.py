"""Replaces ONNX's PRelu by convolutions, which ONNX Runtime runs in its blocked layout.

Its own PRelu leaves that layout: the face mesh takes three times as long with it. max(x, s·x) would be wrong, since
slopes go up to 19.8. Two forms are exact:

- prelu(x) = x + (1 - s)·relu(-x). Both products are convolutions of single channels, which take the relu and the sum
  along: two passes over x.
- prelu(x) = relu(x) - s·relu(-x), for x from a convolution to few channels and on to a depthwise and a 1×1 one. All
  three work on x and -x side by side, and the last one's weights do the rest: no pass of its own. Channels come in
  blocks of 8 or 16, so where there are at most 8, twice as many cost little.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import helper, numpy_helper

_FEW_CHANNELS = 8


def expand_prelus(graph: onnx.GraphProto) -> None:
    """Replace every PRelu of a slope for each channel, (1, channels, 1, 1) or a vector's last axis, in place."""
    expansion = _Expansion(graph)
    for node in graph.node:
        if node.op_type == "PRelu":
            block = expansion.bottleneck(node)
            if block is None:
                expansion.add_negative_part(node)
            else:
                expansion.double_channels(node, *block)
    expansion.apply()


class _Expansion:
    def __init__(self, graph: onnx.GraphProto) -> None:
        self._graph = graph
        self._constants = {tensor.name: numpy_helper.to_array(tensor) for tensor in graph.initializer}
        self._makers = {output: node for node in graph.node for output in node.output}
        self._users: dict[str, list[onnx.NodeProto]] = {}
        for node in graph.node:
            for value in node.input:
                self._users.setdefault(value, []).append(node)
        self._replaced: dict[str, list[onnx.NodeProto]] = {}

    def bottleneck(self, prelu: onnx.NodeProto) -> tuple[onnx.NodeProto, onnx.NodeProto, onnx.NodeProto] | None:
        """The convolutions before the PRelu (to few channels), after it (depthwise), and after that (ungrouped)."""
        before = self._makers.get(prelu.input[0])
        depthwise = self._only_convolution_of(prelu.output[0])
        last = self._only_convolution_of(depthwise.output[0]) if depthwise else None
        if before is None or before.op_type != "Conv" or depthwise is None or last is None:
            return None
        channels = len(self._constants[before.input[1]])
        chained = self._users[before.output[0]] == [prelu] and _group(before) == _group(last) == 1
        has_biases = all(len(node.input) == 3 for node in (before, depthwise))
        fits = channels <= _FEW_CHANNELS and _group(depthwise) == channels == len(self._constants[depthwise.input[1]])
        return (before, depthwise, last) if chained and has_biases and fits else None

    def double_channels(
        self, prelu: onnx.NodeProto, before: onnx.NodeProto, depthwise: onnx.NodeProto, last: onnx.NodeProto
    ) -> None:
        """Write relu(x) - s·relu(-x) into the convolutions around."""
        slope = self._constants[prelu.input[1]].ravel()
        weights, bias = (self._constants[name] for name in before.input[1:])
        parts = self._convolution(before, before.input[0], np.concatenate([weights, -weights]), [bias, -bias])
        positive = helper.make_node("Relu", parts.output, [f"{prelu.output[0]}_parts"])
        weights, bias = (self._constants[name] for name in depthwise.input[1:])
        spread = self._convolution(
            depthwise,
            positive.output[0],
            np.concatenate([weights, weights]),
            [bias, np.zeros_like(bias)],  # it counts once
            group=2 * len(slope),
        )
        weights = self._constants[last.input[1]]
        joined = self._convolution(
            last, spread.output[0], np.concatenate([weights, -weights * slope[:, None, None]], 1), None
        )
        joined.input.extend(last.input[2:])
        joined.output[0] = last.output[0]
        for node in (before, prelu, depthwise):
            self._replaced[node.output[0]] = []
        self._replaced[last.output[0]] = [parts, positive, spread, joined]

    def add_negative_part(self, prelu: onnx.NodeProto) -> None:
        """Write x + (1 - s)·relu(-x)."""
        (value, slopes), output = prelu.input, prelu.output[0]
        slope = self._constants[slopes]
        negative, part, rest = (f"{output}_{name}" for name in ("negative", "part", "rest"))
        self._replaced[output] = [
            helper.make_node("Mul", [value, self._constant(f"{output}_sign", np.full_like(slope, -1))], [negative]),
            helper.make_node("Relu", [negative], [part]),
            helper.make_node("Mul", [part, self._constant(f"{output}_gain", np.float32(1) - slope)], [rest]),
            helper.make_node("Add", [rest, value], [output]),
        ]

    def apply(self) -> None:
        """Write the nodes and the constants that they use into the graph."""
        nodes = [new for node in self._graph.node for new in self._replaced.get(node.output[0], [node])]
        used = {value for node in nodes for value in node.input}
        constants = [numpy_helper.from_array(data, name) for name, data in self._constants.items() if name in used]
        for field, values in ((self._graph.node, nodes), (self._graph.initializer, constants)):
            kept: list[Any] = list(values)
            del field[:]
            field.extend(kept)

    def _only_convolution_of(self, value: str) -> onnx.NodeProto | None:
        users = self._users.get(value, [])
        return users[0] if len(users) == 1 and users[0].op_type == "Conv" else None

    def _convolution(
        self,
        like: onnx.NodeProto,
        value: str,
        weights: NDArray[np.float32],
        biases: Sequence[NDArray[np.float32]] | None,
        group: int = 1,
    ) -> onnx.NodeProto:
        output = f"{like.output[0]}_parts"
        inputs = [value, self._constant(f"{output}_weights", weights)]
        if biases is not None:
            inputs.append(self._constant(f"{output}_bias", np.concatenate(biases)))
        attributes = {entry.name: helper.get_attribute_value(entry) for entry in like.attribute}
        return helper.make_node("Conv", inputs, [output], **{**attributes, "group": group})

    def _constant(self, name: str, data: NDArray[np.float32]) -> str:
        self._constants[name] = np.ascontiguousarray(data, dtype=np.float32)
        return name


def _group(convolution: onnx.NodeProto) -> int:
    return next((int(entry.i) for entry in convolution.attribute if entry.name == "group"), 1)
