"""dlib's residual network of faces as ONNX, from its weights as TensorFlow.js packs them.

The layers are those of `FaceRecognitionNet` of face-api (github.com/vladmandic/face-api, src/faceRecognitionNet). How
many channels they have, the weights say.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import helper, numpy_helper

from relit_camera.base.errors import ModelError

SIDE_PX = 150
"""Width and height of the picture that it takes."""
MEAN_RGB = (122.782, 117.001, 104.298)
"""Of the pictures that it was trained on, 0..255."""
GROUPS = (
    ("conv32_1", "conv32_2", "conv32_3"),
    ("conv64_down", "conv64_1", "conv64_2", "conv64_3"),
    ("conv128_down", "conv128_1", "conv128_2"),
    ("conv256_down", "conv256_1", "conv256_2"),
    ("conv256_down_out",),
)
"""Residual blocks in their order. One that is called `down` halves the picture."""
_OPSET = 18
_IR_VERSION = 8
"""As of converted TFLite files: fixed, so that the bytes do not depend on the installed version of `onnx`."""

Weights = Mapping[str, NDArray[np.float32]]


def convert_face_embedding(listing: bytes, packed: bytes) -> bytes:
    """Make the ONNX model: `image` (1, 150, 150, 3) float32 RGB 0..1 to `embedding` (1, channels) float32.

    The same bytes in give the same bytes out.

    Args:
        listing: the JSON file that names the weights.
        packed: their values.

    Raises:
        ModelError: as of `unpack_weights`.
    """
    weights = unpack_weights(listing, packed)
    network = _Network(weights)
    value, side = network.stem("image")
    for name in (name for group in GROUPS for name in group):
        if "down" in name:
            value, side = network.halving_block(value, name, side), side // 2
        else:
            value = network.block(value, name)
    return network.model(value)


def unpack_weights(listing: bytes, packed: bytes) -> Weights:
    """Read weights as TensorFlow.js packs them: float32, or bytes q that stand for q · scale + min.

    Raises:
        ModelError: there are fewer or more values than are listed, or some of another type.
    """
    weights: dict[str, NDArray[np.float32]] = {}
    begin = 0
    for entry in (entry for group in json.loads(listing) for entry in group["weights"]):
        quantization, count = entry.get("quantization"), int(np.prod(entry["shape"]))
        kind = quantization["dtype"] if quantization else entry["dtype"]
        if kind not in ("float32", "uint8"):
            raise ModelError(f"the weights {entry['name']} are {kind}", "use the file named by `relit models list`")
        end = begin + count * np.dtype(kind).itemsize
        values = np.frombuffer(packed[begin:end], np.dtype(kind).newbyteorder("<")).astype(np.float32)
        if quantization:
            values = values * np.float32(quantization["scale"]) + np.float32(quantization["min"])
        if values.size != count:
            break
        weights[entry["name"]] = values.reshape(entry["shape"])
        begin = end
    else:
        if begin == len(packed):
            return weights
    raise ModelError(f"{len(packed)} bytes of weights are not as many as listed", "get the file again")


class _Network:
    """Nodes and constants of the graph in the making."""

    def __init__(self, weights: Weights) -> None:
        self._weights = weights
        self._nodes: list[onnx.NodeProto] = []
        self._constants: list[onnx.TensorProto] = []

    def stem(self, image: str) -> tuple[str, int]:
        """The layers before the first block; returns their value and the side of its picture."""
        centered = self._node("Sub", [image, self._constant(np.array(MEAN_RGB, np.float32) / np.float32(255))])
        channels_first = self._node("Transpose", [centered], perm=[0, 3, 1, 2])
        wide = self._node("Relu", [self._convolve(channels_first, "conv32_down", stride=2, pad=0)])
        side = _convolved_side(SIDE_PX, 7)
        return self._node("MaxPool", [wide], kernel_shape=[3, 3], strides=[2, 2]), _convolved_side(side, 3)

    def block(self, value: str, name: str) -> str:
        """A residual block that keeps the size."""
        inner = self._node("Relu", [self._convolve(value, f"{name}/conv1")])
        return self._sum(value, self._convolve(inner, f"{name}/conv2"))

    def halving_block(self, value: str, name: str, side: int) -> str:
        """A residual block that halves a picture of `side`. What it lacks in channels or size is filled by zeros."""
        inner = self._node("Relu", [self._convolve(value, f"{name}/conv1", stride=2, pad=0)])
        residual = self._convolve(inner, f"{name}/conv2")
        if missing := side // 2 - _convolved_side(side, 3):
            residual = self._pad(residual, [0, 0, missing, missing])
        kept = self._node("AveragePool", [value], kernel_shape=[2, 2], strides=[2, 2])
        given, made = self._weights[f"{name}/conv1/conv/filters"].shape[2:]
        if made > given:
            kept = self._pad(kept, [0, made - given, 0, 0])
        return self._sum(kept, residual)

    def model(self, value: str) -> bytes:
        """The whole model, whose last block gives `value`."""
        projection = self._weights["fc"]
        pooled = self._node("Flatten", [self._node("GlobalAveragePool", [value])])
        self._nodes.append(helper.make_node("MatMul", [pooled, self._constant(projection)], ["embedding"]))
        graph = helper.make_graph(
            self._nodes,
            "face_embedding",
            [helper.make_tensor_value_info("image", onnx.TensorProto.FLOAT, [1, SIDE_PX, SIDE_PX, 3])],
            [helper.make_tensor_value_info("embedding", onnx.TensorProto.FLOAT, [1, projection.shape[1]])],
            self._constants,
        )
        model = helper.make_model(
            graph,
            opset_imports=[helper.make_opsetid("", _OPSET)],
            ir_version=_IR_VERSION,
            producer_name="relit-camera",
        )
        return bytes(model.SerializeToString(deterministic=True))

    def _convolve(self, value: str, name: str, stride: int = 1, pad: int = 1) -> str:
        """A convolution with the scale and offset that follow it, which its own weights take in."""
        scale, offset = self._weights[f"{name}/scale/weights"], self._weights[f"{name}/scale/biases"]
        filters = (self._weights[f"{name}/conv/filters"] * scale).transpose(3, 2, 0, 1)
        bias = self._weights[f"{name}/conv/bias"] * scale + offset
        inputs = [value, self._constant(filters), self._constant(bias)]
        return self._node("Conv", inputs, strides=[stride] * 2, pads=[pad] * 4)

    def _sum(self, value: str, residual: str) -> str:
        return self._node("Relu", [self._node("Add", [value, residual])])

    def _pad(self, value: str, ends: Sequence[int]) -> str:
        return self._node("Pad", [value, self._constant(np.array([0, 0, 0, 0, *ends], np.int64))])

    def _node(self, operator: str, inputs: Sequence[str], **attributes: Any) -> str:
        output = f"value_{len(self._nodes)}"
        self._nodes.append(helper.make_node(operator, list(inputs), [output], **attributes))
        return output

    def _constant(self, data: NDArray) -> str:
        name = f"constant_{len(self._constants)}"
        self._constants.append(numpy_helper.from_array(np.ascontiguousarray(data), name))
        return name


def _convolved_side(side: int, kernel: int) -> int:
    """The side that a window of `kernel` leaves at every second place, without padding."""
    return (side - kernel) // 2 + 1
