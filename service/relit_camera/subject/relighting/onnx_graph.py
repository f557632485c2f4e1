"""Writing small ONNX graphs, in the wire format of onnx.proto and without the package `onnx`.

Every subject has a graph of its own, and the package would cost the running camera 8 MB and a tenth of a second. What
is written here the tests read with it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

ELEMENT_TYPES = {"float32": 1, "uint8": 2, "int8": 3, "int64": 7}
"""TensorProto.DataType by NumPy's names."""
_ATTRIBUTE_INT, _ATTRIBUTE_INTS = 2, 7


def node(operator: str, inputs: Sequence[str], outputs: Sequence[str], **attributes: int | Sequence[int]) -> bytes:
    """An operator with its named values and integer attributes (NodeProto)."""
    parts = [_text(1, name) for name in inputs] + [_text(2, name) for name in outputs] + [_text(4, operator)]
    for name, value in attributes.items():
        if isinstance(value, int):
            given = _number(3, value) + _number(20, _ATTRIBUTE_INT)
        else:
            given = b"".join(_number(8, each) for each in value) + _number(20, _ATTRIBUTE_INTS)
        parts.append(_message(5, _text(1, name) + given))
    return b"".join(parts)


def tensor_value(name: str, element: str, shape: Sequence[int | str]) -> bytes:
    """An input or output: its name, element type and sizes, open ones by name (ValueInfoProto)."""
    sizes = [_message(1, _text(2, size) if isinstance(size, str) else _number(1, size)) for size in shape]
    tensor = _number(1, ELEMENT_TYPES[element]) + _message(2, b"".join(sizes))
    return _text(1, name) + _message(2, _message(1, tensor))


def model(
    name: str,
    nodes: Sequence[bytes],
    inputs: Sequence[bytes],
    output: bytes,
    constants: Mapping[str, NDArray],
    opset: int,
    ir_version: int,
) -> bytes:
    """A model of one graph (ModelProto), for `open_session`."""
    graph = [*(_message(1, each) for each in nodes), _text(2, name)]
    graph += [_message(5, _tensor(each, value)) for each, value in constants.items()]
    graph += [*(_message(11, each) for each in inputs), _message(12, output)]
    return _number(1, ir_version) + _message(7, b"".join(graph)) + _message(8, _text(1, "") + _number(2, opset))


def _tensor(name: str, value: NDArray) -> bytes:
    sizes = b"".join(_number(1, size) for size in value.shape)
    raw = np.ascontiguousarray(value, value.dtype.newbyteorder("<")).tobytes()
    return sizes + _number(2, ELEMENT_TYPES[value.dtype.name]) + _text(8, name) + _message(9, raw)


def _number(field: int, value: int) -> bytes:
    return _varint(field << 3) + _varint(value)


def _text(field: int, value: str) -> bytes:
    return _message(field, value.encode())


def _message(field: int, content: bytes) -> bytes:
    return _varint(field << 3 | 2) + _varint(len(content)) + content


def _varint(value: int) -> bytes:
    """Seven bits a byte, the lowest first; negative numbers as 64 bits."""
    value &= (1 << 64) - 1
    encoded = bytearray()
    while value > 127:
        encoded.append(value & 127 | 128)
        value >>= 7
    return bytes([*encoded, value])
