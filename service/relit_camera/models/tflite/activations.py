"""Element-wise functions, and the activation that TFLite fuses into other operators."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from relit_camera.models.tflite.graph import Graph, Layout
from relit_camera.models.tflite.reader import Operator

_FUSED = {0: (), 1: ("Relu",)}
"""ONNX's operators for `tflite.ActivationFunctionType`: none and RELU."""


def finish(graph: Graph, operator: Operator, value: str, layout: Layout) -> None:
    """Apply the operator's fused activation to `value` and bind it to the operator's output."""
    activation = operator.options.FusedActivationFunction()
    if activation not in _FUSED:
        raise graph.unsupported(f"the fused activation {activation} of {operator.kind}")
    for onnx_operator in _FUSED[activation]:
        value = graph.node(onnx_operator, [value])
    graph.bind(operator.outputs[0], value, layout)


def unary(*onnx_operators: str) -> Callable[[Graph, Operator], None]:
    """Make the conversion to these operators of one input, one after the other."""

    def convert(graph: Graph, operator: Operator) -> None:
        layout = graph.common_layout(operator.inputs)
        value = graph.value(operator.inputs[0], layout)
        for onnx_operator in onnx_operators:
            value = graph.node(onnx_operator, [value])
        graph.bind(operator.outputs[0], value, layout)

    return convert


def binary(onnx_operator: str) -> Callable[[Graph, Operator], None]:
    """Make the conversion to this operator of two inputs, which are broadcast alike in TFLite and ONNX."""

    def convert(graph: Graph, operator: Operator) -> None:
        layout = graph.common_layout(operator.inputs)
        value = graph.node(onnx_operator, [graph.value(tensor, layout) for tensor in operator.inputs])
        finish(graph, operator, value, layout)

    return convert


def squared_difference(graph: Graph, operator: Operator) -> None:
    """Square the difference of two inputs."""
    layout = graph.common_layout(operator.inputs)
    difference = graph.node("Sub", [graph.value(tensor, layout) for tensor in operator.inputs])
    graph.bind(operator.outputs[0], graph.node("Mul", [difference, difference]), layout)


def prelu(graph: Graph, operator: Operator) -> None:
    """Keep x where x > 0, else s·x; written s·x + (1 - s)·max(x, 0).

    ONNX Runtime's own PRelu leaves its blocked layout: the face mesh takes three times as long with it. max(x, s·x)
    would be wrong, since slopes go up to 19.8.
    """
    source, slopes = operator.inputs
    layout = graph.common_layout([source])
    value, slope = graph.value(source, layout), graph.constant(slopes)
    scaled = graph.node("Mul", [value, graph.initializer(slope, layout)])
    rest = graph.node("Mul", [graph.node("Relu", [value]), graph.initializer(np.float32(1) - slope, layout)])
    graph.bind(operator.outputs[0], graph.node("Add", [scaled, rest]), layout)
