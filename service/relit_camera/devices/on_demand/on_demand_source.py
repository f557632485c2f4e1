"""A source that is open only while somebody reads the camera's output, and what decides that.

`OnDemandController` wires the parts: a `DemandMonitor` knows whether anybody reads the sink or watches a preview, and
an `OnDemandSource` opens and closes the webcam accordingly.
"""

from __future__ import annotations

import logging
import math
import sys
import threading
from collections.abc import Callable
from dataclasses import replace

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.errors import ConfigError, DeviceError
from relit_camera.base.images.image_types import Frame
from relit_camera.devices.on_demand.reader_detection import ReaderMonitor
from relit_camera.devices.sinks.sink import Sink
from relit_camera.devices.sources.source import Source, SourceInfo, SourceState

log = logging.getLogger(__name__)

IDLE_TIMEOUT_S = 5.0
"""The webcam stays open for so long after the last reader: call apps close and reopen the camera while they start."""
RETRY_S = 1.0
"""Pause in seconds after the webcam could not be found."""


class DemandMonitor:
    """Tells whether the webcam is wanted: while anybody reads or views, and `idle_timeout_s` seconds longer."""

    def __init__(
        self,
        has_readers: Callable[[], bool],
        idle_timeout_s: float = IDLE_TIMEOUT_S,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        self._has_readers, self._idle_timeout_s, self._clock = has_readers, idle_timeout_s, clock
        self._last_demand_at = -math.inf

    def note_viewer(self) -> None:
        """Note that somebody has just asked for a preview or a snapshot. May be called from any thread."""
        self._last_demand_at = self._clock.now()

    def wanted(self) -> bool:
        """Whether the webcam should be open now."""
        if self._has_readers():
            self._last_demand_at = self._clock.now()
        return self._clock.now() - self._last_demand_at < self._idle_timeout_s


class OnDemandSource:
    """A source that wraps another: closed while it is not wanted, and made anew when it is.

    Closing frees the device, so that a webcam's light goes out. Indices and times of the frames go on through the
    pauses.
    """

    def __init__(
        self, first: Source, make: Callable[[], Source], wanted: Callable[[], bool], clock: Clock = SYSTEM_CLOCK
    ) -> None:
        """Begin released.

        Args:
            first: read when a source is first wanted; it must not be open yet.
            make: makes a new source, each time after that.
            wanted: whether a source should be open now; called at each `read`.
            clock: to measure and wait by.
        """
        self._source: Source | None = first
        self._make, self._wanted, self._clock = make, wanted, clock
        self._info = first.describe()
        self._began = False
        self._closing = threading.Event()
        self._lock = threading.Lock()  # `close` comes from another thread than `read`
        self._reason = ""
        self._retry_at = 0.0
        self._started_at = clock.now()
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
        self._clock.wait(self._closing, timeout_s)
        return None

    @property
    def state(self) -> SourceState:
        """What the source is doing: `released` while it is not wanted."""
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
        log.info("nobody reads the camera: %s is closed", self._info.id)

    def _opened_source(self) -> Source | None:
        with self._lock:
            if self._closing.is_set():
                return None
            if self._source is None:
                self._source = self._create_source()
            if self._source is not None and not self._began:
                self._began = True
                self._resumed_s = self._clock.now() - self._started_at if self._first else 0.0
            return self._source

    def _create_source(self) -> Source | None:
        """Make a source; None if the device is gone, with the reason noted."""
        now = self._clock.now()
        if now < self._retry_at:
            return None
        try:
            source = self._make()
        except DeviceError as error:
            self._reason, self._retry_at = error.what, now + RETRY_S
            return None
        self._reason = ""
        log.info("somebody reads the camera: %s is opened", self._info.id)
        return source


def require_known_readers() -> None:
    """Check that this system tells who reads a virtual camera.

    Raises:
        ConfigError: it does not.
    """
    if not sys.platform.startswith("linux"):
        raise ConfigError(
            "source.on_demand: only Linux tells who reads a virtual camera", "leave it out on this system"
        )


class OnDemandController:
    """Opens the source on demand of a sink: a virtual camera while it is read, a file always, `null` never.

    Viewers of a preview count as readers of any sink.

    Attributes:
        source: to be read in place of the plain one.
    """

    def __init__(self, first: Source, make: Callable[[], Source], sink: Sink) -> None:
        """Wire the parts; `first` and `make` are `OnDemandSource`'s.

        Raises:
            ConfigError: this system does not tell who reads a virtual camera, or the sink is of another kind.
        """
        kind = sink.describe().kind
        if kind not in ("camera", "file", "null"):
            raise ConfigError(f"source.on_demand: a sink of kind '{kind}' does not tell who reads it", "leave it out")
        if kind == "camera":
            require_known_readers()
        self._readers = ReaderMonitor(lambda: sink.describe().id) if kind == "camera" else None
        self._demand = DemandMonitor(self._readers.has_readers if self._readers else lambda: kind == "file")
        self.source = OnDemandSource(first, make, self._demand.wanted)

    def note_viewer(self) -> None:
        """Note that somebody asks for a preview or a snapshot. May be called from any thread."""
        self._demand.note_viewer()

    def close(self) -> None:
        """Stop watching the sink. The source stays open: it belongs to whoever reads it."""
        if self._readers is not None:
            self._readers.close()
