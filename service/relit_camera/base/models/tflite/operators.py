"""Converts each TFLite operator to ONNX nodes: element-wise functions, convolution and pooling, changes of shape.

Convolution and pooling work on pictures with the channels first, as ONNX defines them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.models.tflite.onnx_graph_builder import Layout, OnnxGraphBuilder
from relit_camera.base.models.tflite.tflite_reader import Operator

_FUSED_ACTIVATIONS = {0: (), 1: ("Relu",)}
"""ONNX's operators for `tflite.ActivationFunctionType`: none and RELU."""


def apply_fused_activation(graph: OnnxGraphBuilder, operator: Operator, value: str, layout: Layout) -> None:
    """Apply the operator's fused activation to `value` and bind it to the operator's output."""
    activation = operator.options.FusedActivationFunction()
    if activation not in _FUSED_ACTIVATIONS:
        raise graph.unsupported(f"the fused activation {activation} of {operator.kind}")
    for onnx_operator in _FUSED_ACTIVATIONS[activation]:
        value = graph.node(onnx_operator, [value])
    graph.bind(operator.outputs[0], value, layout)


def unary(*onnx_operators: str) -> Callable[[OnnxGraphBuilder, Operator], None]:
    """Make the conversion to these operators of one input, one after the other."""

    def convert(graph: OnnxGraphBuilder, operator: Operator) -> None:
        layout = graph.common_layout(operator.inputs)
        value = graph.value(operator.inputs[0], layout)
        for onnx_operator in onnx_operators:
            value = graph.node(onnx_operator, [value])
        graph.bind(operator.outputs[0], value, layout)

    return convert


def binary(onnx_operator: str) -> Callable[[OnnxGraphBuilder, Operator], None]:
    """Make the conversion to this operator of two inputs, which are broadcast alike in TFLite and ONNX."""

    def convert(graph: OnnxGraphBuilder, operator: Operator) -> None:
        layout = graph.common_layout(operator.inputs)
        value = graph.node(onnx_operator, [graph.value(tensor, layout) for tensor in operator.inputs])
        apply_fused_activation(graph, operator, value, layout)

    return convert


def squared_difference(graph: OnnxGraphBuilder, operator: Operator) -> None:
    """Square the difference of two inputs."""
    layout = graph.common_layout(operator.inputs)
    difference = graph.node("Sub", [graph.value(tensor, layout) for tensor in operator.inputs])
    graph.bind(operator.outputs[0], graph.node("Mul", [difference, difference]), layout)


def prelu(graph: OnnxGraphBuilder, operator: Operator) -> None:
    """Keep x where x > 0, else s·x, with a slope s for each channel; `expand_prelus` makes it fast."""
    source, slopes = operator.inputs
    layout = graph.common_layout([source])
    slope = graph.initializer(graph.constant(slopes), layout)
    graph.bind(operator.outputs[0], graph.node("PRelu", [graph.value(source, layout), slope]), layout)


_SAME_PADDING = 0
"""`tflite.Padding.SAME`: the output has ceil(input / stride) cells."""


def conv_2d(graph: OnnxGraphBuilder, operator: Operator) -> None:
    """Weights are (out, height, width, in)."""
    kernel = graph.constant(operator.inputs[1]).transpose(0, 3, 1, 2)
    _convolve(graph, operator, kernel, group=graph.shape(operator.inputs[0])[3] // kernel.shape[1])


def depthwise_conv_2d(graph: OnnxGraphBuilder, operator: Operator) -> None:
    """Weights are (1, height, width, out); each input channel makes out / in of the outputs, in order."""
    kernel = graph.constant(operator.inputs[1]).transpose(3, 0, 1, 2)
    _convolve(graph, operator, kernel, group=graph.shape(operator.inputs[0])[3])


def transpose_conv_with_bias(graph: OnnxGraphBuilder, operator: Operator) -> None:
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


def pool(onnx_operator: str) -> Callable[[OnnxGraphBuilder, Operator], None]:
    """Make the conversion to MaxPool or AveragePool; neither counts the cells beyond the border."""

    def convert(graph: OnnxGraphBuilder, operator: Operator) -> None:
        options = operator.options
        window, strides = (options.FilterHeight(), options.FilterWidth()), (options.StrideH(), options.StrideW())
        source = graph.value(operator.inputs[0], Layout.CHANNELS_FIRST)
        if onnx_operator == "AveragePool" and window == graph.shape(operator.inputs[0])[1:3]:
            value = graph.node("GlobalAveragePool", [source])
        else:
            pads = _pads(graph, operator, window, strides, (1, 1))
            value = graph.node(onnx_operator, [source], kernel_shape=window, strides=strides, pads=pads)
        apply_fused_activation(graph, operator, value, Layout.CHANNELS_FIRST)

    return convert


def _convolve(graph: OnnxGraphBuilder, operator: Operator, kernel: NDArray[np.float32], group: int) -> None:
    source, _, *bias = operator.inputs
    strides = (operator.options.StrideH(), operator.options.StrideW())
    dilations = (operator.options.DilationHFactor(), operator.options.DilationWFactor())
    inputs = [graph.value(source, Layout.CHANNELS_FIRST), graph.initializer(kernel)]
    inputs += [graph.value(tensor, Layout.TFLITE) for tensor in bias if tensor >= 0]
    pads = _pads(graph, operator, kernel.shape[2:], strides, dilations)
    value = graph.node("Conv", inputs, strides=strides, pads=pads, dilations=dilations, group=group)
    apply_fused_activation(graph, operator, value, Layout.CHANNELS_FIRST)


def _pads(
    graph: OnnxGraphBuilder,
    operator: Operator,
    window: tuple[int, ...],
    strides: tuple[int, ...],
    dilations: tuple[int, ...],
) -> list[int]:
    """Spell SAME out as ONNX's pads (top, left, bottom, right); an odd cell goes to the bottom and the right."""
    if operator.options.Padding() != _SAME_PADDING:
        return [0, 0, 0, 0]
    sizes = graph.shape(operator.inputs[0])[1:3]
    total = [
        max((-(-size // stride) - 1) * stride + (cells - 1) * dilation + 1 - size, 0)
        for size, cells, stride, dilation in zip(sizes, window, strides, dilations, strict=True)
    ]
    before = [cells // 2 for cells in total]
    return [*before, *(cells - first for cells, first in zip(total, before, strict=True))]


_TO_THE_END = int(np.iinfo(np.int64).max)


def reduce(onnx_operator: str) -> Callable[[OnnxGraphBuilder, Operator], None]:
    """Make the conversion to ReduceMean or ReduceSum."""

    def convert(graph: OnnxGraphBuilder, operator: Operator) -> None:
        source, target = operator.inputs[0], operator.outputs[0]
        keep = bool(operator.options.KeepDims())
        layout = graph.common_layout([source]) if keep else Layout.TFLITE
        rank = len(graph.shape(source))
        axes = sorted(layout.axis(int(axis), rank) for axis in np.atleast_1d(graph.constant(operator.inputs[1])))
        value = graph.value(source, layout)
        if onnx_operator == "ReduceMean" and layout is Layout.CHANNELS_FIRST and axes == [2, 3]:
            result = graph.node("GlobalAveragePool", [value])
        else:
            result = graph.node(onnx_operator, [value, graph.integers(axes)], keepdims=int(keep))
        graph.bind(target, result, layout)

    return convert


def pad(graph: OnnxGraphBuilder, operator: Operator) -> None:
    """Pad with zeros; the pads are (rank, 2): before and after each axis.

    Channels alone are padded by a convolution, since ONNX Runtime's Pad leaves its blocked layout.
    """
    source = operator.inputs[0]
    layout = graph.common_layout([source])
    value, pads = graph.value(source, layout), graph.constant(operator.inputs[1])
    if layout is Layout.CHANNELS_FIRST:
        pads = pads[list(layout.value)]
        if not pads[[0, 2, 3]].any():
            channels = graph.shape(source)[3]
            kept = np.pad(np.eye(channels, dtype=np.float32), [pads[1], (0, 0)])
            graph.bind(
                operator.outputs[0], graph.node("Conv", [value, graph.initializer(kept[..., None, None])]), layout
            )
            return
    graph.bind(operator.outputs[0], graph.node("Pad", [value, graph.integers(pads.T.ravel().tolist())]), layout)


def concatenation(graph: OnnxGraphBuilder, operator: Operator) -> None:
    """Join along one axis."""
    layout = graph.common_layout(operator.inputs)
    axis = layout.axis(operator.options.Axis(), len(graph.shape(operator.outputs[0])))
    value = graph.node("Concat", [graph.value(tensor, layout) for tensor in operator.inputs], axis=axis)
    apply_fused_activation(graph, operator, value, layout)


def reshape(graph: OnnxGraphBuilder, operator: Operator) -> None:
    """Give the elements, in TFLite's order, another shape."""
    _reshape(graph, operator, graph.value(operator.inputs[0], Layout.TFLITE))


def transpose(graph: OnnxGraphBuilder, operator: Operator) -> None:
    """Permute the axes."""
    permutation = graph.constant(operator.inputs[1]).tolist()
    value = graph.node("Transpose", [graph.value(operator.inputs[0], Layout.TFLITE)], perm=permutation)
    graph.bind(operator.outputs[0], value, Layout.TFLITE)


def strided_slice(graph: OnnxGraphBuilder, operator: Operator) -> None:
    """Cut begin:end:stride out of each axis; bits of the masks say where an axis is taken whole, or dropped."""
    source, *bounds = operator.inputs
    begin, end, strides = (graph.constant(tensor).tolist() for tensor in bounds)
    options = operator.options
    if min(strides) < 1 or options.EllipsisMask() or options.NewAxisMask() or options.Offset():
        raise graph.unsupported("a slice that runs backward, or with an ellipsis, a new axis or an offset")
    axes = range(len(begin))
    dropped = [bool(options.ShrinkAxisMask() >> axis & 1) for axis in axes]
    starts = [0 if options.BeginMask() >> axis & 1 else begin[axis] for axis in axes]
    ends = [_TO_THE_END if options.EndMask() >> axis & 1 else end[axis] for axis in axes]
    ends = [starts[axis] + 1 or _TO_THE_END if dropped[axis] else ends[axis] for axis in axes]
    bounds_of_slice = [graph.integers(values) for values in (starts, ends, list(axes), strides)]
    _reshape(graph, operator, graph.node("Slice", [graph.value(source, Layout.TFLITE), *bounds_of_slice]))


def resize_bilinear(graph: OnnxGraphBuilder, operator: Operator) -> None:
    """Resize to a constant (height, width)."""
    source, size = operator.inputs
    if operator.options.AlignCorners():
        mode = "align_corners"
    else:
        mode = "half_pixel" if operator.options.HalfPixelCenters() else "asymmetric"
    batch, _, _, channels = graph.shape(source)
    sizes = graph.integers([batch, channels, *graph.constant(size).tolist()])
    inputs = [graph.value(source, Layout.CHANNELS_FIRST), "", "", sizes]
    value = graph.node("Resize", inputs, mode="linear", coordinate_transformation_mode=mode)
    graph.bind(operator.outputs[0], value, Layout.CHANNELS_FIRST)


def _reshape(graph: OnnxGraphBuilder, operator: Operator, value: str) -> None:
    """Bind `value` to the output in its shape, which TFLite has inferred already."""
    target = operator.outputs[0]
    shape = graph.integers(graph.shape(target))
    graph.bind(target, graph.node("Reshape", [value, shape]), Layout.TFLITE)
