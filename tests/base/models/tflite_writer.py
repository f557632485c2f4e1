"""Writes tiny TFLite networks, so that the converter is tested without anybody's weights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import flatbuffers
import numpy as np
import tflite
from numpy.typing import NDArray


@dataclass
class Operator:
    """An operator of `kind` (CONV_2D …, or the name of a custom one).

    `options` are (table, {field: value}), `custom_options` a FlexBuffer.
    """

    kind: str
    inputs: Sequence[int]
    outputs: Sequence[int]
    options: tuple[str, dict[str, int]] | None = None
    custom_options: bytes = b""


@dataclass
class NetworkWriter:
    """Collects tensors and operators; `write` gives the file's bytes."""

    tensors: list[tuple[tuple[int, ...], np.dtype, NDArray | None]] = field(default_factory=list)
    operators: list[Operator] = field(default_factory=list)

    def computed(self, *shape: int) -> int:
        """Add a float32 tensor that is computed or fed; returns its index."""
        self.tensors.append((shape, np.dtype(np.float32), None))
        return len(self.tensors) - 1

    def constant(self, data: NDArray) -> int:
        """Add a constant; returns its index."""
        self.tensors.append((data.shape, data.dtype, data))
        return len(self.tensors) - 1

    def write(self, inputs: Sequence[int], outputs: Sequence[int], graphs: int = 1) -> bytes:
        """The file; with more than one graph, they are alike."""
        builder = flatbuffers.Builder(1024)
        buffers = [_table(builder, "Buffer")]
        tensors = []
        for shape, dtype, data in self.tensors:
            if data is not None:
                buffers.append(_table(builder, "Buffer", Data=builder.CreateByteVector(data.tobytes())))
            kind = getattr(tflite.TensorType, dtype.name.upper())
            buffer = 0 if data is None else len(buffers) - 1
            tensors.append(_table(builder, "Tensor", Shape=_integers(builder, shape), Type=kind, Buffer=buffer))
        codes, operators = [], []
        for operator in self.operators:
            codes.append(_code(builder, operator.kind))
            fields = {"Inputs": _integers(builder, operator.inputs), "Outputs": _integers(builder, operator.outputs)}
            if operator.options:
                table, values = operator.options
                fields["BuiltinOptions"] = _table(builder, table, **values)
                fields["BuiltinOptionsType"] = getattr(tflite.BuiltinOptions, table)
            if operator.custom_options:
                fields["CustomOptions"] = builder.CreateByteVector(operator.custom_options)
            operators.append(_table(builder, "Operator", OpcodeIndex=len(codes) - 1, **fields))
        graph = _table(
            builder,
            "SubGraph",
            Tensors=_tables(builder, tensors),
            Operators=_tables(builder, operators),
            Inputs=_integers(builder, inputs),
            Outputs=_integers(builder, outputs),
        )
        lists = {
            "OperatorCodes": _tables(builder, codes),
            "Subgraphs": _tables(builder, [graph] * graphs),
            "Buffers": _tables(builder, buffers),
        }
        builder.Finish(_table(builder, "Model", Version=3, **lists), b"TFL3")
        return bytes(builder.Output())


def _code(builder: flatbuffers.Builder, kind: str) -> int:
    code = getattr(tflite.BuiltinOperator, kind, tflite.BuiltinOperator.CUSTOM)
    fields = {"DeprecatedBuiltinCode": min(code, 127), "BuiltinCode": code}  # both are written, for older readers
    if code == tflite.BuiltinOperator.CUSTOM:
        fields["CustomCode"] = builder.CreateString(kind)
    return _table(builder, "OperatorCode", **fields)


def _table(builder: flatbuffers.Builder, table: str, **fields: int) -> int:
    getattr(tflite, f"{table}Start")(builder)
    for name, value in fields.items():
        getattr(tflite, f"{table}Add{name}")(builder, value)
    return int(getattr(tflite, f"{table}End")(builder))


def _integers(builder: flatbuffers.Builder, values: Sequence[int]) -> int:
    return int(builder.CreateNumpyVector(np.array(values, np.int32)))


def _tables(builder: flatbuffers.Builder, offsets: Sequence[int]) -> int:
    builder.StartVector(4, len(offsets), 4)
    for offset in reversed(offsets):
        builder.PrependUOffsetTRelative(offset)
    return int(builder.EndVector())
