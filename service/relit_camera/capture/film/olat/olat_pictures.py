"""Bright frames read as OLAT pictures ("one light at a time", Debevec et al. 2000): the light of one flash alone.

The pictures are aligned to the reference frame, cropped, divided by the camera's gains and freed of the room's light.
That light is known from the dark frames before and after a flash, aligned in the same way and interpolated to the
bright frame's time. Without division by the gains, subtraction leaves color casts (thesis 4.3.5).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Indices
from relit_camera.base.errors import InputError
from relit_camera.base.images.color import Gamma
from relit_camera.base.images.image_types import LinearImage
from relit_camera.base.video.video_readers import LinearVideoReader
from relit_camera.capture.alignment.rigid_transform import RigidTransform
from relit_camera.capture.film.olat.head_crop import HeadCrop

_DARK_FRAMES = 4
"""Nearest dark frames on either side of a bright one whose mean shows the room's light."""
_MAX_PICTURES, _MIN_PICTURES = 600, 150
"""Limits of the number of pictures in memory: a minute's flashes, and fewer of larger pictures."""
_MEMORY_BYTES = 944_000_000
"""Memory for pictures."""
_PIXEL_BYTES = 6
"""Three channels in float16."""


def max_pictures_in_memory(size: int) -> int:
    """Number of pictures with so many pixels a side that are kept in memory."""
    return min(_MAX_PICTURES, _MEMORY_BYTES // (_PIXEL_BYTES * size**2))


def require_size_in_memory(size: int) -> None:
    """Check that enough pictures with so many pixels a side fit in memory.

    Raises:
        InputError: they do not.
    """
    if max_pictures_in_memory(size) < _MIN_PICTURES:
        most = math.isqrt(_MEMORY_BYTES // (_PIXEL_BYTES * _MIN_PICTURES))
        raise InputError(f"{size} pixels a side are more than memory holds", f"give a --size of {most} or less")


@dataclass(frozen=True, eq=False)
class OlatPictures:
    """Pictures of the flash alone.

    Attributes:
        index: (count,) of the frames, growing.
        pictures: (count, size, size, 3) float16 linear RGB; noise below 0 is kept.
        room: (size, size, 3) float32 linear RGB, the room's light, mean over the frames.
    """

    index: Indices
    pictures: NDArray[np.float16]
    room: LinearImage


def read_olat_pictures(
    path: Path,
    gamma: Gamma,
    crop: HeadCrop,
    transforms: Mapping[int, RigidTransform],
    gains: Mapping[int, NDArray[np.float64]],
    bright: Indices,
    dark: Indices,
    *,
    subtract: bool = True,
    threads: int = 1,
    progress: Callable[[int], None] = lambda frames: None,
) -> OlatPictures:
    """Read bright frames of a film as pictures of the flash alone, holding few frames in memory at a time.

    Args:
        path: the film.
        gamma: its transfer curve.
        crop: the square to crop.
        transforms: from the frames to the reference, by index.
        gains: (3,) of the frames by index, linear RGB.
        bright: growing indices of the frames to make pictures of.
        dark: growing indices of frames that show the room alone.
        subtract: whether the room's light is subtracted.
        threads: of the decoder.
        progress: called with the number of frames read.

    Raises:
        VideoError: the film cannot be read.
    """
    pictures = np.empty((len(bright), crop.size, crop.size, 3), np.float16)
    room_sum, rows = np.zeros((crop.size, crop.size, 3)), {int(each): row for row, each in enumerate(bright)}
    subtraction = RoomSubtraction(pictures, room_sum, subtract)
    with LinearVideoReader(
        path, gamma, only=frozenset(bright.tolist()) | frozenset(dark.tolist()), threads=threads
    ) as film:
        for frame in film:
            gain: NDArray[np.float32] = gains[frame.index].astype(np.float32)
            picture = np.asarray(crop.crop(frame.image, transforms[frame.index]) / gain, np.float32)
            if frame.index in rows:
                subtraction.add_bright(rows[frame.index], frame.time_s, picture)
            else:
                subtraction.add_dark(frame.time_s, picture)
            progress(frame.index + 1)
    subtraction.finish()
    return OlatPictures(bright, pictures, (room_sum / max(len(bright), 1)).astype(np.float32))


@dataclass(frozen=True, eq=False)
class _Room:
    """The room without the flash: the mean picture and the mean time of successive dark frames."""

    time_s: float
    picture: LinearImage


class RoomSubtraction:
    """Subtracts the room's light from bright frames, which wait for the dark ones after them.

    Args:
        pictures: (count, size, size, 3), written to.
        room_sum: (size, size, 3) sum of the room's light over the bright frames, added to.
        subtract: whether the room's light is subtracted, or only summed.
    """

    def __init__(self, pictures: NDArray[np.float16], room_sum: NDArray[np.float64], subtract: bool) -> None:
        self._pictures, self._room_sum, self._subtract = pictures, room_sum, subtract
        self._before: _Room | None = None
        self._dark: deque[_Room] = deque(maxlen=_DARK_FRAMES)
        self._waiting: list[tuple[int, float, LinearImage]] = []

    @property
    def held(self) -> int:
        """Number of frames in memory: dark ones, and bright ones that wait."""
        return len(self._dark) + len(self._waiting)

    def add_dark(self, time_s: float, picture: LinearImage) -> None:
        """Take the next frame, a dark one."""
        self._dark.append(_Room(time_s, picture))
        if len(self._dark) == _DARK_FRAMES:
            self._settle()

    def add_bright(self, row: int, time_s: float, picture: LinearImage) -> None:
        """Take the next frame, a bright one that belongs in this row of the pictures."""
        if self._dark:
            self._settle()
            self._before = self._room()
            self._dark.clear()
        self._waiting.append((row, time_s, picture))

    def finish(self) -> None:
        """Process the bright frames that still wait."""
        self._settle()

    def _settle(self) -> None:
        """Process the waiting bright frames with the dark ones before and after them."""
        if not self._waiting:
            return
        after = self._room()
        for row, time_s, picture in self._waiting:
            room = _interpolate_room(time_s, self._before, after)
            if room is not None:
                self._room_sum += room
            self._pictures[row] = picture - room if self._subtract and room is not None else picture
        self._waiting = []

    def _room(self) -> _Room | None:
        """Mean of the dark frames since the last bright one; None if there are none."""
        if not self._dark:
            return None
        time_s = float(np.mean([each.time_s for each in self._dark]))
        return _Room(time_s, np.mean([each.picture for each in self._dark], axis=0))


def _interpolate_room(time_s: float, before: _Room | None, after: _Room | None) -> LinearImage | None:
    """The room's light at a time, interpolated between two, or the only one there is; None if there is none."""
    if before is None or after is None:
        known = before or after
        return None if known is None else known.picture
    fraction = np.float32(np.clip((time_s - before.time_s) / (after.time_s - before.time_s), 0, 1))
    return before.picture + fraction * (after.picture - before.picture)
