"""Looks out for readers of the virtual camera, in a thread of its own: /proc may be long to read."""

from __future__ import annotations

import errno
import logging
import threading
from collections.abc import Callable

from relit_camera.stream.demand.usage import Unanswerable, Usage, driver_says, somebody_has_it_open

log = logging.getLogger(__name__)

ASK_EVERY_S, SCAN_EVERY_S = 0.25, 1.0
"""Seconds between questions to the driver, and between walks through /proc."""
GONE = (errno.ENOENT, errno.ENODEV, errno.ENXIO)
"""What a node says that is no more: nobody can read it."""


class ReaderWatch:
    """Knows whether anybody reads the virtual camera at a node, which may change.

    It begins with the first question. The driver is asked first; where it cannot answer, /proc is searched instead, for
    good, and the log says so once.
    """

    def __init__(self, node: Callable[[], str], ask: Usage = driver_says, scan: Usage = somebody_has_it_open) -> None:
        self._node, self._ask, self._scan = node, ask, scan
        self._driver_answers = True
        self._somebody = False
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="readers", daemon=True)

    def anybody(self) -> bool:
        """Whether somebody read it when it was last looked at: not a second ago."""
        if self._thread.ident is None and not self._stopping.is_set():
            self._somebody = self._look()  # the first answer is no guess
            self._thread.start()
        return self._somebody

    def close(self) -> None:
        """End the thread. Harmless when repeated."""
        self._stopping.set()

    def _run(self) -> None:
        while not self._stopping.wait(ASK_EVERY_S if self._driver_answers else SCAN_EVERY_S):
            self._somebody = self._look()

    def _look(self) -> bool:
        node = self._node()
        try:
            if self._driver_answers:
                return self._ask(node)
        except Unanswerable:
            self._driver_answers = False
            log.warning(
                "%s: this v4l2loopback does not tell who reads it (0.13 and newer do); only programs of the same user "
                "are noticed",
                node,
            )
        except OSError as error:
            return self._somebody and error.errno not in GONE  # crowded: as it was
        return self._scan(node)
