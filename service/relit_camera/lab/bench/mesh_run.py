"""The unit in which processor time is given: one run of the face mesh network, float32, on one thread.

Figures in it can be compared between machines, and between minutes of a machine that others use too.
"""

from __future__ import annotations

import time
from contextlib import suppress
from statistics import median

import numpy as np
from onnx import NodeProto, TensorProto, helper, numpy_helper

from relit_camera.base.errors import ModelError
from relit_camera.base.models.model_store import model_path
from relit_camera.base.models.session_with_fallback import Session, SessionOptions, open_session

WARM_UP_RUNS = 2
RUNS = 6
"""Runs of one sample: a fifth of a core where a sample is taken each second would be too much beside a camera."""


class MeshRun:
    """The network, and the processor times of its runs.

    Attributes:
        network: `face_mesh`; or `substitute`, where the public networks are not installed: a network of the same kinds
            of layers that takes about as long, with random weights.
    """

    def __init__(self, *, substitute: bool = False) -> None:
        """Open the network; the substitute where that is wanted, for figures that must be comparable everywhere."""
        self.network, self._session = _open_network(substitute)
        (name, spec), *_ = self._session.inputs.items()
        self._feeds = {name: np.full([size or 1 for size in spec.shape], 0.5, np.float32)}
        self._seconds: list[float] = []

    def sample(self) -> None:
        """Run it some times, in the calling thread."""
        for run in range(WARM_UP_RUNS + RUNS):
            began = time.thread_time()
            self._session.run(self._feeds)
            if run >= WARM_UP_RUNS:
                self._seconds.append(time.thread_time() - began)

    @property
    def runs(self) -> int:
        """How many runs count."""
        return len(self._seconds)

    @property
    def ms(self) -> float:
        """Median processor time of a run, in milliseconds. Call after `sample`."""
        return 1e3 * median(self._seconds)


def _open_network(substitute: bool) -> tuple[str, Session]:
    options = SessionOptions("cpu")
    if not substitute:
        with suppress(ModelError):
            return "face_mesh", open_session(model_path("face_mesh"), "face_mesh", options)
    return "substitute", open_session(_substitute_network(), "substitute", options)


SUBSTITUTE_LAYERS = ((16, 2, 10), (32, 2, 14), (64, 2, 14), (128, 2, 14), (128, 2, 14), (128, 2, 14))
"""Of each step of the substitute: channels, stride, and pairs of a depthwise and a pointwise convolution."""


def _substitute_network() -> bytes:
    """An ONNX network that costs what the face mesh network costs: separable convolutions of (1, 3, 256, 256)."""
    rng = np.random.default_rng(0)
    nodes: list[NodeProto] = []
    weights: list[TensorProto] = []

    def convolve(value: str, channels: int, given: int, kernel: int, stride: int, groups: int) -> str:
        name = f"conv{len(nodes)}"
        shape = (channels, given // groups, kernel, kernel)
        scale = np.sqrt(2.4 / (shape[1] * kernel * kernel))  # so that values neither grow nor fade
        weights.append(numpy_helper.from_array((rng.standard_normal(shape) * scale).astype(np.float32), f"{name}.w"))
        pads = [kernel // 2] * 4
        nodes.append(
            helper.make_node(
                "Conv",
                [value, f"{name}.w"],
                [name],
                strides=[stride] * 2,
                pads=pads,
                group=groups,
                kernel_shape=[kernel] * 2,
            )
        )
        nodes.append(helper.make_node("Relu", [name], [f"{name}.r"]))
        return f"{name}.r"

    value, given = "image", 3
    for channels, stride, pairs in SUBSTITUTE_LAYERS:
        value, given = convolve(value, channels, given, 3, stride, 1 if given == 3 else given), channels
        for _ in range(pairs):
            value = convolve(value, channels, channels, 3, 1, channels)
            value = convolve(value, channels, channels, 1, 1, 1)
    graph = helper.make_graph(
        nodes,
        "substitute",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 3, 256, 256])],
        [helper.make_tensor_value_info(value, TensorProto.FLOAT, None)],
        weights,
    )
    return bytes(
        helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9).SerializeToString()
    )
