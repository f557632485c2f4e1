"""SPA PODs ("plain old data"): the binary values in which PipeWire's programs agree on formats and buffers.

libpipewire has functions for them only as C source in its headers, so the few kinds that a camera needs are built and
read here. A POD is a header of two 32-bit numbers, size and type, and a body, padded to eight bytes, in the machine's
byte order (PipeWire's documentation: "POD", "SPA types").
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from fractions import Fraction

_HEADER = struct.Struct("=II")
_PAIR = struct.Struct("=II")


class PodType(IntEnum):
    """Types of PODs (spa/utils/type.h)."""

    ID = 3
    INT = 4
    RECTANGLE = 10
    FRACTION = 11
    OBJECT = 15
    CHOICE = 19


class ChoiceType(IntEnum):
    """What the values of a choice mean (spa/pod/pod.h); the first is the preferred one."""

    NONE = 0
    """There is one value."""
    RANGE = 1
    """Between the second and the third."""
    ENUM = 3
    """One of those after the first."""
    FLAGS = 4
    """Any of the first one's bits."""


@dataclass(frozen=True)
class Pod:
    """One value.

    Attributes:
        kind: its type.
        body: its bytes, without header and padding.
    """

    kind: int
    body: bytes

    def encode(self) -> bytes:
        """The value with header and padding."""
        return _HEADER.pack(len(self.body), self.kind) + self.body + bytes(-len(self.body) % 8)

    @property
    def number(self) -> int:
        """The number of an id or integer.

        Raises:
            ValueError: it is none.
        """
        if self.kind not in (PodType.ID, PodType.INT) or len(self.body) != 4:
            raise ValueError(f"a POD of type {self.kind} is no number")
        return int.from_bytes(self.body, "little" if struct.pack("=H", 1)[0] else "big")

    @property
    def pair(self) -> tuple[int, int]:
        """Width and height of a rectangle, or numerator and denominator of a fraction.

        Raises:
            ValueError: it is neither.
        """
        if self.kind not in (PodType.RECTANGLE, PodType.FRACTION) or len(self.body) != _PAIR.size:
            raise ValueError(f"a POD of type {self.kind} is no pair of numbers")
        first, second = _PAIR.unpack(self.body)
        return first, second


def id_pod(value: int) -> Pod:
    """A number of an enumeration."""
    return Pod(PodType.ID, struct.pack("=I", value))


def int_pod(value: int) -> Pod:
    """An integer of 32 bits."""
    return Pod(PodType.INT, struct.pack("=i", value))


def rectangle_pod(width: int, height: int) -> Pod:
    """A size."""
    return Pod(PodType.RECTANGLE, _PAIR.pack(width, height))


def fraction_pod(value: Fraction) -> Pod:
    """A fraction that is not negative."""
    return Pod(PodType.FRACTION, _PAIR.pack(value.numerator, value.denominator))


def choice_pod(choice: ChoiceType, *values: Pod) -> Pod:
    """Several values of one type, of which one is to be chosen; the first is the preferred one."""
    child = _HEADER.pack(len(values[0].body), values[0].kind)
    return Pod(PodType.CHOICE, struct.pack("=II", choice, 0) + child + b"".join(value.body for value in values))


def object_pod(kind: int, identifier: int, properties: Mapping[int, Pod]) -> Pod:
    """Named values.

    Args:
        kind: the object's type, such as that of formats.
        identifier: which parameter it is, such as the formats to choose from.
        properties: by their keys.
    """
    body = [_PAIR.pack(kind, identifier)]
    for key, value in properties.items():
        body += [_PAIR.pack(key, 0), value.encode()]  # 0: no flags
    return Pod(PodType.OBJECT, b"".join(body))


def read_object(data: bytes) -> dict[int, Pod]:
    """The properties of an encoded object by their keys; of a choice the preferred value.

    Raises:
        ValueError: the bytes are no whole object.
    """
    body = _read(data, 0)
    if body.kind != PodType.OBJECT:
        raise ValueError(f"a POD of type {body.kind} is no object")
    properties, at = {}, _PAIR.size
    while at < len(body.body):
        if at + _PAIR.size > len(body.body):
            raise ValueError("a property is cut off")
        key, _ = _PAIR.unpack_from(body.body, at)
        value = _read(body.body, at + _PAIR.size)
        properties[key] = _preferred(value)
        at += _PAIR.size + len(value.encode())
    return properties


def _read(data: bytes, at: int) -> Pod:
    if at + _HEADER.size > len(data):
        raise ValueError("a POD's header is cut off")
    size, kind = _HEADER.unpack_from(data, at)
    body = data[at + _HEADER.size : at + _HEADER.size + size]
    if len(body) != size:
        raise ValueError("a POD is cut off")
    return Pod(kind, body)


def _preferred(value: Pod) -> Pod:
    """A value itself; the first one of a choice."""
    if value.kind != PodType.CHOICE:
        return value
    if len(value.body) < 16:
        raise ValueError("a choice is cut off")
    size, kind = _HEADER.unpack_from(value.body, 8)
    first = value.body[16 : 16 + size]
    if len(first) != size:
        raise ValueError("a choice has no value")
    return Pod(kind, first)
