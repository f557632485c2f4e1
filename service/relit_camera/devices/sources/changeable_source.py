"""A source that may be missing at first, and can be replaced by another while it is read."""

from __future__ import annotations

import threading
from collections.abc import Callable

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.config.settings import SourceSettings
from relit_camera.base.errors import ConflictError, DeviceError
from relit_camera.base.images.image_types import Frame
from relit_camera.devices.device_discovery import FIRST_WEBCAM
from relit_camera.devices.on_demand.on_demand_source import OnDemandSource
from relit_camera.devices.sources.frame_numbering import FrameNumbering
from relit_camera.devices.sources.source import Source, SourceInfo, SourceState

TRIAL_S = 6.0
"""How long a new source may take to give its first frame."""
_POLL_S = 0.1

MakeSource = Callable[[SourceSettings], Source]


class ChangeableSource:
    """Reads the source that settings name: made as soon as its device is there, and replaced by `change`.

    While the device is missing, `read` raises why, and tries again at each call. Indices and times of the frames go on
    through every change.

    Attributes:
        settings: of the source that is read.
        opening_error: why the source could not be made at first; None where it could.
    """

    def __init__(
        self,
        settings: SourceSettings,
        make: MakeSource,
        wanted: Callable[[], bool] | None = None,
        clock: Clock = SYSTEM_CLOCK,
        before_new_source: Callable[[], object] = lambda: None,
    ) -> None:
        """Make the source that the settings name; nothing is opened before the first `read`.

        Args:
            settings: of the source.
            make: makes a source from settings.
            wanted: whether a source should be open now (on demand); None for always.
            clock: to measure and wait by.
            before_new_source: called in `read`, before the first frame of another device than the last frame's is
                returned, for whatever reason it is another: `webcam` means the first one that is there.

        Raises:
            RelitError: the settings are wrong; a device that is missing is no such error.
        """
        self.settings = settings
        self.opening_error: DeviceError | None = None
        self._make, self._wanted, self._clock = make, wanted, clock
        self._before_new_source = before_new_source
        self._last_read: tuple[str, str] | None = None  # kind and id of the source that gave the last frame
        self._numbering = FrameNumbering(clock)
        self._lock = threading.Lock()  # held while the source is exchanged, never while it is read
        self._changing = threading.Lock()
        self._closing = threading.Event()
        self._paused = False
        self._current: Source | None = None
        try:
            self._current = self._on_demand(make(settings))
        except DeviceError as error:
            self.opening_error = error

    def read(self, timeout_s: float) -> Frame | None:
        """Get the next frame, waiting up to `timeout_s` seconds; None if none came, and while the source is replaced.

        Raises:
            RelitError: the device is missing, or the source has failed for good.
        """
        with self._lock:
            source = self._present_source()
        if source is None:
            self._clock.wait(self._closing, timeout_s)
            return None
        frame = source.read(timeout_s)
        with self._lock:
            if frame is None or source is not self._current:
                return None  # of a source that was replaced meanwhile
            renumbered = self._numbering.renumber(frame)
        info = source.describe()
        if self._last_read not in (None, (info.kind, info.id)):
            self._before_new_source()
        self._last_read = info.kind, info.id
        return renumbered

    @property
    def state(self) -> SourceState:
        """The state of the source; `reconnecting` while its device is missing."""
        source = self._current
        if self._closing.is_set():
            return SourceState.ENDED
        if source is None:
            return SourceState.OPENING if self._paused else SourceState.RECONNECTING
        return source.state

    @property
    def reason(self) -> str:
        """One line saying why no frames come; empty while they do."""
        source = self._current
        return source.reason if source is not None else ""

    def describe(self) -> SourceInfo:
        """Facts about the source; what is asked for, while the device is missing."""
        source, asked = self._current, self.settings
        if source is not None:
            return source.describe()
        name = "" if asked.source == FIRST_WEBCAM else asked.source
        return SourceInfo("webcam", name, (asked.width, asked.height), asked.fps)

    def close(self) -> None:
        """Free the device for good."""
        self._closing.set()
        with self._lock:
            source = self._current
        if source is not None:
            source.close()

    def change(self, settings: SourceSettings) -> None:
        """Read the source of other settings from now on, once it has given a frame. Takes up to `TRIAL_S` seconds.

        The present one goes on meanwhile, unless it is the same device: that is closed first, since no device can be
        opened twice.

        Raises:
            ConflictError: the other source gives no frames, or another change is under way; the source is as before.
            RelitError: the settings are wrong, or there is no such device; likewise.
        """
        if not self._changing.acquire(blocking=False):
            raise ConflictError("the source is being changed already", "wait some seconds")
        try:
            other = self._make(settings)
            present = self._current
            if present is not None and _same_device(present.describe(), other.describe()):
                with self._lock:
                    self._current, self._paused = None, True
                present.close()
                present = None
            try:
                frame = self._first_frame(other)
            except BaseException:
                with self._lock:
                    self._paused = False  # one that was closed is made anew, from the settings as they were
                other.close()
                raise
            with self._lock:
                self._numbering.begin_source(frame.index + 1, frame.time_s)
                self._current, self._paused, self.settings = self._on_demand(other, is_open=True), False, settings
            if present is not None:
                present.close()
            if self._closing.is_set():
                other.close()
        finally:
            self._changing.release()

    def _present_source(self) -> Source | None:
        """The source to read, made if it is missing; None while it is replaced or closed."""
        if self._current is None and not self._paused and not self._closing.is_set():
            made = self._make(self.settings)
            self._numbering.begin_source()
            self._current = self._on_demand(made)
        return self._current

    def _on_demand(self, source: Source, is_open: bool = False) -> Source:
        if self._wanted is None:
            return source
        return OnDemandSource(source, lambda: self._make(self.settings), self._wanted, self._clock, is_open)

    def _first_frame(self, source: Source) -> Frame:
        """The first frame of a source.

        Raises:
            ConflictError: none came in time.
            RelitError: the source has failed for good.
        """
        until = self._clock.now() + TRIAL_S
        while self._clock.now() < until and not self._closing.is_set():
            frame = source.read(_POLL_S)
            if frame is not None:
                return frame
            if source.state in (SourceState.RECONNECTING, SourceState.ENDED):
                break
        what = source.reason or f"{source.describe().id or 'the source'} gives no frames"
        raise ConflictError(what, "close the program that uses it, or choose another; the camera goes on as before")


def _same_device(first: SourceInfo, second: SourceInfo) -> bool:
    return first.kind == second.kind == "webcam" and first.id == second.id
