"""Operators that reduce, resize or rearrange."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from relit_camera.models.tflite.activations import finish
from relit_camera.models.tflite.graph import Graph, Layout
from relit_camera.models.tflite.reader import Operator

_TO_THE_END = int(np.iinfo(np.int64).max)


def reduce(onnx_operator: str) -> Callable[[Graph, Operator], None]:
    """Make the conversion to ReduceMean or ReduceSum."""

    def convert(graph: Graph, operator: Operator) -> None:
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


def pad(graph: Graph, operator: Operator) -> None:
    """Pad with zeros; the pads are (rank, 2): before and after each axis."""
    source = operator.inputs[0]
    layout = graph.common_layout([source])
    pads = graph.constant(operator.inputs[1])
    if layout is Layout.CHANNELS_FIRST:
        pads = pads[list(layout.value)]
    inputs = [graph.value(source, layout), graph.integers(pads.T.ravel().tolist())]
    graph.bind(operator.outputs[0], graph.node("Pad", inputs), layout)


def concatenation(graph: Graph, operator: Operator) -> None:
    """Join along one axis."""
    layout = graph.common_layout(operator.inputs)
    axis = layout.axis(operator.options.Axis(), len(graph.shape(operator.outputs[0])))
    value = graph.node("Concat", [graph.value(tensor, layout) for tensor in operator.inputs], axis=axis)
    finish(graph, operator, value, layout)


def reshape(graph: Graph, operator: Operator) -> None:
    """Give the elements, in TFLite's order, another shape."""
    _reshape(graph, operator, graph.value(operator.inputs[0], Layout.TFLITE))


def transpose(graph: Graph, operator: Operator) -> None:
    """Permute the axes."""
    permutation = graph.constant(operator.inputs[1]).tolist()
    value = graph.node("Transpose", [graph.value(operator.inputs[0], Layout.TFLITE)], perm=permutation)
    graph.bind(operator.outputs[0], value, Layout.TFLITE)


def strided_slice(graph: Graph, operator: Operator) -> None:
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


def resize_bilinear(graph: Graph, operator: Operator) -> None:
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


def _reshape(graph: Graph, operator: Operator, value: str) -> None:
    """Bind `value` to the output in its shape, which TFLite has inferred already."""
    target = operator.outputs[0]
    shape = graph.integers(graph.shape(target))
    graph.bind(target, graph.node("Reshape", [value, shape]), Layout.TFLITE)
