"""Written graphs, read by the package `onnx` and run."""

from __future__ import annotations

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from relit_camera.subject.relighting.onnx_graph import IR_VERSION, OPSET, cpu_session, model, node, tensor_value

MATRIX = (np.arange(300, dtype=np.int8) - 100).reshape(3, 100)
ZERO = np.array(64, np.uint8)
CONSTANTS = {"matrix": MATRIX, "zero": ZERO}
NODES = [node("MatMulInteger", ["a", "matrix", "zero"], ["b"]), node("Cast", ["b"], ["c"], to=1)]
INPUTS = [tensor_value("a", "uint8", ["count", 3])]
OUTPUTS = [tensor_value("b", "int32", ["count", 100]), tensor_value("c", "float32", ["count", 100])]


def external(name: str, value: np.ndarray) -> TensorProto:
    tensor = TensorProto(name=name, data_type=helper.np_dtype_to_tensor_dtype(value.dtype), dims=value.shape)
    tensor.data_location = TensorProto.EXTERNAL
    for key, text in {"location": name, "offset": "0", "length": str(value.nbytes)}.items():
        tensor.external_data.add(key=key, value=text)
    return tensor


def test_a_graph_is_what_the_package_onnx_writes() -> None:
    expected = helper.make_model(
        helper.make_graph(
            [
                helper.make_node("MatMulInteger", ["a", "matrix", "zero"], ["b"]),
                helper.make_node("Cast", ["b"], ["c"], to=TensorProto.FLOAT),
            ],
            "name",
            [helper.make_tensor_value_info("a", TensorProto.UINT8, ["count", 3])],
            [
                helper.make_tensor_value_info("b", TensorProto.INT32, ["count", 100]),
                helper.make_tensor_value_info("c", TensorProto.FLOAT, ["count", 100]),
            ],
            [external(name, value) for name, value in CONSTANTS.items()],
        ),
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
    )
    read = onnx.load_from_string(model("name", NODES, INPUTS, OUTPUTS, CONSTANTS))
    assert read == expected
    for tensor, value in zip(read.graph.initializer, CONSTANTS.values(), strict=True):
        tensor.CopyFrom(numpy_helper.from_array(value, tensor.name))  # external ones are files to the checker
    onnx.checker.check_model(read, full_check=True)


def test_a_graph_runs_on_the_constants_that_it_names() -> None:
    own = {name: value.copy() for name, value in CONSTANTS.items()}
    session = cpu_session("name", NODES, INPUTS, OUTPUTS, own, threads=1)
    own["matrix"][:] = 0  # nobody keeps them for the session
    digits = np.random.default_rng(0).integers(0, 128, (5, 3), np.uint8)
    found, wanted = session.run({"a": digits}), (digits.astype(np.int32) - 64) @ MATRIX.astype(np.int32)
    np.testing.assert_array_equal(found["b"], wanted)
    np.testing.assert_array_equal(found["c"], wanted.astype(np.float32))
