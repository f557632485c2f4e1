"""Written graphs, read by the package `onnx`."""

from __future__ import annotations

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from relit_camera.subject.relighting.onnx_graph import model, node, tensor_value

TENSOR = (np.arange(300, dtype=np.int8) - 100).reshape(3, 100)


def test_a_graph_is_what_the_package_onnx_writes() -> None:
    numbers = np.array([-1, 7, 1 << 40], np.int64)
    written = model(
        "name",
        [node("Transpose", ["a"], ["b"], perm=[1, 0, 2]), node("Cast", ["b"], ["c"], to=1)],
        [tensor_value("a", "uint8", ["count", 300, 3])],
        tensor_value("c", "float32", [300, "count", 3]),
        {"tensor": TENSOR, "numbers": numbers, "one": np.array(2.5, np.float32)},
        opset=21,
        ir_version=9,
    )
    expected = helper.make_model(
        helper.make_graph(
            [
                helper.make_node("Transpose", ["a"], ["b"], perm=[1, 0, 2]),
                helper.make_node("Cast", ["b"], ["c"], to=TensorProto.FLOAT),
            ],
            "name",
            [helper.make_tensor_value_info("a", TensorProto.UINT8, ["count", 300, 3])],
            [helper.make_tensor_value_info("c", TensorProto.FLOAT, [300, "count", 3])],
            [
                numpy_helper.from_array(TENSOR, "tensor"),
                numpy_helper.from_array(numbers, "numbers"),
                numpy_helper.from_array(np.array(2.5, np.float32), "one"),
            ],
        ),
        opset_imports=[helper.make_opsetid("", 21)],
        ir_version=9,
    )
    read = onnx.load_from_string(written)
    onnx.checker.check_model(read)
    assert read == expected
