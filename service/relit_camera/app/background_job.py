"""One piece of work at a time beside the camera, in a thread of its own, which can be canceled and tells its end."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, TypeVar

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.errors import ConflictError, RelitError
from relit_camera.base.storage.folder_redaction import redact_folders
from relit_camera.live.status.event_hub import EventHub

log = logging.getLogger(__name__)

T = TypeVar("T")

CANCEL_TIMEOUT_S = 3.0
"""How long a canceled piece of work may take to end: a worker process is ended within two seconds."""


class BackgroundJob:
    """Whoever takes it has the turn until their work ends; all others are refused meanwhile. Thread-safe.

    Attributes:
        lock: held while the turn changes hands; statuses that must fit to the turn are changed under it.
    """

    def __init__(
        self,
        thread_name: str,
        busy: str,
        cure: str = "wait for its end, or cancel it",
        shared: threading.Lock | None = None,
    ) -> None:
        """Set up.

        Args:
            thread_name: of the thread in which the work runs.
            busy: what is told to those who are refused.
            cure: what they can do.
            shared: is held by one job of those that share it: they need the same thing.
        """
        self._thread_name, self._busy, self._cure = thread_name, busy, cure
        self._shared = threading.Lock() if shared is None else shared
        self._has_shared = False
        self.lock = threading.RLock()
        self._ended = threading.Condition(self.lock)
        self._turn: threading.Event | None = None
        self._handed_over = False

    @property
    def is_running(self) -> bool:
        """Whether somebody has the turn."""
        return self._turn is not None

    @contextmanager
    def taken(self) -> Iterator[threading.Event]:
        """Take the turn for the block, or until the work ends that `begin` starts in it.

        The event that it gives is set where somebody cancels.

        Raises:
            ConflictError: somebody has the turn, or a job runs that needs the same thing.
        """
        with self.lock:
            if self._turn is not None:
                raise ConflictError(self._busy, self._cure)
            self.require_shared()
            turn, self._handed_over = threading.Event(), False
            self._turn = turn
        try:
            yield turn
        finally:
            with self.lock:
                if self._turn is turn and not self._handed_over:
                    self._give_back()

    def begin(self, work: Callable[[], T], ended: Callable[[T], object]) -> None:
        """Work in a thread; whoever has the turn calls this, once.

        Args:
            work: is called in the thread; it must not raise.
            ended: is called with what that returns. The turn is free to whoever hears of the end by it.
        """

        def run() -> None:
            result = work()
            with self.lock:
                self._give_back()
                ended(result)

        with self.lock:
            threading.Thread(target=run, name=self._thread_name, daemon=True).start()
            self._handed_over = True

    def cancel(self, timeout_s: float = CANCEL_TIMEOUT_S, only: Callable[[], bool] = lambda: True) -> None:
        """Cancel the work of whoever has the turn, if somebody has, and wait for its end.

        With `only` it is canceled where that answers True: it is called while nobody else can take the turn.
        """
        with self.lock:
            turn = self._turn
            if turn is not None and only():
                turn.set()
                self._ended.wait_for(lambda: self._turn is not turn, timeout_s)

    def take_shared(self) -> bool:
        """Take what other jobs need as well, as `taken` does, after `leave_shared`; returns whether it was free."""
        with self.lock:
            self._has_shared = self._has_shared or self._shared.acquire(blocking=False)
            return self._has_shared

    def require_shared(self) -> None:
        """Take what other jobs need as well.

        Raises:
            ConflictError: a job runs that has it.
        """
        if not self.take_shared():
            raise ConflictError("another capture runs", "wait for its end, or cancel it")

    def leave_shared(self) -> None:
        """Let other jobs have what they need as well, during a pause of the work."""
        with self.lock:
            if self._has_shared:
                self._has_shared = False
                self._shared.release()

    def _give_back(self) -> None:
        self._turn = None
        self.leave_shared()
        self._ended.notify_all()


class StatusEvents:
    """Publishes the statuses of a job as events of one kind, those of little news not too often."""

    def __init__(self, events: EventHub, kind: str, interval_s: float, clock: Clock = SYSTEM_CLOCK) -> None:
        """`interval_s` is the least time between an event of little news and the one before it."""
        self._events, self._kind, self._interval_s, self._clock = events, kind, interval_s, clock
        self._told_at = float("-inf")

    def publish(self, status: Mapping[str, Any], seldom: bool = False) -> None:
        """Publish a status; with `seldom` only if nothing was published for a while."""
        now = self._clock.now()
        if not seldom or now >= self._told_at + self._interval_s:
            self._told_at = now
            self._events.publish(self._kind, **status)


def describe_failure(doing: str, error: Exception, named: Mapping[str, str] | None = None) -> tuple[str, str]:
    """What is wrong and its cure, for the status of a job: no folder of this machine is named. The log has all of it.

    Args:
        doing: name of the job, such as "replay".
        error: that ended it; any but a `RelitError` is a fault of the program.
        named: what people call something in the error's text, such as a file that they sent.
    """
    if not isinstance(error, RelitError):
        log.error("%s: it failed in a way that nobody expected", doing, exc_info=error)
        what = f"it failed in a way that nobody expected ({type(error).__name__}: {error})"
        return redact_folders(what), "please report it"
    log.warning("%s: %s", doing, error)
    what = error.what
    for text, name in (named or {}).items():
        what = what.replace(text, name)
    return redact_folders(what), redact_folders(error.cure)
