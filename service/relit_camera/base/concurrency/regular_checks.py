"""Looking at something regularly while the camera runs, such as whether a file was edited."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock

PERIOD_S = 1.0
STOP_TIMEOUT_S = 2.0
"""How long the end of a check is waited for: a network folder may hang."""


def check_until(stopping: threading.Event, check: Callable[[], object], clock: Clock = SYSTEM_CLOCK) -> None:
    """Call `check` each `PERIOD_S` seconds in the calling thread, until `stopping` is set."""
    while not clock.wait(stopping, PERIOD_S):
        check()


@contextmanager
def checking_regularly(
    thread_name: str, check: Callable[[], object], at_end: bool = False, clock: Clock = SYSTEM_CLOCK
) -> Iterator[None]:
    """Within the block: call `check` once a second, in a thread.

    Args:
        thread_name: of that thread.
        check: is called; it must not raise.
        at_end: whether it is called once more, when the block is left, unless the last call hangs.
        clock: to wait by.
    """
    stopping = threading.Event()
    thread = threading.Thread(target=check_until, args=(stopping, check, clock), name=thread_name, daemon=True)
    thread.start()
    try:
        yield
    finally:
        stopping.set()
        thread.join(STOP_TIMEOUT_S)
        if at_end and not thread.is_alive():
            check()
