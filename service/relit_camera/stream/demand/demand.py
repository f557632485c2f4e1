"""Whether the webcam is wanted: somebody reads the virtual camera or watches a preview, or did a moment ago."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

LINGER_S = 5.0
"""The webcam is kept for so long after the last look: call apps let go and take again while they are being set up."""


class Demand:
    """Wanted while anybody reads or views, and `linger_s` seconds longer."""

    def __init__(
        self,
        anybody_reads: Callable[[], bool],
        linger_s: float = LINGER_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._anybody_reads, self._linger_s, self._clock = anybody_reads, linger_s, clock
        self._seen_at = -math.inf

    def note_viewer(self) -> None:
        """Somebody has just asked for a preview or a snapshot. Any thread may say so."""
        self._seen_at = self._clock()

    def wanted(self) -> bool:
        """Whether the webcam should be open now."""
        if self._anybody_reads():
            self._seen_at = self._clock()
        return self._clock() - self._seen_at < self._linger_s
