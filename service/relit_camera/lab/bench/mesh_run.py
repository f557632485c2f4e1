"""The unit in which processor time is given: one run of the face mesh network as its authors publish it.

Figures in it can be compared between machines, between minutes of a machine that others use too, and between versions
of this program: what is run is not the installed network, which is made faster, but one generated with the published
one's layers and random weights, float32, on one thread.
"""

from __future__ import annotations

import time
from statistics import median

import numpy as np
from onnx import NodeProto, TensorProto, helper, numpy_helper

from relit_camera.base.models.model_store import installed_model, model_path
from relit_camera.base.models.session_with_fallback import Model, SessionOptions, open_session
from relit_camera.face.tracking.mediapipe_mesh_tracker import MESHES

WARM_UP_RUNS = 2
RUNS = 6
"""Runs of one sample: a fifth of a core where a sample is taken each second would be too much beside a camera."""


class MeshRun:
    """A network, and the processor times of its runs."""

    def __init__(self, model: Model | None = None) -> None:
        """Open a network of one input; the one that is the unit if not given.

        Raises:
            ModelError: it cannot run.
        """
        self._session = open_session(model or _published_layers(), "mesh-run", SessionOptions("cpu"))
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


def installed_mesh_runs() -> float:
    """What a run of the network that tracker `mesh` uses costs, in mesh runs.

    Raises:
        ModelError: none is installed.
    """
    installed, mesh = MeshRun(model_path(installed_model(MESHES) or MESHES[0])), MeshRun()
    for _ in range(INSTALLED_SAMPLES):
        mesh.sample()
        installed.sample()
    return installed.ms / mesh.ms


INSTALLED_SAMPLES = 3
SIDE_PX, LANDMARKS = 256, 478
STEPS = ((8, 16), (16, 32), (32, 64), (64, 128), (64, 128), (64, 128), (64, 128))
"""Of each step, at half the size of the step before: channels within its blocks, and of their sums."""
BLOCKS = 4
"""Residual blocks of a step, after the one that halves the size."""


def _published_layers() -> bytes:
    """An ONNX network with the layers of the face mesh network: residual blocks of separable convolutions, PReLU."""
    net = _Layers()
    value = net.prelu(net.convolve("image", (16, 3, 3, 3), stride=2), 16)
    for step, (inner, outer) in enumerate(STEPS):
        for block in range(BLOCKS + (step > 0)):
            halves = step > 0 and block == 0
            given = STEPS[step - 1][1] if halves else outer
            size = 2 if halves else 1
            narrow = net.prelu(net.convolve(value, (inner, given, size, size), stride=size), inner)
            spread = net.convolve(narrow, (inner, 1, 3, 3), groups=inner)
            summed = net.convolve(spread, (outer, inner, 1, 1))
            kept = net.halve(value, outer - given) if halves else value
            value = net.prelu(net.node("Add", [summed, kept]), outer)
    return net.model(net.convolve(value, (3 * LANDMARKS, STEPS[-1][1], 2, 2)))


class _Layers:
    """Layers of a network in the making. Values are named after their nodes."""

    def __init__(self) -> None:
        self._rng = np.random.default_rng(0)
        self._nodes: list[NodeProto] = []
        self._weights: list[TensorProto] = []

    def node(self, kind: str, inputs: list[str], **attributes: object) -> str:
        name = f"{kind}{len(self._nodes)}"
        self._nodes.append(helper.make_node(kind, inputs, [name], **attributes))
        return name

    def convolve(self, value: str, shape: tuple[int, int, int, int], stride: int = 1, groups: int = 1) -> str:
        scale = np.sqrt(0.5 / np.prod(shape[1:]))  # so that values do not grow
        bias = self._constant(np.zeros(shape[0], np.float32))
        weights = self._constant((self._rng.standard_normal(shape) * scale).astype(np.float32))
        pads = [1 if shape[2] == 3 else 0] * 4
        return self.node("Conv", [value, weights, bias], strides=[stride] * 2, pads=pads, group=groups)

    def prelu(self, value: str, channels: int) -> str:
        """As a converter writes it: ONNX Runtime's own PRelu takes longer than the four."""
        slopes = np.full((channels, 1, 1), 0.25, np.float32)
        positive = self.node("Mul", [self.node("Relu", [value]), self._constant(1 - slopes)])
        return self.node("Add", [self.node("Mul", [value, self._constant(slopes)]), positive])

    def halve(self, value: str, more_channels: int) -> str:
        largest = self.node("MaxPool", [value], kernel_shape=[2, 2], strides=[2, 2])
        if not more_channels:
            return largest
        return self.node("Pad", [largest, self._constant(np.array([0, 0, 0, 0, 0, more_channels, 0, 0]))])

    def model(self, output: str) -> bytes:
        graph = helper.make_graph(
            self._nodes,
            "mesh-run",
            [helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 3, SIDE_PX, SIDE_PX])],
            [helper.make_tensor_value_info(output, TensorProto.FLOAT, [1, 3 * LANDMARKS, 1, 1])],
            self._weights,
        )
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
        return bytes(model.SerializeToString())

    def _constant(self, value: np.ndarray) -> str:
        name = f"constant{len(self._weights)}"
        self._weights.append(numpy_helper.from_array(value, name))
        return name
