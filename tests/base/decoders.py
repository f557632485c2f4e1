"""Decoders, harmless and not: in a module apart, since every decoding process imports it and all that it imports."""

from __future__ import annotations

import os
import time

import numpy as np

from relit_camera.base.concurrency.decoding_process import Decoded
from relit_camera.base.errors import ImageError


def numbered(start: int) -> Decoded:
    array = np.arange(start, start + 2_000_000, dtype=np.float32).reshape(1000, 2000)
    return Decoded((array, np.array([1, 2, 3], np.uint8)), {"process": os.getpid(), "notes": ("a", "b")})


def checked() -> Decoded:
    return Decoded((), {"process": os.getpid()})


def refuse() -> Decoded:
    raise ImageError("the file is no picture", "choose another")


def refuse_for_memory() -> Decoded:
    raise ImageError("the file is too large", "choose another") from MemoryError()


def fail() -> Decoded:
    raise ZeroDivisionError


def take_memory(count: int) -> Decoded:
    return Decoded((np.ones(count, np.uint8),))


def spin() -> Decoded:
    while True:
        pass


def sleep() -> Decoded:
    time.sleep(600)
    return Decoded()


def die() -> Decoded:
    os._exit(7)
