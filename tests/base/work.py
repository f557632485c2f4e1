"""Work for processes of their own: in a module apart, since every such process imports it and all that it imports."""

from __future__ import annotations

import os
import time
from pathlib import Path

from relit_camera.base.concurrency.worker_process import Progress
from relit_camera.base.errors import CaptureError


def add(first: int, second: int) -> tuple[int, int, int]:
    return first + second, os.getpid(), os.nice(0)


def refuse() -> None:
    raise CaptureError("no face is in the frames", "look at the camera")


def fail() -> None:
    raise ZeroDivisionError("one")


def die() -> None:
    os._exit(7)


def sleep(file: Path) -> None:
    file.write_text(str(os.getpid()))
    time.sleep(600)


def count_up(last: int, tell: Progress) -> str:
    for index in range(last):
        tell("counting", index + 1, last)
    return "done"


def take_memory(count: int) -> int:
    return len(bytearray(count))
