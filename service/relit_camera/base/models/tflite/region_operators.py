"""Converts MediaPipe's operators of networks with attention: they look closer at a region around some landmarks.

The region is a turned rectangle in the picture of features. A matrix (1, 4, 4) takes its pixels to those of that
picture; only rows x and y and columns x, y and 1 are used. Semantics are those of MediaPipe's kernels of version 2
(github.com/google-ai-edge/mediapipe, util/tflite/operations).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from onnx import TensorProto

from relit_camera.base.models.tflite.onnx_graph_builder import Layout, OnnxGraphBuilder
from relit_camera.base.models.tflite.tflite_reader import Operator


def region_matrix(graph: OnnxGraphBuilder, operator: Operator) -> None:
    """Landmarks2TransformMatrix: the box around some landmarks, turned as two of them lie, and scaled."""
    options = _options(graph, operator)
    landmarks = graph.value(operator.inputs[0], Layout.TFLITE)
    points = graph.node("Gather", [landmarks, graph.integers([0, 1])], axis=2)
    left, right = (
        graph.node("Gather", [points, graph.integers([options[key]])], axis=1)
        for key in ("left_rotation_idx", "right_rotation_idx")
    )
    across = graph.node("Sub", [right, left])
    length = graph.node("ReduceL2", [across, graph.integers([2])], keepdims=1)
    # Rows of points times `upright` turn them by the target's angle less that of `across`, (cos, sin).
    cos, sin = math.cos(options["target_rotation_radians"]), math.sin(options["target_rotation_radians"])
    entries = np.array([[cos, sin, -sin, cos], [sin, -cos, cos, sin]], np.float32)
    upright = graph.node(
        "Reshape",
        [
            graph.node("MatMul", [graph.node("Div", [across, length]), graph.initializer(entries)]),
            graph.integers([1, 2, 2]),
        ],
    )
    back = graph.node("Transpose", [upright], perm=(0, 2, 1))
    chosen = graph.node("Gather", [points, graph.integers(list(options["subset_idxs"]))], axis=1)
    turned = graph.node("MatMul", [chosen, upright])
    largest, smallest = (
        graph.node(kind, [turned, graph.integers([1])], keepdims=1) for kind in ("ReduceMax", "ReduceMin")
    )
    half = graph.initializer(np.array(0.5, np.float32))
    middle = graph.node("Mul", [graph.node("Add", [largest, smallest]), half])
    center = graph.node("MatMul", [middle, back])
    size = np.array([options["output_width"], options["output_height"]], np.float32)
    scale = np.array([options["scale_x"], options["scale_y"]], np.float32) / size
    steps = graph.node("Mul", [graph.node("Sub", [largest, smallest]), graph.initializer(scale)])
    # A row of `axes` for each of the region's axes: where one of its pixels leads to.
    axes = graph.node("Mul", [graph.node("Transpose", [steps], perm=(0, 2, 1)), back])
    corner = graph.node("Sub", [center, graph.node("MatMul", [graph.initializer(size[None, None] / 2), axes])])
    none = graph.initializer(np.zeros((1, 1, 2), np.float32))
    rows = graph.node("Concat", [axes, none, corner], axis=1)
    others = graph.initializer(np.array([[[0, 0], [0, 0], [1, 0], [0, 1]]], np.float32))
    matrix = graph.node("Transpose", [graph.node("Concat", [rows, others], axis=2)], perm=(0, 2, 1))
    graph.bind(operator.outputs[0], matrix, Layout.TFLITE)


def cut_region(graph: OnnxGraphBuilder, operator: Operator) -> None:
    """TransformTensorBilinear: the region of a picture, bilinear; 0 where its pixels' centres lie outside."""
    options = _options(graph, operator)
    source, matrix = operator.inputs
    rows, columns = options["output_height"], options["output_width"]
    _, height, width, _ = graph.shape(source)
    y, x = np.mgrid[:rows, :columns].reshape(2, -1) + np.float32(0.5)
    pixels = graph.initializer(np.stack([x, y], axis=1).astype(np.float32)[None])
    half = graph.initializer(np.array(0.5, np.float32))
    places = graph.node("Sub", [_transformed(graph, pixels, graph.value(matrix, Layout.TFLITE)), half])
    last = np.array([width - 1, height - 1], np.float32)
    inside = graph.node("Max", [places, graph.initializer(np.array(0, np.float32))])
    inside = graph.node("Min", [inside, graph.initializer(last)])
    shares = graph.node("Mul", [inside, graph.initializer(2 / last)])  # -1 to 1 from the first centre to the last one
    shares = graph.node("Sub", [shares, graph.initializer(np.array(1, np.float32))])
    grid = graph.node("Reshape", [shares, graph.integers([1, rows, columns, 2])])
    picture = graph.value(source, Layout.CHANNELS_FIRST)
    sampled = graph.node("GridSample", [picture, grid], mode="bilinear", padding_mode="border", align_corners=1)
    same = graph.node("Cast", [graph.node("Equal", [places, inside])], to=TensorProto.FLOAT)
    mask = graph.node("ReduceMin", [same, graph.integers([2])], keepdims=0)
    mask = graph.node("Reshape", [mask, graph.integers([1, 1, rows, columns])])
    graph.bind(operator.outputs[0], graph.node("Mul", [sampled, mask]), Layout.CHANNELS_FIRST)


def transform_landmarks(graph: OnnxGraphBuilder, operator: Operator) -> None:
    """TransformLandmarks: landmarks (1, count, 2) of the region, in the picture's pixels."""
    landmarks, matrix = operator.inputs
    if graph.shape(landmarks)[2] != 2:
        raise graph.unsupported(f"landmarks of {graph.shape(landmarks)[2]} dimensions in a region")
    values = (graph.value(tensor, Layout.TFLITE) for tensor in (landmarks, matrix))
    graph.bind(operator.outputs[0], _transformed(graph, *values), Layout.TFLITE)


def _transformed(graph: OnnxGraphBuilder, points: str, matrix: str) -> str:
    """Points (1, count, 2) through a matrix (1, 4, 4)."""
    top = graph.node("Slice", [matrix, *(graph.integers(values) for values in ([0], [2], [1]))])
    columns = graph.node("Transpose", [top], perm=(0, 2, 1))
    axes = graph.node("Gather", [columns, graph.integers([0, 1])], axis=1)
    shift = graph.node("Gather", [columns, graph.integers([3])], axis=1)
    return graph.node("Add", [graph.node("MatMul", [points, axes]), shift])


def _options(graph: OnnxGraphBuilder, operator: Operator) -> dict[str, Any]:
    """The custom operator's options.

    Raises:
        ModelError: it has none.
    """
    if not isinstance(operator.options, dict):
        raise graph.unsupported(f"{operator.kind} has no options")
    return operator.options
