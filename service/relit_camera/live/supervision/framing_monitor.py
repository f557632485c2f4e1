"""Judges the framing of live frames some times a second, in a thread of its own that exists only while it is wanted."""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable
from dataclasses import asdict

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.concurrency.newest_slot import NewestSlot
from relit_camera.base.errors import NotReadyError, RelitError
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.face.detection.face_detector import FaceDetector
from relit_camera.face.framing.framing import Framing
from relit_camera.face.framing.framing_judge import judge_framing
from relit_camera.live.status.event_hub import EventHub

log = logging.getLogger(__name__)

WANTED_S = 10.0
"""For how long it is wanted after it was asked for."""
PERIOD_S = 0.4
"""Time between two frames that are judged."""
ANSWER_S = 3.0
"""How long `framing` waits for a frame to be judged: opening the detector takes some tenths of it."""


class FramingMonitor:
    """Takes a frame now and then from the camera's thread, and publishes the event `framing` for it.

    While it is not wanted, a frame costs one comparison, and neither thread nor network is kept.
    """

    def __init__(
        self,
        events: EventHub,
        open_detector: Callable[[], FaceDetector],
        judge: Callable[[DisplayImage, FaceDetector], Framing] = lambda image, detector: judge_framing(
            image, detector.detect_all(image)
        ),
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        """Set up.

        Args:
            events: where the event is published.
            open_detector: opens what finds faces; called each time that it begins to be wanted.
            judge: judges a frame's picture.
            clock: to measure and wait by.
        """
        self._events, self._open_detector, self._judge, self._clock = events, open_detector, judge, clock
        self._wanted_until = self._next_at = -math.inf
        self._frames: NewestSlot[Frame] = NewestSlot(clock)
        self._framing: NewestSlot[Framing | RelitError] = NewestSlot(clock)
        self._closing = threading.Event()
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None

    def offer(self, frame: Frame) -> None:
        """Let a frame be judged, if one is due."""
        now = frame.captured_at
        if self._next_at <= now < self._wanted_until:
            self._next_at = now + PERIOD_S
            self._frames.put(frame)

    def want(self, wanted: bool) -> None:
        """Judge frames for `WANTED_S` seconds from now on, or no longer."""
        with self._lock:
            self._wanted_until = self._clock.now() + WANTED_S if wanted else -math.inf
            if not wanted or self._thread is not None or self._closing.is_set():
                return
            self._next_at, self._frames = -math.inf, NewestSlot(self._clock)
            self._thread = threading.Thread(target=self.run, name="framing", daemon=True)
            self._thread.start()

    def framing(self) -> Framing:
        """The framing of a frame of now, waiting up to `ANSWER_S` seconds for one.

        Raises:
            NotReadyError: no frame came, or what finds faces cannot be opened.
        """
        after = self._framing.count
        self.want(True)
        found = self._framing.newer(after, ANSWER_S)
        if found is None:
            raise NotReadyError("no frames come from the source", "GET /api/v1/status says why")
        framing = found[1]
        if isinstance(framing, RelitError):
            raise NotReadyError(framing.what, framing.cure)
        return framing

    def close(self) -> None:
        """End the thread. Harmless when repeated."""
        self._closing.set()
        self._frames.close()
        self._framing.close()

    def run(self) -> None:
        """Judge frames in the calling thread while it is wanted."""
        try:
            detector, newest = self._open_detector(), self._frames.reader()
            while not self._ended():
                frame = newest.get(PERIOD_S)
                if frame is not None:
                    framing = self._judge(frame.image, detector)
                    self._framing.put(framing)
                    self._events.publish("framing", **asdict(framing))
        except RelitError as error:
            self._end(error)
        except Exception:  # nothing that a picture shows may leave the thread behind as if it ran
            log.exception("the framing cannot be judged")
            self._end(NotReadyError("the framing cannot be judged", "please report it"))

    def _ended(self) -> bool:
        """Whether it is no longer wanted; then another thread may be started."""
        with self._lock:
            if not self._closing.is_set() and self._clock.now() < self._wanted_until:
                return False
            self._thread = None
            return True

    def _end(self, error: RelitError) -> None:
        """Let whoever waits for the framing hear at once why none comes."""
        with self._lock:
            self._thread, self._wanted_until = None, -math.inf
        self._framing.put(error)
