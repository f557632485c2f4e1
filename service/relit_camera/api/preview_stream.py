"""Motion JPEG for viewers: each picture is scaled and encoded once for all viewers of one size, mirroring and rate.

Those viewers share one stream: one task takes the published pictures, encodes them in a thread, and wakes the viewers
that wait. A viewer has no thread of its own; it is sent the newest picture when it has received the previous one, so a
slow viewer skips pictures and delays nobody. Everything here runs in the server's event loop.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

import cv2
import numpy as np
from anyio import CapacityLimiter, to_thread

from relit_camera.base.errors import NotReadyError
from relit_camera.base.images.image_files import encode_display
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.live.camera_control import CameraControl

log = logging.getLogger(__name__)

MAX_VARIANTS = 8
"""Streams of different size, mirroring or rate at a time: each is encoded in a thread of its own."""
MAX_VIEWERS = 256
"""Viewers at a time: each is an open connection, and a process may usually have 1024 files open."""
MAX_FRAMES_SENT_PER_S = 1000
"""Pictures a second to all viewers together: with more viewers each gets fewer, so that the camera keeps its cores."""
ENCODING_SHARE = 0.05
"""Of a core, for encoding for all viewers together: where that takes longer, they get fewer pictures."""
COST_SMOOTHING = 0.9
"""Share of the earlier ones in the mean of what an encoding costs."""
LEAST_INTERVAL = 0.6
"""Of the time between pictures: after one that was late, the next is made no sooner than so much of it."""
FRAME_WAIT_S = 0.25
"""Wait for a picture this long before checking whether to end."""
PREVIEW_JPEG_QUALITY = 82


@dataclass(frozen=True)
class PreviewVariant:
    """How a viewer wants the pictures.

    Attributes:
        width: in pixels; never scaled up. None is as published.
        mirror: left and right exchanged, as in a mirror.
        fps: at most so many pictures a second.
        before: the frames as filmed, in place of the published pictures.
    """

    width: int | None = None
    mirror: bool = False
    fps: float = 30.0
    before: bool = False


@dataclass(frozen=True)
class EncodedFrame:
    """One JPEG file and the published picture's count."""

    count: int
    jpeg: bytes


class PreviewStream:
    """The encoded pictures of one variant, while `run` makes them.

    Attributes:
        viewers: number of viewers.
        encoding_s: processor time of making one picture, a mean of the last ones; 0 before the first.
        ended: whether `run` has ended: no more pictures come.
    """

    def __init__(
        self,
        camera: CameraControl,
        variant: PreviewVariant,
        fps: Callable[[], float] | None = None,
        now: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], Awaitable[None]] = asyncio.sleep,
    ) -> None:
        """Set up.

        Args:
            camera: whose pictures they are.
            variant: how they are wanted.
            fps: gives the pictures a second that may be made now; the variant's if not given.
            now: gives the time, in seconds.
            sleep: waits for some seconds of it.
        """
        self.viewers = 0
        self.encoding_s = 0.0
        self.ended = False
        self._camera = camera
        self._variant = variant
        self._fps = fps or (lambda: variant.fps)
        self._now, self._sleep = now, sleep
        self._newest = EncodedFrame(-1, b"")
        self._frame_arrived = asyncio.Event()

    async def next(self, after: int, timeout_s: float) -> EncodedFrame | None:
        """The newest picture whose count is above `after`, waiting up to `timeout_s` for one; None when time is up."""
        if self._newest.count <= after and not self.ended:
            with suppress(TimeoutError):
                async with asyncio.timeout(timeout_s):
                    await self._frame_arrived.wait()
        return self._newest if self._newest.count > after else None

    async def run(self, limiter: CapacityLimiter) -> None:
        """Make pictures until cancelled, each in a thread that `limiter` lends."""
        due = 0.0
        try:
            while True:
                await self._sleep(max(0.0, due - self._now()))
                made = await to_thread.run_sync(self._make, limiter=limiter, abandon_on_cancel=True)
                if made is None:
                    continue
                interval_s = 1 / self._fps()
                # Counted from the last due time, not from now: otherwise every late wake-up would lower the rate.
                due = max(due + interval_s, self._now() + LEAST_INTERVAL * interval_s)
                self._newest = made
                self._wake()
        except Exception:
            log.exception("a preview has ended")
        finally:
            self.ended = True
            self._wake()

    def _make(self) -> EncodedFrame | None:
        picture = self._camera.filmed_picture if self._variant.before else self._camera.picture
        published = picture(self._newest.count, FRAME_WAIT_S)
        if published is None:
            return None
        began_s = time.thread_time()
        made = EncodedFrame(published[0], encode_preview(published[1], self._variant))
        took_s = time.thread_time() - began_s
        earlier_s = self.encoding_s or took_s
        self.encoding_s = COST_SMOOTHING * earlier_s + (1 - COST_SMOOTHING) * took_s
        return made

    def _wake(self) -> None:
        self._frame_arrived.set()
        self._frame_arrived = asyncio.Event()


class PreviewBroadcaster:
    """The streams that have viewers; a stream starts with its first viewer and ends with its last."""

    def __init__(self, camera: CameraControl) -> None:
        self._camera = camera
        self._streams: dict[PreviewVariant, tuple[PreviewStream, asyncio.Task[None]]] = {}
        self._limiter: CapacityLimiter | None = None

    @property
    def viewers(self) -> int:
        """Number of viewers of all streams now."""
        return sum(stream.viewers for stream, _ in list(self._streams.values()))

    def check_capacity(self, variant: PreviewVariant) -> None:
        """Check that one more viewer is allowed.

        Raises:
            NotReadyError: there are `MAX_VIEWERS` viewers already, or `MAX_VARIANTS` streams of other variants.
        """
        if self.viewers >= MAX_VIEWERS:
            raise NotReadyError(f"{MAX_VIEWERS} previews are open already", "close one of them")
        if variant not in self._streams and len(self._streams) >= MAX_VARIANTS:
            raise NotReadyError(
                f"previews of {MAX_VARIANTS} sizes and rates are open already", "ask for one of those, or close one"
            )

    @contextmanager
    def subscribe(self, variant: PreviewVariant) -> Iterator[PreviewStream]:
        """Within the block: be a viewer of the variant's stream. Only in the event loop.

        Raises:
            NotReadyError: as `check_capacity`.
        """
        self.check_capacity(variant)
        if self._limiter is None:  # threads apart from those of the other operations
            self._limiter = CapacityLimiter(MAX_VARIANTS)
        if variant not in self._streams:
            created = PreviewStream(self._camera, variant, lambda: self._fps(variant, created))
            self._streams[variant] = created, asyncio.get_running_loop().create_task(created.run(self._limiter))
        stream, task = self._streams[variant]
        stream.viewers += 1
        try:
            yield stream
        finally:
            stream.viewers -= 1
            if stream.viewers == 0:
                del self._streams[variant]
                task.cancel()

    def _fps(self, variant: PreviewVariant, stream: PreviewStream) -> float:
        """Pictures a second of a stream: those wanted, or fewer where sending or encoding would take too much."""
        sent = MAX_FRAMES_SENT_PER_S / max(1, self.viewers)
        share = ENCODING_SHARE / max(1, len(self._streams))
        return min(variant.fps, sent, share / max(stream.encoding_s, 1e-6))


def encode_preview(picture: DisplayImage, variant: PreviewVariant) -> bytes:
    """The JPEG file of a published picture, uint8 sRGB RGB (height, width, 3), in the viewer's variant."""
    if variant.width is not None and variant.width < picture.shape[1]:
        picture = _downscale(picture, variant.width)
    if variant.mirror:
        picture = np.asarray(cv2.flip(picture, 1), dtype=np.uint8)
    return encode_display(picture, ".jpg", PREVIEW_JPEG_QUALITY)


def _downscale(picture: DisplayImage, width: int) -> DisplayImage:
    """Scale down by halving as often as possible, then bilinearly: smooth, in a tenth of INTER_AREA's time."""
    height = max(1, round(picture.shape[0] * width / picture.shape[1]))
    while picture.shape[1] >= 2 * width:
        half = picture.shape[1] // 2, max(1, picture.shape[0] // 2)
        picture = np.asarray(cv2.resize(picture, half, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
