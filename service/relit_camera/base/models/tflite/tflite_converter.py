"""From the bytes of a TFLite file to those of an ONNX model.

Semantics are those of TensorFlow Lite's reference kernels (github.com/tensorflow/tensorflow, lite/kernels). The same
bytes in give the same bytes out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from onnx import helper

from relit_camera.base.models.tflite import operators, region_operators
from relit_camera.base.models.tflite.onnx_graph_builder import Layout, OnnxGraphBuilder
from relit_camera.base.models.tflite.operators import (
    binary,
    conv_2d,
    depthwise_conv_2d,
    pool,
    prelu,
    squared_difference,
    transpose_conv_with_bias,
    unary,
)
from relit_camera.base.models.tflite.prelu_expansion import expand_prelus
from relit_camera.base.models.tflite.tflite_reader import Operator, read_tflite

_OPSET = 18
_IR_VERSION = 8
"""Fixed, and the oldest that fit together, so that the bytes do not depend on the installed version of `onnx`."""


def dequantize(graph: OnnxGraphBuilder, operator: Operator) -> None:
    """Turn float16 weights into float32: exact, and no Cast has to be folded at each load; the file stays local."""
    weights = graph.constant(operator.inputs[0])
    if weights.dtype != np.float16:
        raise graph.unsupported(f"it has {weights.dtype.name} weights")
    graph.set_constant(operator.outputs[0], weights.astype(np.float32))


OPERATORS: Mapping[str, Callable[[OnnxGraphBuilder, Operator], None]] = {
    "ADD": binary("Add"),
    "AVERAGE_POOL_2D": pool("AveragePool"),
    "CONCATENATION": operators.concatenation,
    "CONV_2D": conv_2d,
    "Convolution2DTransposeBias": transpose_conv_with_bias,
    "DEPTHWISE_CONV_2D": depthwise_conv_2d,
    "DEQUANTIZE": dequantize,
    "DIV": binary("Div"),
    "HARD_SWISH": unary("HardSwish"),
    "Landmarks2TransformMatrix": region_operators.region_matrix,
    "LOGISTIC": unary("Sigmoid"),
    "MAX_POOL_2D": pool("MaxPool"),
    "MEAN": operators.reduce("ReduceMean"),
    "MUL": binary("Mul"),
    "NEG": unary("Neg"),
    "PAD": operators.pad,
    "PRELU": prelu,
    "RELU": unary("Relu"),
    "RESHAPE": operators.reshape,
    "RESIZE_BILINEAR": operators.resize_bilinear,
    "RSQRT": unary("Sqrt", "Reciprocal"),
    "SQRT": unary("Sqrt"),
    "SQUARED_DIFFERENCE": squared_difference,
    "STRIDED_SLICE": operators.strided_slice,
    "SUB": binary("Sub"),
    "SUM": operators.reduce("ReduceSum"),
    "TRANSPOSE": operators.transpose,
    "TransformLandmarks": region_operators.transform_landmarks,
    "TransformTensorBilinear": region_operators.cut_region,
}
"""Each adds the ONNX nodes of one TFLite operator to the graph."""


def convert_tflite_to_onnx(data: bytes, name: str, inputs: Sequence[str], outputs: Sequence[str]) -> bytes:
    """Convert a TFLite file to an ONNX model whose inputs and outputs carry these names, in the file's order.

    Shapes and layouts of inputs and outputs are the file's own, so pictures are (1, height, width, channel).

    Raises:
        ModelError: the file is damaged, has an operator that is not in `OPERATORS`, or other inputs and outputs.
    """
    network = read_tflite(data, name)
    graph = OnnxGraphBuilder(network, name)
    if (len(network.inputs), len(network.outputs)) != (len(inputs), len(outputs)):
        found = f"{len(network.inputs)} inputs and {len(network.outputs)} outputs"
        raise graph.unsupported(f"it has {found}, not {len(inputs)} and {len(outputs)}")
    for tensor, value in zip(network.inputs, inputs, strict=True):
        graph.bind(tensor, value, Layout.TFLITE)
    for operator in network.operators:
        if operator.kind not in OPERATORS:
            raise graph.unsupported(f"it has the operator {operator.kind}")
        OPERATORS[operator.kind](graph, operator)
    built = graph.build(inputs, outputs)
    expand_prelus(built)
    model = helper.make_model(
        built,
        opset_imports=[helper.make_opsetid("", _OPSET)],
        ir_version=_IR_VERSION,
        producer_name="relit-camera",
    )
    return bytes(model.SerializeToString(deterministic=True))
