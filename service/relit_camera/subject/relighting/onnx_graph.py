"""Small ONNX graphs of large matrices: they are written in the wire format of onnx.proto, and opened on the CPU.

Every subject has graphs of its own, and the package `onnx` would cost the running camera 8 MB and a tenth of a second.
What is written here the tests read with it. The matrices are not copied into a graph, which only names them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from numpy.typing import NDArray

from relit_camera.base.models.session_with_fallback import Session, SessionOptions, open_session

OPSET, IR_VERSION = 21, 9
ELEMENT_TYPES = {"float32": 1, "uint8": 2, "int8": 3, "int32": 6}
"""TensorProto.DataType by NumPy's names."""
_ATTRIBUTE_INT, _EXTERNAL = 2, 1


def node(operator: str, inputs: Sequence[str], outputs: Sequence[str], **attributes: int) -> bytes:
    """An operator with its named values and integer attributes (NodeProto)."""
    parts = [_text(1, name) for name in inputs] + [_text(2, name) for name in outputs] + [_text(4, operator)]
    for name, value in attributes.items():
        parts.append(_message(5, _text(1, name) + _number(3, value) + _number(20, _ATTRIBUTE_INT)))
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
    outputs: Sequence[bytes],
    constants: Mapping[str, NDArray],
) -> bytes:
    """A model of one graph (ModelProto), for `open_session`, which must be given the constants too."""
    graph = [*(_message(1, each) for each in nodes), _text(2, name)]
    graph += [_message(5, _external_tensor(each, value)) for each, value in constants.items()]
    graph += [_message(11, each) for each in inputs] + [_message(12, each) for each in outputs]
    return _number(1, IR_VERSION) + _message(7, b"".join(graph)) + _message(8, _text(1, "") + _number(2, OPSET))


def cpu_session(
    name: str,
    nodes: Sequence[bytes],
    inputs: Sequence[bytes],
    outputs: Sequence[bytes],
    constants: Mapping[str, NDArray],
    threads: int,
) -> Session:
    """A session on the CPU for the graph of these nodes, inputs, outputs and constants."""
    written = model(name, nodes, inputs, outputs, constants)
    return open_session(written, name, SessionOptions("cpu", threads), constants)


def _external_tensor(name: str, value: NDArray) -> bytes:
    """A tensor whose numbers are elsewhere (TensorProto)."""
    where = {"location": name, "offset": "0", "length": str(value.nbytes)}
    entries = b"".join(_message(13, _text(1, key) + _text(2, text)) for key, text in where.items())
    sizes = b"".join(_number(1, size) for size in value.shape)
    return sizes + _number(2, ELEMENT_TYPES[value.dtype.name]) + _text(8, name) + entries + _number(14, _EXTERNAL)


def _number(field: int, value: int) -> bytes:
    return _varint(field << 3) + _varint(value)


def _text(field: int, value: str) -> bytes:
    return _message(field, value.encode())


def _message(field: int, content: bytes) -> bytes:
    return _varint(field << 3 | 2) + _varint(len(content)) + content


def _varint(value: int) -> bytes:
    """Seven bits a byte, the lowest first."""
    encoded = bytearray()
    while value > 127:
        encoded.append(value & 127 | 128)
        value >>= 7
    return bytes([*encoded, value])
