"""Reads what a person has answered the desktop's portal, from the file in which its store of permissions keeps that.

The file (`flatpak/db/devices` in the user's data folder) is a hash table of GLib's (GVDB): a header, then tables of
items, of which each names its key and its value by their places in the file. A value is a serialized GVariant, here of
the type `(va{sas})`: some data, and for each program a list of answers.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

MAX_BYTES = 1 << 20
"""A store of a few programs has some hundred bytes. One that is larger is not read."""
ANSWERS = ("yes", "no", "ask")
"""What can have been answered; anything else is damage."""
_HEADER = struct.Struct("<8s4I")
_ITEM = struct.Struct("<3IHcx2I")
"""Hash, parent, place and length of the key, kind, beginning and end of the value."""
_TYPE = b"(va{sas})"


def read_camera_permissions(file: Path) -> dict[str, str]:
    """`camera_permissions` of a file; empty where there is none, or one that is too large."""
    try:
        if not file.is_file():
            return {}
        with file.open("rb") as opened:
            data = opened.read(MAX_BYTES + 1)
    except OSError:
        return {}
    return camera_permissions(data) if len(data) <= MAX_BYTES else {}


def camera_permissions(data: bytes) -> dict[str, str]:
    """What was answered for each program that asked for cameras: `yes`, `no` or `ask`, by the program's identifier.

    Programs outside of sandboxes may have an empty one. Empty for a file that is none, or is damaged.
    """
    try:
        signature, _, _, begin, end = _HEADER.unpack_from(data)
        if signature != b"GVariant":
            return {}
        for key, kind, table in _items(data, begin, end):
            if (key, kind) == (b"main", b"H"):
                for name, _, value in _items(data, *table):
                    if name == b"camera":
                        return _answers(data[slice(*value)])
    except (struct.error, ValueError, IndexError):
        pass
    return {}


def _items(data: bytes, begin: int, end: int) -> Iterator[tuple[bytes, bytes, tuple[int, int]]]:
    """Key, kind, and place of the value, of each item of a table."""
    bloom_words, buckets = struct.unpack_from("<2I", data, begin)
    first = begin + 8 + 4 * (bloom_words & 0x7FFFFFF) + 4 * buckets
    for place in range(first, min(end, len(data)) - _ITEM.size + 1, _ITEM.size):
        _, _, key, length, kind, value, value_end = _ITEM.unpack_from(data, place)
        yield data[key : key + length], kind, (value, value_end)


def _answers(variant: bytes) -> dict[str, str]:
    """The answers in a value of the store."""
    content, _, kind = variant.rpartition(b"\0")
    if kind != _TYPE:
        raise ValueError("a value of another type")
    width = _offset_bytes(len(content))
    begin = int.from_bytes(content[-width:], "little")  # where the data ends, which nobody needs
    found = {}
    for entry in _elements(content[begin:-width]):
        width = _offset_bytes(len(entry))
        key_end = int.from_bytes(entry[-width:], "little")
        answers = _elements(entry[key_end:-width])
        if answers and (answer := _text(answers[0])) in ANSWERS:
            found[_text(entry[:key_end])] = answer
    return found


def _elements(array: bytes) -> list[bytes]:
    """The elements of an array whose elements differ in length: their ends follow the last one."""
    if not array:
        return []
    width = _offset_bytes(len(array))
    table = int.from_bytes(array[-width:], "little")
    ends = [int.from_bytes(array[at : at + width], "little") for at in range(table, len(array), width)]
    return [array[begin:end] for begin, end in zip([0, *ends], ends, strict=False)]


def _offset_bytes(length: int) -> int:
    """Bytes of each offset in a container of so many bytes."""
    return 1 if length <= 0xFF else 2 if length <= 0xFFFF else 4


def _text(value: bytes) -> str:
    return value.rstrip(b"\0").decode(errors="replace")
