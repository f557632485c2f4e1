"""Runs a function in a process of its own, with limits: heavy or doubtful work that must not harm the camera."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, TypeVar

import psutil

from relit_camera.base.concurrency.threads import limit_threads
from relit_camera.base.errors import RelitError, WorkerError

T = TypeVar("T")

NICENESS = 10
"""Added to the worker's niceness (nice(2)): the camera and the call app come first."""
KILLED_FIRST = "500"
"""Added to the worker's score by which Linux chooses what to end where memory runs out (proc(5), oom_score_adj)."""
MEMORY_SHARE = 0.8
"""Of the memory that is free at its start, how much a worker may take."""
POLL_S = 0.05
EXIT_TIMEOUT_S = 2.0
_MEMORY_CURE = "there may be too little free memory"


Progress = Callable[[str, int, int | None], None]
"""Called with the name of a stage, how much of it is done, and how much there is, None where that is unknown."""


def run_in_worker_process(
    function: Callable[..., T],
    *arguments: object,
    timeout_s: float,
    canceled: threading.Event | None = None,
    progress: Progress | None = None,
    most_bytes: int | None = None,
) -> T:
    """What `function(*arguments)` returns, called in a new process at low priority.

    The process is new (spawned, not forked: the camera has threads), so this takes half a second more.

    Args:
        function: of a module, since the other process imports it.
        arguments: are pickled, as is the result.
        timeout_s: after which the process is ended.
        canceled: ends the process when it is set; None for never.
        progress: hears what the function tells: it is called with one argument more, a `Progress`, after the others.
        most_bytes: memory that the process may take, or `MEMORY_SHARE` of what is free, if that is less; on Linux. None
            sets no limit.

    Raises:
        RelitError: what the function raised, if that is one.
        WorkerError: the function raised another error, or the process died, took too long or too much memory, or was
            canceled.
    """
    context = multiprocessing.get_context("spawn")
    connection, of_worker = context.Pipe()
    process = context.Process(target=_work, args=(of_worker, progress is not None, most_bytes), daemon=True)
    try:
        with interrupts_blocked():
            process.start()
    except OSError as error:
        connection.close()
        raise WorkerError(f"no worker process can be started: {error.strerror}", _MEMORY_CURE) from error
    finally:
        of_worker.close()  # so that the end of the process ends the pipe
    try:
        succeeded, result = _answer(connection, (function, arguments), timeout_s, canceled, progress)
    except (EOFError, OSError):
        process.join(EXIT_TIMEOUT_S)
        raise WorkerError(f"the worker process died (exit code {process.exitcode})", _MEMORY_CURE) from None
    finally:
        connection.close()
        end_process(process)
    if not succeeded:
        raise result
    value: T = result
    return value


@contextmanager
def interrupts_blocked() -> Iterator[None]:
    """Block SIGINT in this thread, and so in a process that it starts: Ctrl-C reaches the whole terminal.

    Without this, Ctrl-C while Python starts in the worker would print a traceback there.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # the first worker's start would start it, and lift the block
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _answer(
    connection: Connection,
    work: object,
    timeout_s: float,
    canceled: threading.Event | None,
    progress: Progress | None,
) -> Any:
    """What the worker answers to its work.

    Raises:
        WorkerError: it took too long, or was canceled.
        EOFError, OSError: it died.
    """
    # Not among the arguments of the process: a large one is never taken where the process dies at its start, for
    # `Process.start` itself holds the other end of that pipe open.
    connection.send(work)
    deadline = time.monotonic() + timeout_s
    while True:
        if canceled is not None and canceled.is_set():
            raise WorkerError("the work was canceled", "start it again")
        if time.monotonic() > deadline:
            raise WorkerError(f"the work took more than {timeout_s:.0f} s", "close other programs and try again")
        if not connection.poll(POLL_S):
            continue
        kind, *answer = connection.recv()
        if kind == "answer":
            return answer
        if progress is not None:
            progress(*answer)


def end_process(process: Any) -> None:
    """Kill a process that still runs, and wait for its end."""
    process.join(0.0)
    if process.is_alive():
        process.kill()
    process.join(EXIT_TIMEOUT_S)


def become_worker(most_bytes: int | None) -> int | None:
    """Make this process one that works for another: at low priority, ended with it, with a limit of memory.

    Args:
        most_bytes: as of `run_in_worker_process`.

    Returns:
        The limit of memory in bytes, which is less than `most_bytes` where little is free; None for none.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole terminal; the camera ends this process
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if hasattr(os, "nice"):
        with suppress(OSError):
            os.nice(NICENESS)
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(KILLED_FIRST)
    limit_threads()
    return _limit_memory(most_bytes)


def _work(connection: Connection, tells_progress: bool, most_bytes: int | None) -> None:
    become_worker(most_bytes)

    def tell(stage: str, done: int, total: int | None) -> None:
        connection.send(("progress", stage, done, total))

    try:
        function, arguments = connection.recv()
        answer: tuple[bool, object] = (True, function(*arguments, *([tell] if tells_progress else [])))
    except RelitError as error:
        answer = (False, error)
    except MemoryError:
        answer = (False, WorkerError("the work needs more memory than is free", "close other programs and try again"))
    except Exception as error:
        what = f"the work failed in a way that nobody expected ({type(error).__name__}: {error})"
        answer = (False, WorkerError(what, "please report it"))
    connection.send(("answer", *answer))
    connection.close()


def _limit_memory(most_bytes: int | None) -> int | None:
    """Let this process take no more memory than that, and than a share of what is free; returns what it may take."""
    if most_bytes is None or not sys.platform.startswith("linux"):
        return None
    import resource

    most = min(most_bytes, int(MEMORY_SHARE * psutil.virtual_memory().available))
    hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
    # Not the address space: networks and files that are mapped into it need no memory of their own.
    most = most if hard == resource.RLIM_INFINITY else min(most, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (most, hard))
    return most


def _end_with_parent() -> None:
    """End this process when the one that asks for its work is killed: nobody else would set it a limit then."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
