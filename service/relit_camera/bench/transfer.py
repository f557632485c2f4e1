"""What it costs to carry the data to the GPU each time (thesis, Table 6.2)."""

from __future__ import annotations

from functools import partial

import numpy as np

from relit_camera.bench.timing import median_ms
from relit_camera.models.session import SessionOptions, open_session

SIDE = 1000
PRODUCTS = 100


def bench_transfer(options: SessionOptions) -> dict[str, object] | None:
    """Milliseconds for 100 products of 1000 x 1000 float32: numpy, a factor sent each time, a factor kept.

    None where no GPU provider is really used.
    """
    from onnx import TensorProto, helper, numpy_helper

    rng = np.random.default_rng(0)
    a, b = (rng.random((SIDE, SIDE), dtype=np.float32) for _ in range(2))
    kept_value = numpy_helper.from_array(a, "a")
    port = [helper.make_tensor_value_info(name, TensorProto.FLOAT, [SIDE, SIDE]) for name in ("a", "b", "c")]
    node = helper.make_node("MatMul", ["a", "b"], ["c"])
    opset = [helper.make_opsetid("", 17)]
    graphs = {
        "sent_ms": helper.make_graph([node], "sent", port[:2], [port[2]]),
        "kept_ms": helper.make_graph([node], "kept", [port[1]], [port[2]], [kept_value]),
    }
    result: dict[str, object] = {}
    for name, graph in graphs.items():
        model = helper.make_model(graph, opset_imports=opset, ir_version=9).SerializeToString()
        session = open_session(model, f"bench-{name}", options)
        if session.provider == "cpu":
            return None
        feed = {"a": a, "b": b} if name == "sent_ms" else {"b": b}
        result[name] = median_ms(partial(session.run, feed)) * PRODUCTS
        result["provider"] = session.provider
    result["numpy_ms"] = median_ms(lambda: a @ b, 10) * PRODUCTS
    return result
