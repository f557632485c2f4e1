"""Bright frames as pictures of the flash alone: in common units, in the reference's place, the room taken off.

The room as it is without the flash is seen in the dark frames before and after, which are moved to where the head is in
the reference, too, and interpolated to the bright frame's time. Camera gains are divided out first; then light can be
subtracted (thesis 4.3.5, whose faces came out blue for want of them).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import Gamma
from relit_camera.base.images.image_types import LinearImage
from relit_camera.base.video.video_readers import LinearVideoReader
from relit_camera.capture.alignment.rigid_transform import RigidTransform
from relit_camera.capture.film.lamp.head_crop import HeadCrop

Indices = NDArray[np.intp]

_NEAREST = 4
"""Dark frames, on either side of a bright one, that tell the room's light about it."""


@dataclass(frozen=True, eq=False)
class OlatPictures:
    """Pictures of the flash alone.

    Attributes:
        index: (count,) of the frames, growing.
        pictures: (count, size, size, 3) float16 linear RGB; a little noise below 0 is left in them.
        room: (size, size, 3) float32, the room's light, mean over the frames.
    """

    index: Indices
    pictures: NDArray[np.float16]
    room: LinearImage


def read_olat_pictures(
    path: Path,
    gamma: Gamma,
    square: HeadCrop,
    transforms: Mapping[int, RigidTransform],
    gains: Mapping[int, NDArray[np.float64]],
    bright: Indices,
    dark: Indices,
    *,
    subtract: bool = True,
    threads: int = 1,
    progress: Callable[[int], None] = lambda frames: None,
) -> OlatPictures:
    """Read bright frames of a video as pictures of the flash alone, at a time what lies between two flashes.

    Args:
        path: the video.
        gamma: its curve.
        square: what to cut.
        transforms: of these frames, to the reference.
        gains: (3,) of these frames, linear RGB.
        bright: growing indices of those to make pictures of.
        dark: of those that show the room alone.
        subtract: whether the room's light is taken off.
        threads: of the decoder.
        progress: called with the number of frames read.

    Raises:
        VideoError: the video cannot be read.
    """
    pictures = np.empty((len(bright), square.size, square.size, 3), np.float16)
    room_sum, place = np.zeros((square.size, square.size, 3)), {int(each): n for n, each in enumerate(bright)}
    between = _Between(pictures, room_sum, subtract)
    with LinearVideoReader(
        path, gamma, only=frozenset(bright.tolist()) | frozenset(dark.tolist()), threads=threads
    ) as film:
        for frame in film:
            gain: NDArray[np.float32] = gains[frame.index].astype(np.float32)
            cut = np.asarray(square.cut(frame.image, transforms[frame.index]) / gain, np.float32)
            if frame.index in place:
                between.add_bright(place[frame.index], frame.time_s, cut)
            else:
                between.add_dark(frame.time_s, cut)
            progress(frame.index + 1)
    between.finish()
    return OlatPictures(bright, pictures, (room_sum / max(len(bright), 1)).astype(np.float32))


@dataclass(frozen=True, eq=False)
class _Room:
    """The room without the flash: the mean over dark frames that follow one another, and their mean time."""

    time_s: float
    picture: LinearImage


class _Between:
    """Bright frames that wait for the dark ones after them."""

    def __init__(self, pictures: NDArray[np.float16], room_sum: NDArray[np.float64], subtract: bool) -> None:
        self._pictures, self._room_sum, self._subtract = pictures, room_sum, subtract
        self._before: _Room | None = None
        self._dark: deque[_Room] = deque(maxlen=_NEAREST)
        self._waiting: list[tuple[int, float, LinearImage]] = []

    def add_dark(self, time_s: float, picture: LinearImage) -> None:
        self._dark.append(_Room(time_s, picture))
        if len(self._dark) == _NEAREST:
            self._settle()

    def add_bright(self, place: int, time_s: float, picture: LinearImage) -> None:
        if self._dark:
            self._settle()
            self._before = self._room()
            self._dark.clear()
        self._waiting.append((place, time_s, picture))

    def finish(self) -> None:
        """Settle what still waits."""
        self._settle()

    def _settle(self) -> None:
        """The dark frames just seen end the wait of the bright ones before them."""
        if not self._waiting:
            return
        after = self._room()
        for place, time_s, picture in self._waiting:
            room = _at(time_s, self._before, after)
            if room is not None:
                self._room_sum += room
            self._pictures[place] = picture - room if self._subtract and room is not None else picture
        self._waiting = []

    def _room(self) -> _Room | None:
        """What the dark frames at hand show."""
        if not self._dark:
            return None
        time_s = float(np.mean([each.time_s for each in self._dark]))
        return _Room(time_s, np.mean([each.picture for each in self._dark], axis=0))


def _at(time_s: float, before: _Room | None, after: _Room | None) -> LinearImage | None:
    """The room's light at a time, between two others or as at the only one known."""
    if before is None or after is None:
        known = before or after
        return None if known is None else known.picture
    share = np.float32(np.clip((time_s - before.time_s) / (after.time_s - before.time_s), 0, 1))
    return before.picture + share * (after.picture - before.picture)
