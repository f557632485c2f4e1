"""Runs the checks of the machine in a worker process, whose libraries the camera need not keep in memory."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from typing import Any

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.concurrency.worker_process import run_in_worker_process
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.errors import WorkerError
from relit_camera.live.status.setup_status import Check, CheckState

KEPT_S = 5.0
"""For how long an answer is given again."""
TIMEOUT_S = 60.0
"""After which the checks are given up: a network folder may hang."""

Checks = Callable[[Mapping[str, Any]], tuple[Check, ...]]
"""Checks what the camera needs with some settings, given as `RelitSettings.model_dump` does. A function of a module,
since another process imports it."""


def no_checks(_: Mapping[str, Any]) -> tuple[Check, ...]:
    """Checks nothing."""
    return ()


class CheckRunner:
    """Answers what the checks found, at most `KEPT_S` seconds ago. Whoever asks meanwhile waits for the same answer."""

    def __init__(
        self,
        checks: Checks,
        in_process: Callable[..., tuple[Check, ...]] = run_in_worker_process,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        """Set up.

        Args:
            checks: the checks.
            in_process: runs a function in a process of its own.
            clock: to measure by.
        """
        self._checks, self._in_process, self._clock = checks, in_process, clock
        self._lock = threading.Lock()
        self._made_at = -math.inf
        self._found: tuple[Check, ...] = ()
        self._canceled = threading.Event()

    def found(self, settings: RelitSettings) -> tuple[Check, ...]:
        """What the checks find. Where they themselves fail, that is the one check, of state unknown."""
        with self._lock:
            if self._clock.now() - self._made_at > KEPT_S:
                try:
                    self._found = self._in_process(
                        self._checks, settings.model_dump(), timeout_s=TIMEOUT_S, canceled=self._canceled
                    )
                except WorkerError as error:
                    self._found = (Check("checks", "Checks", CheckState.UNKNOWN, error.what, error.cure),)
                self._made_at = self._clock.now()
            return self._found

    def forget(self) -> None:
        """Let the checks run again for the next one who asks: something was mended."""
        self._made_at = -math.inf

    def close(self) -> None:
        """End checks that run. Harmless when repeated."""
        self._canceled.set()
