"""Changes files a little, as mistakes and malice do: bits, numbers, lengths, blocks, ends, and parts of other files."""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Callable, Sequence
from random import Random

NUMBERS = (0, 1, 2, 7, 0x7F, 0x80, 0xFF, 0x100, 0x7FFF, 0x8000, 0xFFFF, 0x10000, 0xFFFFFF, 0x7FFFFFFF, 0x80000000,
           0xFFFFFFF0, 0xFFFFFFFF, 0x7FFFFFFFFFFFFFFF, 0xFFFFFFFFFFFFFFFF)  # fmt: skip
"""Where counting goes wrong."""
WORDS = (
    b"-1",
    b"0",
    b"1e999",
    b".nan",
    b"9" * 30,
    b"4611686018427387904",
    b"[",
    b"{",
    b'"',
    b"'",
    b"&a",
    b"*a",
    b"!!int",
    b"null",
    b"\n",
    b"\0",
    b"\xff",
    b": ",
    b"- ",
    b"1:1:1",
    b"0x",
    b"[[",
    b"}}",
    b",,",
    b"~",
    b"|",
    b">",
)
"""What texts are made of."""
MAX_BYTES = 1 << 20


def mutated(data: bytes, others: Sequence[bytes], random: Random) -> bytes:
    """One to six changes of a file; `others` are files of its kind, of which parts may come."""
    changed = bytearray(data)
    for _ in range(random.choice((1, 1, 1, 2, 2, 3, 4, 6))):
        random.choice(_CHANGES)(changed, others, random)
    return bytes(changed[:MAX_BYTES])


def repaired(data: bytes) -> bytes:
    """The file with checksums and header lengths made right again, so that a change gets past their checks."""
    if data.startswith(b"\x89PNG\r\n\x1a\n"):
        return _with_png_checksums(data)
    end = data.rfind(b"}", 8, 1 << 16)
    if data[8:9] == b"{" and end > 8:  # safetensors
        return struct.pack("<Q", end - 7) + data[8:]
    return data


def _with_png_checksums(data: bytes) -> bytes:
    made, position = bytearray(data), 8
    while position + 12 <= len(made):
        (length,) = struct.unpack_from(">I", made, position)
        end = position + 8 + length
        if end + 4 > len(made):
            break
        made[end : end + 4] = struct.pack(">I", zlib.crc32(made[position + 4 : end]))
        position = end + 4
    return bytes(made)


def _place(changed: bytearray, random: Random) -> int:
    """A position, more often near the beginning, where headers are."""
    if random.random() < 0.5:
        return random.randrange(min(len(changed), 256) or 1)
    return random.randrange(len(changed) or 1)


def _flip(changed: bytearray, others: Sequence[bytes], random: Random) -> None:
    if changed:
        changed[_place(changed, random)] ^= 1 << random.randrange(8)


def _set(changed: bytearray, others: Sequence[bytes], random: Random) -> None:
    if changed:
        changed[_place(changed, random)] = random.randrange(256)


def _number(changed: bytearray, others: Sequence[bytes], random: Random) -> None:
    size = random.choice((1, 2, 4, 4, 8))
    at, order = _place(changed, random), random.choice(("little", "big"))
    changed[at : at + size] = (random.choice(NUMBERS) & ((1 << 8 * size) - 1)).to_bytes(size, order)  # type: ignore[arg-type]


def _add_to_number(changed: bytearray, others: Sequence[bytes], random: Random) -> None:
    size, at, order = random.choice((2, 4)), _place(changed, random), random.choice(("little", "big"))
    value = int.from_bytes(changed[at : at + size], order) + random.randint(-16, 16)  # type: ignore[arg-type]
    changed[at : at + size] = (value % (1 << 8 * size)).to_bytes(size, order)  # type: ignore[arg-type]


def _remove(changed: bytearray, others: Sequence[bytes], random: Random) -> None:
    at = _place(changed, random)
    del changed[at : at + random.choice((1, 2, 4, 8, 16, 64, 1024))]


def _repeat(changed: bytearray, others: Sequence[bytes], random: Random) -> None:
    at, size = _place(changed, random), random.choice((1, 4, 16, 64, 256))
    changed[at:at] = bytes(changed[at : at + size]) * random.choice((1, 2, 10, 100, 1000))


def _insert(changed: bytearray, others: Sequence[bytes], random: Random) -> None:
    at = _place(changed, random)
    changed[at:at] = random.choice((bytes(16), b"\xff" * 16, random.randbytes(random.randrange(1, 64))))


def _cut(changed: bytearray, others: Sequence[bytes], random: Random) -> None:
    del changed[_place(changed, random) :]


def _splice(changed: bytearray, others: Sequence[bytes], random: Random) -> None:
    other = random.choice(others)
    start, size = random.randrange(len(other) or 1), random.choice((4, 16, 64, 1024, len(other)))
    at = _place(changed, random)
    changed[at : at + (size if random.random() < 0.5 else 0)] = other[start : start + size]


def _word(changed: bytearray, others: Sequence[bytes], random: Random) -> None:
    at = _place(changed, random)
    changed[at : at + random.choice((0, 0, 1, 4))] = random.choice(WORDS)


def _digits(changed: bytearray, others: Sequence[bytes], random: Random) -> None:
    """Another number in place of one that is written in digits."""
    found = list(re.finditer(rb"-?\d+(\.\d+)?", changed))
    if found:
        one = random.choice(found)
        changed[one.start() : one.end()] = random.choice((str(random.choice(NUMBERS)).encode(), *WORDS[:6]))


_CHANGES: tuple[Callable[[bytearray, Sequence[bytes], Random], None], ...] = (
    _flip, _flip, _set, _number, _number, _number, _add_to_number, _remove, _repeat, _insert, _cut, _splice, _word,
    _digits,
)  # fmt: skip
