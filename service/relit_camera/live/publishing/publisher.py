"""Gives the sink a picture at every tick of its own clock, whatever the pipeline does."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.newest_slot import NewestSlot
from relit_camera.devices.sinks.sink import Sink
from relit_camera.live.status.camera_status import FrameCounts, Percentiles
from relit_camera.live.status.stage_timing import DurationWindow, Pacer, RateMeter

log = logging.getLogger(__name__)

RETRY_S = 1.0
"""Pause after a failed write."""

STOP_TIMEOUT_S = 1.0

LATE_FRAME_GRACE = 0.4
"""Share of a period for which a tick waits for a late picture: so it is late by that much, not by a whole period."""


@dataclass(frozen=True)
class PublishedPicture:
    """A finished picture on its way to the sink.

    Attributes:
        image: uint8 sRGB RGB (height, width, 3), of the sink's size; not written to any more.
        captured_at: monotonic seconds at which the frame it was made from arrived; latency is measured from here.
        frame_index: that frame's index.
    """

    image: DisplayImage
    captured_at: float
    frame_index: int


class Publisher:
    """Writes to the sink at a steady rate: the newest picture, else the last again, else the placeholder.

    It waits for the pipeline no longer than `LATE_FRAME_GRACE`. A sink that fails is tried again every second; it
    belongs to the
    caller, who closes it after `stop`.

    Attributes:
        pictures: the slot to put finished pictures in.
        shown: what went to the sink last, whether it took it or not, for previews: repeated pictures are not put again.
        placeholder: uint8 sRGB RGB (height, width, 3), of the sink's size; see `show_placeholder`.
        superseded_index: pictures of frames up to this one are late: none is shown any more once the placeholder is.
        hold: while this is true the last picture stays, however old it is.
    """

    def __init__(
        self,
        sink: Sink,
        fps: float,
        placeholder: DisplayImage,
        *,
        stale_after_s: float | None = None,
        on_sink_error: Callable[[Exception | None], None] | None = None,
    ) -> None:
        """Set up; `start` begins.

        Args:
            sink: where pictures go.
            fps: pictures a second.
            placeholder: shown until the first picture comes.
            stale_after_s: show the placeholder again when no picture came for this long; None repeats the last for
                ever.
            on_sink_error: called in the publisher's thread with the error when the sink begins to fail, and with None
                when it works again.
        """
        self.pictures: NewestSlot[PublishedPicture] = NewestSlot()
        self.shown: NewestSlot[DisplayImage] = NewestSlot()
        self.placeholder = placeholder
        self.superseded_index = -1
        self.hold = False
        self._sink = sink
        self._fps = fps
        self._stale_after_s = stale_after_s
        self._on_sink_error = on_sink_error or (lambda error: None)
        self._newest = self.pictures.reader()
        self._last: PublishedPicture | None = None
        self._failing = False
        self._retry_at = self._held_at = 0.0
        self._published = self._repeated = self._overtaken = 0
        self._rate = RateMeter()
        self._latency = DurationWindow()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="publisher", daemon=True)

    def start(self) -> None:
        """Begin to publish."""
        self._thread.start()

    def show_placeholder(self, placeholder: DisplayImage, last_index: int) -> None:
        """Replace the placeholder, now that no frames come after that of `last_index`. Any thread may say so.

        Pictures of frames up to that one may still come: they are shown only while this placeholder is not.
        """
        self.superseded_index = last_index  # first, so that no late picture follows the placeholder
        self.placeholder = placeholder

    def stop(self) -> bool:
        """End the thread. Returns whether it ended within a second: it does unless the sink is stuck."""
        self._stopping.set()
        if self._thread.ident is not None:
            self._thread.join(STOP_TIMEOUT_S)
        self.shown.close()
        return not self._thread.is_alive()

    def ended(self, timeout_s: float = 0.0) -> bool:
        """Whether the thread has ended, waiting up to `timeout_s` for it; if not after `stop`, the sink is stuck."""
        if self._thread.ident is not None:
            self._thread.join(timeout_s)
        return not self._thread.is_alive()

    @property
    def counts(self) -> FrameCounts:
        """Pictures written, those of them that were written before, and those passed over for newer ones."""
        return FrameCounts(self._published, self._newest.dropped + self._overtaken, self._repeated)

    @property
    def fps(self) -> float:
        """Pictures written a second."""
        return self._rate.rate()

    @property
    def latency_ms(self) -> Percentiles:
        """From a frame's arrival to the end of writing its picture."""
        return self._latency.percentiles()

    def _run(self) -> None:
        pacer = Pacer(self._fps, time.monotonic())
        picture = None
        while not self._stopping.wait(max(0.0, pacer.deadline - time.monotonic())):
            picture = self._take(pacer.period, picture is not None)
            now = time.monotonic()
            self._tick(picture, now)
            pacer.advance(time.monotonic(), None if picture is None else now - self._newest.put_at)

    def _take(self, period: float, in_step: bool) -> PublishedPicture | None:
        """Get the newest picture, waiting for one that is due by now.

        Args:
            period: of the ticks, in seconds.
            in_step: whether the last tick had a new picture. If not, the next one is not late but missing.
        """
        picture = self._newest.get(0.0)
        # One that has waited for almost a whole period has a successor about to come.
        due = picture is None or time.monotonic() - self._newest.put_at > (1 - LATE_FRAME_GRACE) * period
        newer = self._newest.get(LATE_FRAME_GRACE * period) if in_step and due else None
        if picture is not None and newer is not None:
            self._overtaken += 1
        return newer or picture

    def _tick(self, picture: PublishedPicture | None, now: float) -> None:
        if picture is not None and self._last is None and picture.frame_index <= self.superseded_index:
            self._overtaken += 1
            picture = None
        if picture is not None:
            self._last = picture
        image = self._image(now)
        self._show(image)
        if not self._write(image, now):
            return
        done = time.monotonic()
        self._published += 1
        self._rate.tick(done)
        if picture is None:
            self._repeated += 1
        else:
            self._latency.add(done - picture.captured_at)

    def _image(self, now: float) -> DisplayImage:
        last = self._last
        if self.hold:
            self._held_at = now
        fresh_at = max(self._newest.put_at, self._held_at)
        if self._stale_after_s is not None and now - fresh_at > self._stale_after_s:
            last = self._last = None  # gone for good: holding later must not bring back what nobody saw any more
        return self.placeholder if last is None else last.image

    def _show(self, image: DisplayImage) -> None:
        found = self.shown.newer(0, 0)
        if found is None or found[1] is not image:
            self.shown.put(image)

    def _write(self, image: DisplayImage, now: float) -> bool:
        """Write, unless the last failure is too recent. Whatever a sink raises must not end the picture."""
        if self._failing and now < self._retry_at:
            return False
        try:
            self._sink.write(image)
        except Exception as error:
            self._retry_at = time.monotonic() + RETRY_S
            if not self._failing:
                self._failing = True
                log.warning("publishing fails, trying again every %.0f s: %s", RETRY_S, error)
                self._on_sink_error(error)
            return False
        if self._failing:
            self._failing = False
            log.info("publishing works again")
            self._on_sink_error(None)
        return True
