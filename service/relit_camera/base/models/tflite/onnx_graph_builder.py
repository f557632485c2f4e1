"""The ONNX graph under construction, and the layout of each of its values.

TFLite keeps pictures as (batch, height, width, channel), ONNX's convolutions want (batch, channel, height, width). A
value is kept in the layout in which its operator makes it; the other is a Transpose, made once, where one is asked for.
So a chain of convolutions has a Transpose at its ends only.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import helper, numpy_helper

from relit_camera.base.errors import ModelError
from relit_camera.base.models.tflite.tflite_reader import TfliteModel


class Layout(Enum):
    """Order of a tensor's axes; the value permutes the axes of the other order of a picture into this one."""

    TFLITE = (0, 2, 3, 1)
    CHANNELS_FIRST = (0, 3, 1, 2)

    @property
    def other(self) -> Layout:
        """The other order."""
        return Layout.TFLITE if self is Layout.CHANNELS_FIRST else Layout.CHANNELS_FIRST

    def axis(self, axis: int, rank: int) -> int:
        """Find TFLite's `axis` (which may be negative) of a tensor of `rank` axes in this order."""
        return self.value.index(axis % rank) if self is Layout.CHANNELS_FIRST else axis % rank


class OnnxGraphBuilder:
    """Collects nodes and initializers. Tensors of the TFLite network go by their index, ONNX's values by their name."""

    def __init__(self, network: TfliteModel, name: str) -> None:
        self.network = network
        self.name = name
        self._nodes: list[onnx.NodeProto] = []
        self._initializers: list[onnx.TensorProto] = []
        self._constants = {i: tensor.data for i, tensor in enumerate(network.tensors) if tensor.data is not None}
        self._values: dict[tuple[int, Layout], str] = {}

    def shape(self, tensor: int) -> tuple[int, ...]:
        """Return the shape in TFLite's order."""
        return self.network.tensors[tensor].shape

    def constant(self, tensor: int) -> NDArray:
        """Return the tensor's constant value in TFLite's order.

        Raises:
            ModelError: the tensor is computed.
        """
        if tensor not in self._constants:
            raise self.unsupported(f"tensor {tensor} is computed where only a constant can be converted")
        return self._constants[tensor]

    def set_constant(self, tensor: int, data: NDArray) -> None:
        """Register `tensor` as the constant `data`."""
        self._constants[tensor] = data

    def common_layout(self, tensors: Sequence[int]) -> Layout:
        """Choose the layout in which to combine `tensors` element by element with the fewest Transposes."""
        computed = [tensor for tensor in tensors if tensor not in self._constants]
        some_channels_first = any((tensor, Layout.CHANNELS_FIRST) in self._values for tensor in computed)
        all_pictures = all(len(self.shape(tensor)) == 4 for tensor in computed)
        return Layout.CHANNELS_FIRST if some_channels_first and all_pictures else Layout.TFLITE

    def value(self, tensor: int, layout: Layout) -> str:
        """Name the tensor's value in `layout`; makes a Transpose or an initializer where there is none yet."""
        if (tensor, layout) not in self._values:
            if tensor in self._constants:
                name = self.initializer(self._constants[tensor], layout)
            else:
                name = self._transposed(tensor, layout)
            self._values[tensor, layout] = name
        return self._values[tensor, layout]

    def bind(self, tensor: int, value: str, layout: Layout) -> None:
        """Register the ONNX value `value` as `tensor` in `layout`."""
        self._values[tensor, layout] = value

    def node(self, operator: str, inputs: Sequence[str], **attributes: Any) -> str:
        """Add a node with one output; returns that value's name."""
        output = f"value_{len(self._nodes)}"
        self._nodes.append(helper.make_node(operator, list(inputs), [output], **attributes))
        return output

    def initializer(self, data: NDArray, layout: Layout = Layout.TFLITE) -> str:
        """Add a constant; returns its name.

        With channels first, fewer than four axes get axes of length 1 in front, as broadcasting would, before the
        permutation.
        """
        if layout is Layout.CHANNELS_FIRST:
            data = data.reshape((1,) * (4 - data.ndim) + data.shape).transpose(layout.value)
        name = f"constant_{len(self._initializers)}"
        # asarray, since ascontiguousarray would make a vector of a scalar.
        self._initializers.append(numpy_helper.from_array(np.asarray(data, order="C"), name))
        return name

    def integers(self, values: Sequence[int]) -> str:
        """Add a constant vector of int64; returns its name."""
        return self.initializer(np.array(values, np.int64))

    def unsupported(self, what: str) -> ModelError:
        """Make the error for a network that this converter is not made for."""
        return ModelError(f"{self.name} cannot be converted: {what}", "use the file named by `relit models list`")

    def build(self, inputs: Sequence[str], outputs: Sequence[str]) -> onnx.GraphProto:
        """Finish the graph; its inputs and outputs are the network's, under these names and in TFLite's order."""
        for tensor, output in zip(self.network.outputs, outputs, strict=True):
            self._nodes.append(helper.make_node("Identity", [self.value(tensor, Layout.TFLITE)], [output]))
        return helper.make_graph(
            self._nodes,
            self.name,
            [self._value_info(tensor, name) for tensor, name in zip(self.network.inputs, inputs, strict=True)],
            [self._value_info(tensor, name) for tensor, name in zip(self.network.outputs, outputs, strict=True)],
            self._initializers,
        )

    def _value_info(self, tensor: int, name: str) -> onnx.ValueInfoProto:
        element = helper.np_dtype_to_tensor_dtype(self.network.tensors[tensor].dtype)
        return helper.make_tensor_value_info(name, element, self.shape(tensor))

    def _transposed(self, tensor: int, layout: Layout) -> str:
        if (tensor, layout.other) not in self._values:
            raise self.unsupported(f"tensor {tensor} is used before it is computed")
        if len(self.shape(tensor)) != 4:
            raise self.unsupported(f"tensor {tensor} of shape {self.shape(tensor)} is used as a picture")
        return self.node("Transpose", [self._values[tensor, layout.other]], perm=layout.value)
