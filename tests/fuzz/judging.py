"""Judges readers in a process of its own: errors, memory, processor time, files and descriptors left behind."""

from __future__ import annotations

import gc
import multiprocessing
import os
import time
import warnings
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Self

MOST_GROWN_BYTES = 64 << 20
"""Of memory, above what the process had before the file."""
MOST_CPU_S = 1.0
LIMIT_DIVISOR = 64
"""The limits of pictures are divided by this while mutations are tried, so that what they let through costs little."""


class Judge:
    """Hands files to a process that reads them, and says what was wrong with that; use it as a context manager."""

    def __init__(self, lowered: bool = False, timeout_s: float = 60.0) -> None:
        """Set up.

        Args:
            lowered: whether the limits of pictures are divided by `LIMIT_DIVISOR`.
            timeout_s: after which a reader is said to hang.
        """
        self._lowered, self._timeout_s = lowered, timeout_s
        self._process: Any = None
        self._connection: Connection | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def judge(self, kind: str, suffix: str, data: bytes) -> list[str]:
        """What is wrong with how the readers of this kind take this file; empty if nothing is."""
        connection = self._connection or self._start()
        connection.send((kind, suffix))
        connection.send_bytes(data)
        try:
            if not connection.poll(self._timeout_s):
                self._end()
                return [f"it hangs for {self._timeout_s:.0f} s"]
            found: list[str] = connection.recv()
            return found
        except (EOFError, OSError):
            self._process.join(5)
            code = self._process.exitcode
            self._end()
            return [f"the process died ({code})"]

    def _start(self) -> Connection:
        context = multiprocessing.get_context("spawn")
        self._connection, of_child = context.Pipe()
        self._process = context.Process(target=_work, args=(of_child, self._lowered), daemon=True)
        self._process.start()
        of_child.close()
        return self._connection

    def _end(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._process.kill()
            self._process.join()
        self._connection = self._process = None


def _work(connection: Connection, lowered: bool) -> None:
    if lowered:
        _lower_limits()
    from tests.fuzz.readers import READERS

    warnings.simplefilter("error", RuntimeWarning)  # a calculation that overflows
    with TemporaryDirectory() as folder:
        while True:
            try:
                kind, suffix = connection.recv()
                data = connection.recv_bytes()
            except EOFError:
                return
            path = Path(folder) / f"a{suffix}"
            path.write_bytes(data)
            del data
            found = [text for index, read in enumerate(READERS[kind]) for text in _judged(read, path, index)]
            path.unlink()
            connection.send(found)


def _lower_limits() -> None:
    os.environ["OPENCV_IO_MAX_IMAGE_PIXELS"] = str(64_000_000 // LIMIT_DIVISOR)
    from relit_camera.base.images import image_limits
    from relit_camera.base.video import video_decoding
    from relit_camera.face import matte_files
    from relit_camera.light.environments import environment_panorama
    from relit_camera.subject.compression import webp_packing

    for module, name in (
        (image_limits, "MAX_IMAGE_PIXELS"),
        (image_limits, "MAX_DECODED_BYTES"),
        (image_limits, "MAX_EXR_VALUES"),
        (video_decoding, "MAX_PIXELS"),
        (matte_files, "MAX_RECORDED_BYTES"),
        (environment_panorama, "MAX_PANORAMA_PIXELS"),
        (webp_packing, "MAX_IMAGE_PIXELS"),
    ):
        setattr(module, name, getattr(module, name) // LIMIT_DIVISOR)
    video_decoding.DECODER_LIMITS["max_pixels"] = str(video_decoding.MAX_PIXELS)


def _judged(read: Callable[[Path], object], path: Path, index: int) -> Sequence[str]:
    from relit_camera.base.errors import InputError

    found = []
    before_files = _open_files()
    Path("/proc/self/clear_refs").write_text("5")  # the peak of memory begins anew (proc(5))
    before, began = _memory("VmRSS"), time.process_time()
    try:
        kept = read(path)
        del kept
    except InputError as error:
        if not error.what or "\n" in str(error):
            found.append(f"an error without words: {str(error)[:100]!r}")
    except ValueError as error:
        if read.__name__ != "read_preset_file":  # whose callers expect it
            found.append(f"{type(error).__name__}: {str(error)[:100]}")
    except BaseException as error:
        found.append(f"{type(error).__name__}: {str(error)[:100]}")
    took, grown = time.process_time() - began, _memory("VmHWM") - before
    if grown > MOST_GROWN_BYTES:
        found.append(f"{grown >> 20} MiB")
    if took > MOST_CPU_S:
        found.append(f"{took:.1f} s")
    left = sorted(other.name for other in path.parent.iterdir() if other != path)
    if left:
        found.append(f"left behind {', '.join(left)}")
        for name in left:
            (path.parent / name).unlink()
    if _open_files() > before_files:
        gc.collect()
        if _open_files() > before_files:
            found.append("a file is left open")
    return [f"reader {index}: {text}" for text in found]


def _open_files() -> int:
    return sum(1 for _ in Path("/proc/self/fd").iterdir())


def _memory(name: str) -> int:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(name):
            return int(line.split()[1]) << 10
    raise OSError(f"no {name} in /proc/self/status")
