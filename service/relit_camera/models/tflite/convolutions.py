"""Convolution and pooling. Their pictures have channels first."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from relit_camera.models.tflite.activations import finish
from relit_camera.models.tflite.graph import Graph, Layout
from relit_camera.models.tflite.reader import Operator

_SAME = 0
"""`tflite.Padding.SAME`: the output has ceil(input / stride) cells."""


def conv_2d(graph: Graph, operator: Operator) -> None:
    """Weights are (out, height, width, in)."""
    kernel = graph.constant(operator.inputs[1]).transpose(0, 3, 1, 2)
    _convolve(graph, operator, kernel, group=graph.shape(operator.inputs[0])[3] // kernel.shape[1])


def depthwise_conv_2d(graph: Graph, operator: Operator) -> None:
    """Weights are (1, height, width, out); each input channel makes out / in of the outputs, in order."""
    kernel = graph.constant(operator.inputs[1]).transpose(3, 0, 1, 2)
    _convolve(graph, operator, kernel, group=graph.shape(operator.inputs[0])[3])


def transpose_conv_with_bias(graph: Graph, operator: Operator) -> None:
    """MediaPipe's custom Convolution2DTransposeBias: weights (out, height, width, in), each cell makes one patch."""
    source, weights, bias = operator.inputs
    target = operator.outputs[0]
    kernel = graph.constant(weights).transpose(3, 0, 1, 2)
    strides = tuple(graph.shape(target)[axis] // graph.shape(source)[axis] for axis in (1, 2))
    if strides != kernel.shape[2:]:
        raise graph.unsupported(f"a transposed convolution of {kernel.shape[2:]} cells has the stride {strides}")
    inputs = [
        graph.value(source, Layout.CHANNELS_FIRST),
        graph.initializer(kernel),
        graph.value(bias, Layout.TFLITE),
    ]
    graph.bind(target, graph.node("ConvTranspose", inputs, strides=strides), Layout.CHANNELS_FIRST)


def pool(onnx_operator: str) -> Callable[[Graph, Operator], None]:
    """Make the conversion to MaxPool or AveragePool; neither counts the cells beyond the border."""

    def convert(graph: Graph, operator: Operator) -> None:
        options = operator.options
        window, strides = (options.FilterHeight(), options.FilterWidth()), (options.StrideH(), options.StrideW())
        source = graph.value(operator.inputs[0], Layout.CHANNELS_FIRST)
        if onnx_operator == "AveragePool" and window == graph.shape(operator.inputs[0])[1:3]:
            value = graph.node("GlobalAveragePool", [source])
        else:
            pads = _pads(graph, operator, window, strides, (1, 1))
            value = graph.node(onnx_operator, [source], kernel_shape=window, strides=strides, pads=pads)
        finish(graph, operator, value, Layout.CHANNELS_FIRST)

    return convert


def _convolve(graph: Graph, operator: Operator, kernel: NDArray[np.float32], group: int) -> None:
    source, _, *bias = operator.inputs
    strides = (operator.options.StrideH(), operator.options.StrideW())
    dilations = (operator.options.DilationHFactor(), operator.options.DilationWFactor())
    inputs = [graph.value(source, Layout.CHANNELS_FIRST), graph.initializer(kernel)]
    inputs += [graph.value(tensor, Layout.TFLITE) for tensor in bias if tensor >= 0]
    pads = _pads(graph, operator, kernel.shape[2:], strides, dilations)
    value = graph.node("Conv", inputs, strides=strides, pads=pads, dilations=dilations, group=group)
    finish(graph, operator, value, Layout.CHANNELS_FIRST)


def _pads(
    graph: Graph, operator: Operator, window: tuple[int, ...], strides: tuple[int, ...], dilations: tuple[int, ...]
) -> list[int]:
    """Spell SAME out as ONNX's pads (top, left, bottom, right); an odd cell goes to the bottom and the right."""
    if operator.options.Padding() != _SAME:
        return [0, 0, 0, 0]
    sizes = graph.shape(operator.inputs[0])[1:3]
    total = [
        max((-(-size // stride) - 1) * stride + (cells - 1) * dilation + 1 - size, 0)
        for size, cells, stride, dilation in zip(sizes, window, strides, dilations, strict=True)
    ]
    before = [cells // 2 for cells in total]
    return [*before, *(cells - first for cells, first in zip(total, before, strict=True))]
