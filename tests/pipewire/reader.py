"""GStreamer as the reader in a call: what it got, and when."""

from __future__ import annotations

import threading
import time
from collections import deque
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.pipewire.pattern_camera import PLACEHOLDER
from tests.pipewire.session import Session, wait_for
from tests.pipewire.test_pipewire_camera import LABEL, SIZE, worst_of
from tests.vm.guest.pattern_number import read_number


@dataclass(frozen=True)
class Seen:
    """A picture that a reader got.

    Attributes:
        planes: I420.
        width: in pixels.
    """

    planes: bytes
    width: int

    @cached_property
    def image(self) -> NDArray[np.uint8]:
        """In RGB."""
        planes = np.frombuffer(self.planes, np.uint8).reshape(-1, self.width)
        return np.asarray(cv2.cvtColor(planes, cv2.COLOR_YUV2RGB_I420), np.uint8)

    @cached_property
    def number(self) -> int | None:
        """Of the pattern; None of the placeholder."""
        return read_number(self.image)

    @property
    def worst(self) -> int:
        """How far its colours are off."""
        if self.number is None:
            return int(abs(self.image.astype(int) - PLACEHOLDER).max())
        return worst_of(self.image)


class Reader:
    """GStreamer in a call. Its pictures are looked at later, for it waits while nobody takes them.

    Attributes:
        times: when each picture came, in monotonic seconds.
        seen: they themselves, or the newest of them.
    """

    def __init__(self, session: Session, size: tuple[int, int] = SIZE, kept: int | None = None) -> None:
        """Begin to read.

        Args:
            session: in which the camera is.
            size: of its pictures.
            kept: how many of them are, at most; all if not given.
        """
        source = ["pipewiresrc", f"target-object={LABEL}", "!", "video/x-raw,format=I420", "!"]
        self.process = session.spawn("gst-launch-1.0", "-q", *source, "fdsink", "fd=1", "sync=false")
        self._size = size
        self.times: list[float] = []
        self.seen: deque[Seen] = deque(maxlen=kept)
        self._thread = threading.Thread(target=self._read)
        self._thread.start()

    def close(self) -> None:
        """End it."""
        self.process.kill()
        self._thread.join()
        self.process.communicate()

    @property
    def goes_on(self) -> bool:
        """Whether the call has not ended."""
        return self.process.poll() is None

    def wait_for_pictures(self, count: int = 20) -> None:
        """Wait until so many more have come."""
        wanted = len(self.times) + count
        wait_for(lambda: len(self.times) >= wanted, f"{count} pictures")

    def wait_for_another(self, than: int | None) -> None:
        """Wait until a picture with another number comes: from a camera."""
        wait_for(lambda: self.seen[-1].number not in (than, None), "a camera")

    def _read(self) -> None:
        assert self.process.stdout is not None
        width, height = self._size
        count = width * height * 3 // 2
        while len(planes := self.process.stdout.read(count)) == count:
            self.times.append(time.monotonic())
            self.seen.append(Seen(planes, width))
