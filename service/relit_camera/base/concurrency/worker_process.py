"""Runs a function in a process of its own, with a time limit: heavy or doubtful work that must not harm the camera."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from relit_camera.base.concurrency.threads import limit_threads
from relit_camera.base.errors import RelitError, WorkerError

T = TypeVar("T")

NICENESS = 10
"""Added to the worker's niceness (nice(2)): the camera and the call app come first."""
POLL_S = 0.05
EXIT_TIMEOUT_S = 2.0
_MEMORY_CURE = "there may be too little free memory"


def run_in_worker_process(
    function: Callable[..., T], *arguments: object, timeout_s: float, canceled: threading.Event | None = None
) -> T:
    """What `function(*arguments)` returns, called in a new process at low priority.

    The process is new (spawned, not forked: the camera has threads), so this takes half a second more.

    Args:
        function: of a module, since the other process imports it.
        arguments: are pickled, as is the result.
        timeout_s: after which the process is ended.
        canceled: ends the process when it is set; None for never.

    Raises:
        RelitError: what the function raised, if that is one.
        WorkerError: the function raised another error, or the process died, took too long, or was canceled.
    """
    context = multiprocessing.get_context("spawn")
    connection, of_worker = context.Pipe()
    process = context.Process(target=_work, args=(of_worker,), daemon=True)
    try:
        process.start()
    except OSError as error:
        connection.close()
        raise WorkerError(f"no worker process can be started: {error.strerror}", _MEMORY_CURE) from error
    finally:
        of_worker.close()  # so that the end of the process ends the pipe
    try:
        succeeded, result = _answer(connection, (function, arguments), timeout_s, canceled)
    except (EOFError, OSError):
        process.join(EXIT_TIMEOUT_S)
        raise WorkerError(f"the worker process died (exit code {process.exitcode})", _MEMORY_CURE) from None
    finally:
        connection.close()
        _end(process)
    if not succeeded:
        raise result
    value: T = result
    return value


def _answer(connection: Connection, work: object, timeout_s: float, canceled: threading.Event | None) -> Any:
    """What the worker answers to its work.

    Raises:
        WorkerError: it took too long, or was canceled.
        EOFError, OSError: it died.
    """
    # Not among the arguments of the process: a large one is never taken where the process dies at its start, for
    # `Process.start` itself holds the other end of that pipe open.
    connection.send(work)
    deadline = time.monotonic() + timeout_s
    while not connection.poll(POLL_S):
        if canceled is not None and canceled.is_set():
            raise WorkerError("the work was canceled", "start it again")
        if time.monotonic() > deadline:
            raise WorkerError(f"the work took more than {timeout_s:.0f} s", "close other programs and try again")
    return connection.recv()


def _end(process: Any) -> None:
    process.join(0.0)
    if process.is_alive():
        process.kill()
    process.join(EXIT_TIMEOUT_S)


def _work(connection: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole terminal; the camera ends this process
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if hasattr(os, "nice"):
        with suppress(OSError):
            os.nice(NICENESS)
    limit_threads()
    try:
        function, arguments = connection.recv()
        answer: tuple[bool, object] = (True, function(*arguments))
    except RelitError as error:
        answer = (False, error)
    except Exception as error:
        what = f"the work failed in a way that nobody expected ({type(error).__name__}: {error})"
        answer = (False, WorkerError(what, "please report it"))
    connection.send(answer)
    connection.close()


def _end_with_parent() -> None:
    """End this process when the one that asks for its work is killed: nobody else would set it a limit then."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
