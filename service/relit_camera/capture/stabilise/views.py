"""Squares about the face out of the frames that count, cut where corners say that it went."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.face_circle import Circle
from relit_camera.capture.stabilise.rigid import Rigid
from relit_camera.capture.stabilise.sparse import CornerTracker, Match, local_contrast
from relit_camera.capture.stabilise.window import Window
from relit_camera.errors import CaptureError
from relit_camera.video.luma import LumaReader

Indices = NDArray[np.intp]

_RADIUS_PX = 128.0
"""A larger face is scaled down to this."""
_SEARCHED = 2.0
"""Reach of the square in which corners are followed, in radii: how far a head may go."""
_REACH = 0.95
"""Reach of the squares that are kept."""
_LEAST_CORNERS = 8


@dataclass(frozen=True, eq=False)
class Views:
    """Squares about the face, cut out of some frames.

    Attributes:
        index: (count,) of the frames.
        codes: (count, side, side) float16 luma.
        matches: of each frame, by corners alone, to the first one; the squares are cut accordingly. A bright frame has
            that of the dark one before it.
        window, circle: of the squares and of the face in the first frame, in pictures so many times (`scale`) as large
            as the video's.
    """

    index: Indices
    codes: NDArray[np.float16]
    matches: list[Match]
    window: Window
    circle: Circle
    scale: float

    @property
    def transforms(self) -> list[Rigid]:
        """Those of the matches."""
        return [match.transform for match in self.matches]

    def only(self, chosen: NDArray[np.bool_]) -> Views:
        """Some of them, by a mask (count,)."""
        matches = [match for match, kept in zip(self.matches, chosen, strict=True) if kept]
        return replace(self, index=self.index[chosen], codes=self.codes[chosen], matches=matches)

    def of(self, frames: Indices) -> Views:
        """Those of these frames."""
        return self.only(np.isin(self.index, frames))


def look(
    path: Path, dark: Indices, bright: Indices, circle: Circle, threads: int, progress: Callable[[int], None]
) -> Views:
    """Follow corners through the dark frames of a video, and keep squares of dark and bright ones.

    Args:
        path: the video.
        dark: indices of its dark frames.
        bright: of its bright ones.
        circle: of the face, in the video's pixels.
        threads: of the decoder.
        progress: called with the number of frames looked at.

    Raises:
        VideoError: the video cannot be read.
        CaptureError: nothing in the circle can be followed.
    """
    followed = frozenset(dark.tolist())
    scale = min(1.0, _RADIUS_PX / circle.radius)
    small = circle.scaled(scale)
    tracker: CornerTracker | None = None
    index, codes, matches = [], [], []
    with LumaReader(path, only=followed | frozenset(bright.tolist()), threads=threads) as video:
        size = (round(video.info.width * scale), round(video.info.height * scale))
        searched, window = Window.about(small, _SEARCHED, size), Window.about(small, _REACH, size)
        now: Match | None = None
        for frame in video:
            picture = cv2.resize(frame.image, size, interpolation=cv2.INTER_AREA) if scale < 1 else frame.image
            if frame.index in followed:
                square = local_contrast(searched.cut(picture, Rigid()))
                tracker = tracker or _tracker(square, small.moved(-searched.left, -searched.top))
                found = tracker.follow(square)
                now = found and replace(found, transform=searched.in_picture(found.transform))
            if now is not None:
                index.append(frame.index)
                codes.append(window.cut(picture, now.transform).astype(np.float16))
                matches.append(now)
            progress(frame.index + 1)
    kept = np.stack(codes) if codes else np.zeros((0, window.side, window.side), np.float16)
    return Views(np.array(index, np.intp), kept, matches, window, small, scale)


def _tracker(square: NDArray[np.uint8], circle: Circle) -> CornerTracker:
    tracker = CornerTracker(square, circle)
    if tracker.corners < _LEAST_CORNERS:
        what = f"only {tracker.corners} points of the face can be followed in the dark frames"
        raise CaptureError(what, "make the room a little brighter, so that the face shows without the flash")
    return tracker
