"""Whether the webcam is wanted: somebody reads the virtual camera or watches a preview, or did a moment ago.

A source that is open only while it is wanted.

On-demand mode, wired: who reads the virtual camera decides whether the webcam is open.
"""

from __future__ import annotations

import logging
import math
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace

from relit_camera.base.errors import ConfigError, DeviceError
from relit_camera.base.images.image_types import Frame
from relit_camera.devices.on_demand.reader_detection import ReaderMonitor
from relit_camera.devices.sinks.sink import Sink
from relit_camera.devices.sources.source import Source, SourceInfo, SourceState

IDLE_TIMEOUT_S = 5.0
"""The webcam is kept for so long after the last look: call apps let go and take again while they are being set up."""


class DemandMonitor:
    """Wanted while anybody reads or views, and `idle_timeout_s` seconds longer."""

    def __init__(
        self,
        has_readers: Callable[[], bool],
        idle_timeout_s: float = IDLE_TIMEOUT_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._has_readers, self._idle_timeout_s, self._clock = has_readers, idle_timeout_s, clock
        self._last_demand_at = -math.inf

    def note_viewer(self) -> None:
        """Somebody has just asked for a preview or a snapshot. Any thread may say so."""
        self._last_demand_at = self._clock()

    def wanted(self) -> bool:
        """Whether the webcam should be open now."""
        if self._has_readers():
            self._last_demand_at = self._clock()
        return self._clock() - self._last_demand_at < self._idle_timeout_s


log = logging.getLogger(__name__)

RETRY_S = 1.0
"""Pause after the camera could not be found."""


class OnDemandSource:
    """Closes the source that it wraps while nobody wants it, and makes a new one when somebody does.

    Closing frees the device, so that a webcam's light goes out. Indices and times go on through the pauses.
    """

    def __init__(self, first: Source, make: Callable[[], Source], wanted: Callable[[], bool]) -> None:
        """Begin released.

        Args:
            first: read when it is first wanted; nothing of it is open yet.
            make: gives a new source, each time after that.
            wanted: whether a source should be open now; asked at each `read`.
        """
        self._source: Source | None = first
        self._make, self._wanted = make, wanted
        self._info = first.describe()
        self._began = False
        self._closing = threading.Event()
        self._lock = threading.Lock()  # `close` comes from another thread than `read`
        self._reason = ""
        self._retry_at = 0.0
        self._started_at = time.monotonic()
        self._first = self._next_index = 0
        self._resumed_s = 0.0

    def read(self, timeout_s: float) -> Frame | None:
        """Get the next frame, waiting up to `timeout_s` seconds; None while it is not wanted.

        Raises:
            RelitError: the source has failed for good.
        """
        if not self._wanted():
            self._release()
        elif (source := self._opened_source()) is not None:
            return self._renumber(source.read(timeout_s), source)
        self._closing.wait(timeout_s)
        return None

    @property
    def state(self) -> SourceState:
        """What the source is doing: `released` while nobody wants it."""
        source = self._source
        if self._closing.is_set():
            return SourceState.ENDED
        if source is None:
            return SourceState.RECONNECTING if self._reason else SourceState.RELEASED
        return source.state if self._began else SourceState.RELEASED

    @property
    def reason(self) -> str:
        """One line saying why no frames come; empty while they do, and while it is not wanted."""
        source = self._source
        return self._reason if source is None else source.reason

    def describe(self) -> SourceInfo:
        """Say what the source is."""
        return self._info

    def close(self) -> None:
        """Free the device for good."""
        self._closing.set()
        with self._lock:
            if self._source is not None:
                self._source.close()

    def _renumber(self, frame: Frame | None, source: Source) -> Frame | None:
        if frame is None:
            return None
        self._info = source.describe()
        self._next_index = self._first + frame.index + 1
        return replace(frame, index=self._first + frame.index, time_s=self._resumed_s + frame.time_s)

    def _release(self) -> None:
        """Close the source, if it is open."""
        self._reason = ""
        with self._lock:
            if self._source is None or not self._began:
                return
            source, self._source, self._began = self._source, None, False
            self._first = self._next_index
            source.close()
        log.info("nobody looks: %s is let go", self._info.id)

    def _opened_source(self) -> Source | None:
        with self._lock:
            if self._closing.is_set():
                return None
            if self._source is None:
                self._source = self._create_source()
            if self._source is not None and not self._began:
                self._began = True
                self._resumed_s = time.monotonic() - self._started_at if self._first else 0.0
            return self._source

    def _create_source(self) -> Source | None:
        """Make a source, or give None with the reason noted: a camera may have been unplugged meanwhile."""
        now = time.monotonic()
        if now < self._retry_at:
            return None
        try:
            source = self._make()
        except DeviceError as error:
            self._reason, self._retry_at = error.what, now + RETRY_S
            return None
        self._reason = ""
        log.info("somebody looks: %s is taken", self._info.id)
        return source


class OnDemandController:
    """Watches a sink for readers: a virtual camera by its node; a file always wants pictures, `null` never does.

    Attributes:
        source: to be read in place of the plain one.
    """

    def __init__(self, first: Source, make: Callable[[], Source], sink: Sink) -> None:
        """Wire the parts; `first` and `make` are `OnDemandSource`'s.

        Raises:
            ConfigError: this system does not tell who reads a virtual camera.
        """
        kind = sink.describe().kind
        self._watch = ReaderMonitor(lambda: sink.describe().id) if kind == "camera" else None
        if self._watch is not None and not sys.platform.startswith("linux"):
            raise ConfigError(
                "source.on_demand: only Linux tells who reads a virtual camera", "leave it out on this system"
            )
        self._demand = DemandMonitor(self._watch.has_readers if self._watch else lambda: kind == "file")
        self.source = OnDemandSource(first, make, self._demand.wanted)

    def note_viewer(self) -> None:
        """Somebody asks for a preview or a snapshot: that counts as reading."""
        self._demand.note_viewer()

    def close(self) -> None:
        """End what watches. The source belongs to whoever reads it."""
        if self._watch is not None:
            self._watch.close()
