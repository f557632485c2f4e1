"""The lamp's mirror image in the ball, frame by frame."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.ball.highlight import Highlight, NoHighlight, brightest_place
from relit_camera.capture.ball.outline import Outline
from relit_camera.capture.ball.view import PinholeView, Vectors
from relit_camera.capture.ball.watch import Episode, outline_in
from relit_camera.space.images import LinearImage

_REACH = 1.3
"""Half the side of what is kept about the ball, in radii."""

Plane = NDArray[np.float16]


class BallFilm:
    """The ball's surroundings in some frames of a video: all that is kept of them for finding highlights.

    Memory: 100 KB a frame where the ball's radius is 90 pixels.
    """

    def __init__(self, outline: Outline, size: tuple[int, int]) -> None:
        """Look at a ball with this outline in pictures of this size (width, height)."""
        reach = _REACH * outline.radius
        self._left, self._top = (max(0, int(middle - reach)) for middle in (outline.x, outline.y))
        self._right, self._bottom = (
            min(side, int(middle + reach) + 1) for middle, side in ((outline.x, size[0]), (outline.y, size[1]))
        )
        self._planes: dict[int, Plane] = {}

    def add(self, index: int, frame: LinearImage) -> None:
        """Keep what a frame, linear RGB (height, width, 3), shows there."""
        cut = frame[self._top : self._bottom, self._left : self._right]
        self._planes[index] = cut.mean(axis=2).astype(np.float16)

    def highlights(
        self, bright: Iterable[int], view: PinholeView, episodes: Iterable[Episode] = ()
    ) -> dict[int, Highlight | NoHighlight]:
        """The highlight in each bright frame, beside the nearest dark frame, in pixels of the picture.

        Args:
            bright: indices of frames that were added; the others that were are dark.
            view: of the ball.
            episodes: during which it was hidden or elsewhere.
        """
        bright, episodes = list(bright), list(episodes)
        dark = np.setdiff1d(list(self._planes), bright)
        found = {index: self._highlight(index, dark, view, episodes, 0.0) for index in bright}
        areas = [place.area_px for place in found.values() if isinstance(place, Highlight)]
        typical = float(np.median(areas)) if areas else 0.0
        return {index: self._highlight(index, dark, view, episodes, typical) for index in bright}

    def _highlight(
        self, index: int, dark: NDArray[np.intp], view: PinholeView, episodes: list[Episode], typical_area_px: float
    ) -> Highlight | NoHighlight:
        outline = outline_in(episodes, view.outline, index)
        if outline is None:
            return NoHighlight("something is before the ball")
        here = view if outline == view.outline else PinholeView(outline, view.size, view.focal_px)
        room = None
        if len(dark):
            room = self._planes[int(dark[np.abs(dark - index).argmin()])].astype(np.float32)
        light = self._planes[index].astype(np.float32)
        place = brightest_place(light, _Cut(here, self._left, self._top), room, typical_area_px)
        if isinstance(place, NoHighlight):
            return place
        return Highlight(place.x + self._left, place.y + self._top, place.normal, place.brightness, place.area_px)


class _Cut:
    """A view of the ball in pixels of a part of the picture; see `BallView`."""

    def __init__(self, view: PinholeView, left: int, top: int) -> None:
        self._view, self._left, self._top = view, left, top
        self.outline = view.outline.moved(-left, -top)

    def normals(self, x: NDArray, y: NDArray) -> Vectors:
        return self._view.normals(np.asarray(x) + self._left, np.asarray(y) + self._top)

    def mirrored(self, normals: Vectors) -> Vectors:
        return self._view.mirrored(normals)

    def picture(self, normals: Vectors) -> tuple[NDArray, NDArray]:
        x, y = self._view.picture(normals)
        return x - self._left, y - self._top
