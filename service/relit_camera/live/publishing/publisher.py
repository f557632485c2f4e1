"""Writes a picture to the sink at every tick of the output's frame rate, whatever the pipeline does."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.concurrency.newest_slot import NewestSlot
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.devices.sinks.sink import Sink
from relit_camera.live.publishing.pacing import Pacer
from relit_camera.live.status.camera_status import FrameCounts, Percentiles
from relit_camera.live.status.stage_timing import DurationWindow, RateMeter

log = logging.getLogger(__name__)

RETRY_S = 1.0
"""Pause in seconds after a failed write."""
STOP_TIMEOUT_S = 1.0
"""Seconds for which `stop` waits for the thread."""
LATE_FRAME_GRACE = 0.4
"""Share of a period for which a tick waits for a late picture: so it is late by that much, not by a whole period."""


LATE_TICK_S = 1.0
"""Where a tick comes later than its period by so much, the whole program had stood still: the last picture is shown on,
and not as stale."""


@dataclass(frozen=True)
class PublishedPicture:
    """A finished picture on its way to the sink.

    Attributes:
        image: uint8 sRGB RGB (height, width, 3), of the sink's size; never modified again.
        captured_at: monotonic seconds at which the frame it was rendered from arrived; latency is measured from here.
        frame_index: that frame's index.
        unlit: whether it is as filmed, or a part of it.
    """

    image: DisplayImage
    captured_at: float
    frame_index: int
    unlit: bool = False


class Publisher:
    """Writes to the sink at a steady rate: the newest picture, else the last again, else the placeholder.

    No picture as filmed passes unless that is allowed: whatever made it, and however long it is held.

    It waits for the pipeline no longer than `LATE_FRAME_GRACE`. After a failed write the sink is left alone for
    `RETRY_S`. The caller owns the sink and closes it after `stop`.

    Attributes:
        pictures: the slot to put finished pictures in.
        shown: the picture last handed to the sink, even if the sink refused it, for previews; repeated pictures are
            not put again.
        placeholder: uint8 sRGB RGB (height, width, 3), of the sink's size; see `show_placeholder`.
        superseded_index: pictures of frames up to this index are not shown once the placeholder is.
        hidden_index: pictures of frames up to this index are not shown any more.
        hold: while true, the last picture is repeated however old it is.
    """

    def __init__(
        self,
        sink: Sink,
        fps: float,
        placeholder: DisplayImage,
        *,
        stale_after_s: float | None = None,
        on_sink_error: Callable[[Exception | None], None] | None = None,
        unlit_allowed: Callable[[], bool] = lambda: False,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        """Set up; `start` begins.

        Args:
            sink: where pictures go.
            fps: pictures a second.
            placeholder: shown until the first picture comes.
            stale_after_s: show the placeholder again when no picture came for this long; None repeats the last picture
                forever.
            on_sink_error: called in the publisher's thread with the error when the sink begins to fail or fails for
                another reason, and with None when it works again.
            unlit_allowed: asked at each tick whether pictures as filmed may be shown; the placeholder is else.
            clock: to measure and wait by.
        """
        self.pictures: NewestSlot[PublishedPicture] = NewestSlot(clock)
        self.shown: NewestSlot[DisplayImage] = NewestSlot(clock)
        self.placeholder = placeholder
        self.superseded_index = self.hidden_index = -1
        self.hold = False
        self._sink = sink
        self._fps = fps
        self._clock = clock
        self._stale_after_s = stale_after_s
        self._unlit_allowed = unlit_allowed
        self._on_sink_error = on_sink_error or (lambda error: None)
        self._newest = self.pictures.reader()
        self._last: PublishedPicture | None = None
        self._failing = ""
        """Why the last write failed; empty where it did not."""
        self._retry_at = self._held_at = 0.0
        self._ticked_at = clock.now()
        self._published = self._repeated = self._overtaken = 0
        self._rate, self._new_rate = RateMeter(clock=clock), RateMeter(clock=clock)
        self._latency = DurationWindow()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self.run, name="publisher", daemon=True)

    def start(self) -> None:
        """Begin to publish, in a thread of its own."""
        self._thread.start()

    def run(self) -> None:
        """Publish in the calling thread until `stop`."""
        clock, pacer = self._clock, Pacer(self._fps, self._clock.now())
        picture = None
        while not clock.wait(self._stopping, max(0.0, pacer.deadline - clock.now())):
            picture = self._take(pacer.period, picture is not None)
            now = clock.now()
            self._tick(picture, now)
            pacer.advance(clock.now(), None if picture is None else now - self._newest.put_at)

    def show_placeholder(self, placeholder: DisplayImage, last_index: int, at_once: bool = False) -> None:
        """Replace the placeholder; frame `last_index` was the last one for now. May be called from any thread.

        Pictures of frames up to that one may still come: they are shown only until the placeholder is, which is when
        they are too old, or `at_once`.
        """
        self.superseded_index = last_index  # set first, so that no late picture follows the placeholder
        self.placeholder = placeholder
        if at_once:
            self.hidden_index = last_index

    def stop(self) -> bool:
        """End publishing. Returns whether the thread ended within `STOP_TIMEOUT_S`: it does unless the sink hangs."""
        self._stopping.set()
        if self._thread.ident is not None:
            self._thread.join(STOP_TIMEOUT_S)
        self.shown.close()
        return not self._thread.is_alive()

    def ended(self, timeout_s: float = 0.0) -> bool:
        """Whether the thread has ended, waiting up to `timeout_s` for it. If not after `stop`, the sink hangs."""
        if self._thread.ident is not None:
            self._thread.join(timeout_s)
        return not self._thread.is_alive()

    @property
    def counts(self) -> FrameCounts:
        """Pictures written, pictures dropped for newer ones, repetitions among those written, and pictures put in."""
        dropped = self._newest.dropped + self._overtaken
        return FrameCounts(self._published, dropped, self._repeated, self.pictures.count)

    @property
    def fps(self) -> float:
        """Pictures written a second."""
        return self._rate.rate()

    @property
    def new_fps(self) -> float:
        """New pictures a second, without repetitions, whether the sink takes them or not."""
        return self._new_rate.rate()

    @property
    def unlit(self) -> bool:
        """Whether the picture that is shown is as filmed, or a part of it."""
        last = self._last
        return last is not None and last.unlit

    @property
    def latency_ms(self) -> Percentiles:
        """From a frame's arrival to the end of writing its picture."""
        return self._latency.percentiles()

    def _take(self, period: float, in_step: bool) -> PublishedPicture | None:
        """The newest picture not shown yet, waiting a little for one that is late; None if there is none.

        Args:
            period: of the ticks, in seconds.
            in_step: whether the previous tick had a new picture. If not, none is expected now, and none waited for.
        """
        picture = self._newest.get(0.0)
        # When a picture has waited for almost a whole period, its successor is about to come.
        due = picture is None or self._clock.now() - self._newest.put_at > (1 - LATE_FRAME_GRACE) * period
        newer = self._newest.get(LATE_FRAME_GRACE * period) if in_step and due else None
        if picture is not None and newer is not None:
            self._overtaken += 1
        return newer or picture

    def _tick(self, picture: PublishedPicture | None, now: float) -> None:
        if picture is not None and self._last is None and picture.frame_index <= self.superseded_index:
            self._overtaken += 1
            picture = None
        if picture is not None and picture.unlit and not self._unlit_allowed():
            self._overtaken += 1
            picture = None
        if picture is not None:
            self._last = picture
            self._new_rate.tick(now)
        image = self._image(now)
        self._show(image)
        written = self._write(image, now)
        done = self._ticked_at = self._clock.now()
        if not written:
            return
        self._published += 1
        self._rate.tick(done)
        if picture is None:
            self._repeated += 1
        else:
            self._latency.add(done - picture.captured_at)

    def _image(self, now: float) -> DisplayImage:
        last = self._last
        if last is not None and (last.frame_index <= self.hidden_index or (last.unlit and not self._unlit_allowed())):
            last = self._last = None  # not even one that is held
        if self.hold or now - self._ticked_at > 1 / self._fps + LATE_TICK_S:
            self._held_at = now
        fresh_at = max(self._newest.put_at, self._held_at)
        if self._stale_after_s is not None and now - fresh_at > self._stale_after_s:
            last = self._last = None  # holding later must not bring back a picture that the placeholder has replaced
        return self.placeholder if last is None else last.image

    def _show(self, image: DisplayImage) -> None:
        found = self.shown.newer(0, 0)
        if found is None or found[1] is not image:
            self.shown.put(image)

    def _write(self, image: DisplayImage, now: float) -> bool:
        """Write the picture, unless the last failure is too recent. Returns whether it was written."""
        if self._failing and now < self._retry_at:
            return False
        try:
            self._sink.write(image)
        except Exception as error:  # whatever a sink raises, publishing goes on
            self._retry_at = self._clock.now() + RETRY_S
            if self._failing != repr(error):
                self._failing = repr(error)
                log.warning("publishing fails, trying again every %.0f s: %s", RETRY_S, error)
                self._on_sink_error(error)
            return False
        if self._failing:
            self._failing = ""
            log.info("publishing works again")
            self._on_sink_error(None)
        return True
