"""Preview pictures: each is scaled and encoded once, however many look on.

All viewers who ask for the same size, mirroring and rate share one channel. Whoever comes first for the next picture
waits for it and encodes it; the others find it done. A slow viewer skips pictures and delays nobody.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import cv2
import numpy as np

from relit_camera.api.problems import NotReadyError
from relit_camera.space.images import DisplayImage
from relit_camera.space.picture_files import encode_display
from relit_camera.stream.control import CameraControl

MAX_VIEWERS = 8
"""A viewer waits on one of the event loop's 40 threads: more would leave too few for the other operations."""
JPEG_QUALITY = 82


@dataclass(frozen=True)
class Variant:
    """How a viewer wants the pictures.

    Attributes:
        width: in pixels; never scaled up. None is as published.
        mirror: left and right exchanged, as in a mirror.
        fps: at most so many pictures a second.
    """

    width: int | None = None
    mirror: bool = False
    fps: float = 30.0


@dataclass(frozen=True)
class Encoded:
    """One JPEG file and the published picture's count."""

    count: int
    jpeg: bytes


class Channel:
    """The pictures of one variant."""

    def __init__(self, camera: CameraControl, variant: Variant) -> None:
        self._camera = camera
        self._variant = variant
        self._turn = threading.Lock()
        self._newest = Encoded(-1, b"")
        self._due = 0.0

    def next(self, after: int, timeout_s: float) -> Encoded | None:
        """The newest picture whose count is above `after`, waiting up to `timeout_s` for one; None when time is up.

        Blocks: call it off the event loop.
        """
        deadline = time.monotonic() + timeout_s
        if not self._turn.acquire(timeout=timeout_s):
            return None
        try:
            if self._newest.count > after:
                return self._newest
            pause = min(self._due, deadline) - time.monotonic()
            if pause > 0:
                time.sleep(pause)
            now = time.monotonic()
            if now >= deadline:
                return None
            published = self._camera.picture(after, deadline - now)
            if published is None:
                return None
            # From the last due time, not from now: else waking late would slow the rate, each time a little.
            self._due = max(self._due + 1 / self._variant.fps, time.monotonic())
            self._newest = Encoded(published[0], encode(published[1], self._variant))
            return self._newest
        finally:
            self._turn.release()


class PreviewFeed:
    """The channels that somebody looks at."""

    def __init__(self, camera: CameraControl) -> None:
        self._camera = camera
        self._lock = threading.Lock()
        self._channels: dict[Variant, tuple[Channel, int]] = {}

    @property
    def viewers(self) -> int:
        """How many look on now."""
        with self._lock:
            return sum(count for _, count in self._channels.values())

    def check_room(self) -> None:
        """Check that one more may look on.

        Raises:
            NotReadyError: `MAX_VIEWERS` look on already.
        """
        if self.viewers >= MAX_VIEWERS:
            raise NotReadyError(f"{MAX_VIEWERS} previews are open already", "close one of them")

    @contextmanager
    def watch(self, variant: Variant) -> Iterator[Channel]:
        """The channel of a variant; it lasts as long as somebody watches."""
        with self._lock:
            channel, count = self._channels.get(variant) or (Channel(self._camera, variant), 0)
            self._channels[variant] = channel, count + 1
        try:
            yield channel
        finally:
            with self._lock:
                channel, count = self._channels.pop(variant)
                if count > 1:
                    self._channels[variant] = channel, count - 1


def encode(picture: DisplayImage, variant: Variant) -> bytes:
    """The JPEG file of a published picture, uint8 sRGB RGB (height, width, 3), as a viewer wants it."""
    if variant.width is not None and variant.width < picture.shape[1]:
        picture = _scaled_down(picture, variant.width)
    if variant.mirror:
        picture = np.asarray(cv2.flip(picture, 1), dtype=np.uint8)
    return encode_display(picture, ".jpg", JPEG_QUALITY)


def _scaled_down(picture: DisplayImage, width: int) -> DisplayImage:
    """Halved as often as it goes, then bilinear: no jagged edges, at a tenth of INTER_AREA's time for odd ratios."""
    height = max(1, round(picture.shape[0] * width / picture.shape[1]))
    while picture.shape[1] >= 2 * width:
        half = picture.shape[1] // 2, max(1, picture.shape[0] // 2)
        picture = np.asarray(cv2.resize(picture, half, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
