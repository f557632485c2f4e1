"""A source that is open only while somebody reads the camera's output, and what decides that.

`DemandWatch` knows whether anybody reads the sink or watches a preview, and an `OnDemandSource` opens and closes the
webcam accordingly.
"""

from __future__ import annotations

import logging
import math
import sys
import threading
from collections.abc import Callable

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.errors import ConfigError
from relit_camera.base.images.image_types import Frame
from relit_camera.devices.on_demand.reader_detection import ReaderMonitor
from relit_camera.devices.sinks.sink import Sink
from relit_camera.devices.sources.frame_numbering import FrameNumbering
from relit_camera.devices.sources.source import Source, SourceInfo, SourceState

log = logging.getLogger(__name__)

IDLE_TIMEOUT_S = 5.0
"""The webcam stays open for so long after the last reader: call apps close and reopen the camera while they start."""


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
        self,
        first: Source,
        make: Callable[[], Source],
        wanted: Callable[[], bool],
        clock: Clock = SYSTEM_CLOCK,
        is_open: bool = False,
    ) -> None:
        """Begin released.

        Args:
            first: read when a source is first wanted.
            make: makes a new source, each time after that.
            wanted: whether a source should be open now; called at each `read`.
            clock: to measure and wait by.
            is_open: whether `first` was read already: then it is closed if it is not wanted.
        """
        self._source: Source | None = first
        self._make, self._wanted, self._clock = make, wanted, clock
        self._info = first.describe()
        self._began = is_open
        self._closing = threading.Event()
        self._lock = threading.Lock()  # `close` comes from another thread than `read`
        self._numbering = FrameNumbering(clock)

    def read(self, timeout_s: float) -> Frame | None:
        """Get the next frame, waiting up to `timeout_s` seconds; None while it is not wanted.

        Raises:
            DeviceError: the device is gone; it is looked for again at the next call.
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
        return source.state if source is not None and self._began else SourceState.RELEASED

    @property
    def reason(self) -> str:
        """One line saying why no frames come; empty while they do, and while it is not wanted."""
        source = self._source
        return "" if source is None else source.reason

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
        return self._numbering.renumber(frame)

    def _release(self) -> None:
        """Close the source, if it is open."""
        with self._lock:
            if self._source is None or not self._began:
                return
            source, self._source, self._began = self._source, None, False
            source.close()
        log.info("nobody reads the camera: %s is closed", self._info.id)

    def _opened_source(self) -> Source | None:
        with self._lock:
            if self._closing.is_set():
                return None
            if self._source is None:
                self._source = self._make()
                log.info("somebody reads the camera: %s is opened", self._info.id)
            if not self._began:
                self._began = True
                self._numbering.begin_source()
            return self._source


def require_known_readers() -> None:
    """Check that this system tells who reads a virtual camera.

    Raises:
        ConfigError: it does not.
    """
    if not sys.platform.startswith("linux"):
        raise ConfigError(
            "source.on_demand: only Linux tells who reads a virtual camera", "leave it out on this system"
        )


class DemandWatch:
    """Tells whether a sink wants pictures: a virtual camera while it is read, a file always, `null` never.

    Viewers of a preview count as readers of any sink.
    """

    def __init__(self, sink: Sink) -> None:
        """Wire the parts.

        Raises:
            ConfigError: this system does not tell who reads a virtual camera, or the sink is of another kind.
        """
        kind = sink.describe().kind
        if kind not in ("camera", "file", "null"):
            raise ConfigError(f"source.on_demand: a sink of kind '{kind}' does not tell who reads it", "leave it out")
        if kind == "camera":
            require_known_readers()
        self._sink, self._kind = sink, kind
        self._device_readers = ReaderMonitor(lambda: sink.describe().id)
        self._demand = DemandMonitor(self._has_readers)

    def wanted(self) -> bool:
        """Whether a source should be open now."""
        return self._demand.wanted()

    def note_viewer(self) -> None:
        """Note that somebody asks for a preview or a snapshot. May be called from any thread."""
        self._demand.note_viewer()

    def close(self) -> None:
        """Stop watching the sink."""
        self._device_readers.close()

    def _has_readers(self) -> bool:
        """Whether anybody reads: PipeWire tells it by itself, the driver of a device is asked."""
        if self._kind != "camera":
            return self._kind == "file"
        info = self._sink.describe()
        through_pipewire = info.pipewire is not None and bool(info.pipewire.count)
        return through_pipewire or (bool(info.id) and self._device_readers.has_readers())
