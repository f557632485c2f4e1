"""A TFLite flatbuffer as plain data."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import ModelError

_IDENTIFIER = b"TFL3"


@dataclass(frozen=True)
class Tensor:
    """A tensor of the network. `data` is None where it is computed.

    Attributes:
        shape: fixed; pictures are (batch, height, width, channel).
        dtype: element type.
        data: the constant, of that shape and dtype.
    """

    shape: tuple[int, ...]
    dtype: np.dtype
    data: NDArray | None


@dataclass(frozen=True)
class Operator:
    """One step of the network.

    Attributes:
        kind: TFLite's name, such as CONV_2D; for a custom operator, its own name.
        inputs: indices of tensors; -1 is an optional one left out.
        outputs: indices of tensors.
        options: the options table of `tflite`, such as `tflite.Conv2DOptions`, or a custom operator's as a dictionary;
            None where there is none.
    """

    kind: str
    inputs: tuple[int, ...]
    outputs: tuple[int, ...]
    options: Any


@dataclass(frozen=True)
class TfliteModel:
    """The one graph of a TFLite file, its operators in running order."""

    tensors: tuple[Tensor, ...]
    operators: tuple[Operator, ...]
    inputs: tuple[int, ...]
    outputs: tuple[int, ...]


def read_tflite(data: bytes, name: str) -> TfliteModel:
    """Parse a TFLite file; `name` is for messages.

    Raises:
        ModelError: it is no TFLite file, is damaged, or holds more than one graph.
    """
    import tflite

    damaged = ModelError(f"{name} is no TFLite network, or a damaged one", "pull it again")
    if data[4:8] != _IDENTIFIER:
        raise damaged
    try:
        model = tflite.Model.GetRootAs(data, 0)
        if model.SubgraphsLength() != 1:
            raise ModelError(f"{name} has {model.SubgraphsLength()} graphs", "only one can be converted")
        graph = model.Subgraphs(0)
        return TfliteModel(
            tuple(_tensor(model, graph.Tensors(index)) for index in range(graph.TensorsLength())),
            tuple(_operator(model, graph.Operators(index)) for index in range(graph.OperatorsLength())),
            tuple(graph.InputsAsNumpy().tolist()),
            tuple(graph.OutputsAsNumpy().tolist()),
        )
    except (struct.error, ValueError, TypeError, IndexError, KeyError, AttributeError) as error:
        # What the flatbuffer accessors stumble over when offsets point nowhere.
        raise damaged from error


def _tensor(model: Any, tensor: Any) -> Tensor:
    import tflite

    shape = tuple(tensor.ShapeAsNumpy().tolist()) if tensor.ShapeLength() else ()
    dtype = np.dtype(_constant_names(tflite.TensorType)[tensor.Type()].lower())
    buffer = model.Buffers(tensor.Buffer())
    if not buffer.DataLength():
        return Tensor(shape, dtype, None)
    return Tensor(shape, dtype, buffer.DataAsNumpy().view(dtype).reshape(shape))


def _operator(model: Any, operator: Any) -> Operator:
    import tflite

    code = model.OperatorCodes(operator.OpcodeIndex())
    kind = _constant_names(tflite.BuiltinOperator)[code.BuiltinCode()]
    options = _options(operator)
    if kind == "CUSTOM":
        kind, options = code.CustomCode().decode(), _custom_options(operator)
    inputs, outputs = operator.InputsAsNumpy().tolist(), operator.OutputsAsNumpy().tolist()
    return Operator(kind, tuple(inputs), tuple(outputs), options)


def _options(operator: Any) -> Any:
    import tflite

    table = operator.BuiltinOptions()
    if table is None:
        return None
    options = getattr(tflite, _constant_names(tflite.BuiltinOptions)[operator.BuiltinOptionsType()])()
    options.Init(table.Bytes, table.Pos)
    return options


def _custom_options(operator: Any) -> Any:
    """The options of a custom operator, which are a FlexBuffer of their own; None where there are none, or others."""
    from flatbuffers import flexbuffers

    if not operator.CustomOptionsLength():
        return None
    try:
        return flexbuffers.Loads(bytes(operator.CustomOptionsAsNumpy()))
    except (ValueError, struct.error):
        return None


@cache
def _constant_names(enumeration: type) -> Mapping[int, str]:
    return {value: key for key, value in vars(enumeration).items() if isinstance(value, int)}
