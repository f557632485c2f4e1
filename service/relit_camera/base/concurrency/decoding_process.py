"""Decodes files that somebody else may have made in a process of its own, which has little to lose.

A decoder that is led astray takes gigabytes, minutes, or the process that it runs in. Here that is a worker, with
limits of memory and time, and not the camera. It is started when it is first needed, decodes one file at a time, and
ends when nothing has come for a while. What it answers is plain numbers and texts: nothing of it is unpickled.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relit_camera.base import errors
from relit_camera.base.concurrency.worker_process import become_worker, end_process, interrupts_blocked
from relit_camera.base.errors import InputError, NotReadyError, RelitError

MOST_BYTES = 2 << 30
"""Memory of the worker: the largest panorama takes 1.2 GB while it is decoded."""
CPU_LIMIT_S = 30
"""Processor time for one file, on Linux and macOS; the largest panorama takes some seconds."""
TIMEOUT_S = 90.0
"""Time for one file, however busy the computer is."""
START_TIMEOUT_S = 30.0
WAIT_S = 30.0
"""For files that came before: a request must not be held up by all of them."""
IDLE_S = 10.0
"""The worker is ended after this long without a file, or twice as long."""
MAX_ANSWER_BYTES = 1 << 30
PART_BYTES = 1 << 20
"""Arrays are sent in parts, each of which is held a second time for a moment."""
TAKEN, TAKEN_WITH_LITTLE = b"taken", b"taken, with little memory"
"""What the worker says to work that came; the latter where less memory is free than it may take."""
DTYPES = ("uint8", "float32")
_CURE = "it may be damaged, or made to do harm; save it again, or choose another"
_LITTLE_MEMORY = "too little free memory to decode a file", "close other programs and try again"


@dataclass(frozen=True, eq=False)
class Decoded:
    """What a file holds.

    Attributes:
        arrays: of `DTYPES`.
        facts: what JSON can hold, by name.
    """

    arrays: tuple[NDArray[Any], ...] = ()
    facts: Mapping[str, Any] = field(default_factory=dict)


class DecodingProcess:
    """The worker that decodes files for this process. Thread-safe: callers wait for each other."""

    def __init__(
        self,
        most_bytes: int = MOST_BYTES,
        cpu_limit_s: int = CPU_LIMIT_S,
        timeout_s: float = TIMEOUT_S,
        idle_s: float = IDLE_S,
        wait_s: float = WAIT_S,
    ) -> None:
        """Set up; no process is started. The limits are described at the constants of this module."""
        self._limits = most_bytes, cpu_limit_s
        self._timeout_s, self._idle_s, self._wait_s = timeout_s, idle_s, wait_s
        self._used_at = 0.0
        self._interrupts = 0
        self._has_little_memory = False
        self._lock = threading.Lock()
        self._process: Any = None
        self._connection: Connection | None = None

    def decode(self, function: Callable[..., Decoded], *arguments: object) -> Decoded:
        """What `function(*arguments)` returns, called in the worker.

        Args:
            function: of a module, since the other process imports it.
            arguments: are pickled.

        Raises:
            RelitError: what the function raised, if that is one.
            InputError: the worker died, or took too much memory or time: the file is at fault.
            NotReadyError: no worker can be started, files that came before take too long, there is too little free
                memory, or `interrupt` was called.
        """
        interrupts = self._interrupts
        if not self._lock.acquire(timeout=self._wait_s):
            raise NotReadyError("other files are being decoded", "try again in a minute")
        try:
            connection = self._with_work((function, arguments), interrupts)
            try:
                return _answer(connection, time.monotonic() + self._timeout_s)
            except NotReadyError:
                self._end()  # the next worker may have more memory
                raise
            except RelitError:
                raise
            except (EOFError, OSError, ValueError, KeyError, TypeError) as error:
                self._end()
                self._require_not_interrupted(interrupts)
                if self._has_little_memory and not isinstance(error, TimeoutError):
                    raise NotReadyError(*_LITTLE_MEMORY) from error
                reason = "too much time" if isinstance(error, TimeoutError) else "too much memory or time"
                raise InputError(f"the file takes {reason} to be decoded, or ends its decoder", _CURE) from error
            except BaseException:
                self._end()
                raise
            finally:
                self._used_at = time.monotonic()
        finally:
            self._lock.release()

    def close(self) -> None:
        """End the worker, if there is one."""
        with self._lock:
            self._end()

    def interrupt(self) -> None:
        """End the worker at once, also in the midst of a file, and refuse all who wait: for a program that stops.

        Files that come later start a worker.
        """
        self._interrupts += 1
        process = self._process
        if process is not None:
            with suppress(ValueError):  # it has been ended meanwhile
                process.kill()

    def _require_not_interrupted(self, interrupts: int) -> None:
        """Raise NotReadyError where `interrupt` was called after the `interrupts`th time."""
        if self._interrupts != interrupts:
            raise NotReadyError("the program stops", "try again when it runs again")

    def _with_work(self, work: object, interrupts: int) -> Connection:
        """The worker's connection, after it has taken the work."""
        for _ in range(2):  # one that the system has ended meanwhile takes none
            self._require_not_interrupted(interrupts)
            try:
                connection = self._connection or self._start()
                if self._interrupts != interrupts:  # it came before there was a process to be ended
                    self._end()
                    continue
                connection.send(work)
                self._has_little_memory = _receive(connection, time.monotonic() + START_TIMEOUT_S) == TAKEN_WITH_LITTLE
                return connection
            except (EOFError, OSError):
                self._end()
        self._require_not_interrupted(interrupts)
        raise NotReadyError("no process that decodes files can be started", "close other programs and try again")

    def _start(self) -> Connection:
        context = multiprocessing.get_context("spawn")
        self._connection, of_worker = context.Pipe()
        process = context.Process(target=_work, args=(of_worker, *self._limits), daemon=True)
        try:
            with interrupts_blocked():
                process.start()
        finally:
            of_worker.close()  # so that the end of the process ends the pipe
        self._process = process  # not before it can be killed
        threading.Thread(target=self._end_when_idle, args=(process,), name="decoder-idle", daemon=True).start()
        return self._connection

    def _end_when_idle(self, process: Any) -> None:
        while True:
            time.sleep(self._idle_s)
            with self._lock:
                if self._process is not process:
                    return
                if time.monotonic() - self._used_at >= self._idle_s:
                    self._end()
                    return

    def _end(self) -> None:
        if self._connection is not None:
            self._connection.close()
        if self._process is not None:
            end_process(self._process)
            with suppress(ValueError):  # one that cannot even be killed
                self._process.close()
        self._connection = self._process = None


DECODING_PROCESS = DecodingProcess()
"""The one of this process."""


def _receive(connection: Connection, deadline: float) -> bytes:
    """The next message.

    Raises:
        TimeoutError: it does not come in time.
        EOFError, OSError: the worker died.
    """
    if not connection.poll(max(0.0, deadline - time.monotonic())):
        raise TimeoutError
    return connection.recv_bytes(PART_BYTES)


def _answer(connection: Connection, deadline: float) -> Decoded:
    answer = json.loads(_receive(connection, deadline))
    if "error" in answer:
        name, what, cure = (str(text) for text in answer["error"])
        kind = getattr(errors, name, None)
        raise (kind if isinstance(kind, type) and issubclass(kind, RelitError) else InputError)(what, cure)
    arrays: list[NDArray[Any]] = []
    for dtype, shape in answer["arrays"]:
        if dtype not in DTYPES or sum(array.nbytes for array in arrays) + 4 * _count(shape) > MAX_ANSWER_BYTES:
            raise ValueError("an answer that no decoder gives")
        array = np.empty(shape, dtype)
        content, done = array.reshape(-1).view(np.uint8), 0
        while done < len(content):
            part = _receive(connection, deadline)
            content[done : done + len(part)] = np.frombuffer(part, np.uint8)
            done += len(part)
        arrays.append(array)
    return Decoded(tuple(arrays), answer["facts"])


def _count(shape: list[int]) -> int:
    count = 1
    for side in shape:
        count *= side if side >= 0 else MAX_ANSWER_BYTES
    return count


def _work(connection: Connection, most_bytes: int, cpu_limit_s: int) -> None:
    """Decode what comes, in the worker, until the other end is closed."""
    limit = become_worker(most_bytes)
    has_little_memory = limit is not None and limit < most_bytes
    while True:
        try:
            function, arguments = connection.recv()
        except EOFError:
            return
        connection.send_bytes(TAKEN_WITH_LITTLE if has_little_memory else TAKEN)
        _limit_processor_time(cpu_limit_s)
        try:
            decoded = function(*arguments)
        except RelitError as error:
            if has_little_memory and _is_about_memory(error):
                _send(connection, {"error": ["NotReadyError", *_LITTLE_MEMORY]})
                continue
            _send(connection, {"error": [type(error).__name__, error.what, error.cure]})
        except MemoryError:
            too_large = "InputError", "the file takes too much memory to be decoded", _CURE
            _send(connection, {"error": ["NotReadyError", *_LITTLE_MEMORY] if has_little_memory else [*too_large]})
        else:
            contents = [np.ascontiguousarray(array) for array in decoded.arrays]
            described = [[array.dtype.name, array.shape] for array in contents]
            _send(connection, {"arrays": described, "facts": decoded.facts})
            _send_arrays(connection, contents)
            del decoded, contents  # not to be held while the next file is decoded


def _send_arrays(connection: Connection, arrays: Sequence[NDArray[Any]]) -> None:
    for array in arrays:
        content = array.reshape(-1).view(np.uint8).data
        for start in range(0, len(content), PART_BYTES):
            connection.send_bytes(content[start : start + PART_BYTES])


def _is_about_memory(error: BaseException | None) -> bool:
    while error is not None and not isinstance(error, MemoryError):
        error = error.__cause__
    return error is not None


def _send(connection: Connection, answer: Mapping[str, Any]) -> None:
    connection.send_bytes(json.dumps(answer).encode())


def _limit_processor_time(limit_s: int) -> None:
    """Let this process take no more processor time than that from now on: the system ends it."""
    if sys.platform == "win32":
        return
    import resource

    used = int(sum(os.times()[:2])) + 1
    hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
    soft = used + limit_s
    resource.setrlimit(resource.RLIMIT_CPU, (soft if hard == resource.RLIM_INFINITY else min(soft, hard), hard))
    resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))
