"""The frames as filmed, for whoever compares them with the published pictures."""

from __future__ import annotations

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.concurrency.newest_slot import NewestSlot
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.live.modes.frame_fitting import fit_frame

KEPT_FOR_S = 1.0
"""Frames are kept as long as somebody has asked within this."""


class FilmedFrames:
    """Keeps the camera's newest frame while somebody asks for it; costs nothing otherwise. Thread-safe."""

    def __init__(self, size: tuple[int, int], clock: Clock = SYSTEM_CLOCK) -> None:
        """`size` is (width, height) of the pictures to give."""
        self._size, self._clock = size, clock
        self._frames: NewestSlot[tuple[Frame, ...]] = NewestSlot(clock)
        self._wanted_until = -1.0

    def offer(self, frame: Frame) -> None:
        """Take a frame if one is wanted; called by the camera with each frame."""
        if self._clock.now() < self._wanted_until:
            self._frames.put((frame,))
        elif self._wanted_until >= 0:
            self._wanted_until = -1.0
            self._frames.put(())  # nobody looks any more: the picture need not stay in memory

    def newer(self, than: int, timeout_s: float) -> tuple[int, DisplayImage] | None:
        """The newest frame and its number if that is above `than`, waiting up to `timeout_s` for one.

        It is uint8 sRGB RGB of the size given, scaled to cover it and cut about the middle.
        """
        self._wanted_until = self._clock.now() + timeout_s + KEPT_FOR_S
        found = self._frames.newer(max(than, 0), timeout_s)  # before the first frame its number is 0
        if found is not None and not found[1]:
            found = self._frames.newer(found[0], timeout_s)
        if found is None or not found[1]:
            return None
        return found[0], fit_frame(found[1][0], self._size).image
