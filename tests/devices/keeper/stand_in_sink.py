"""A sink for keepers in tests: it notes each picture, and when, in the file that `TEST_PICTURES` names."""

from __future__ import annotations

import json
import os
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import psutil

from relit_camera.base.images.image_types import DisplayImage
from relit_camera.devices.sinks.sink import SinkInfo, SinkOptions

OPENER = f"{__name__}:open_noting"
VARIABLE = "TEST_PICTURES"
FPS, KEEP_S = 30.0, 60.0
PLACEHOLDER = 250
"""Of the cameras that publish through it: frame rate, time for which a keeper goes on, and the placeholder's grey."""


@dataclass(frozen=True)
class Noted:
    """A picture that was shown: when, in monotonic seconds, its first code value, and the process that showed it."""

    at: float
    value: int
    process: int


class NotingSink:
    """Writes a line for each picture."""

    def __init__(self, size: tuple[int, int]) -> None:
        self._info = SinkInfo("camera", "stand-in", size)
        self._file = Path(os.environ[VARIABLE]).open("a", buffering=1)  # noqa: SIM115 - until `close`

    def write(self, image: DisplayImage) -> None:
        assert image.shape[1::-1] == self._info.size
        self._file.write(json.dumps([time.monotonic(), int(image[0, 0, 0]), os.getpid()]) + "\n")

    def describe(self) -> SinkInfo:
        return self._info

    def close(self) -> None:
        self._file.close()


def open_noting(options: SinkOptions) -> NotingSink:
    return NotingSink(options.size)


def runs(process: int) -> bool:
    """Whether it is there, and more than a process that nobody has asked for its exit code."""
    with suppress(psutil.NoSuchProcess):
        return psutil.Process(process).status() != psutil.STATUS_ZOMBIE
    return False


def noted(path: Path) -> list[Noted]:
    """What was shown so far."""
    whole = path.read_text().rpartition("\n")[0].splitlines() if path.exists() else []
    return [Noted(*json.loads(line)) for line in whole]
