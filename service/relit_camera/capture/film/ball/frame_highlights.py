"""The lamp's mirror image in the ball, frame by frame."""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import LinearImage
from relit_camera.capture.film.ball.ball_tracking import SEARCH_RADII, BallEpisode, outline_at_frame
from relit_camera.capture.film.ball.specular_highlight import Highlight, NoHighlight, find_highlight_in_plane
from relit_camera.capture.film.ball.sphere_projection import BallOutline, PinholeView, Vectors

_MOST_PX = 256
"""Pixels a side of what is kept of a frame: more of a large ball do not tell the lamp's direction better."""

Plane = NDArray[np.float16]


class BallCrops:
    """The ball's surroundings in some frames of a video: all that is kept of them for finding highlights.

    Memory: 130 KB a frame at most.
    """

    def __init__(self, outline: BallOutline, size: tuple[int, int]) -> None:
        """Look at a ball with this outline in pictures of this size (width, height)."""
        reach = SEARCH_RADII * outline.radius
        self._left, self._top = (max(0, int(middle - reach)) for middle in (outline.x, outline.y))
        self._right, self._bottom = (
            min(side, int(middle + reach) + 1) for middle, side in ((outline.x, size[0]), (outline.y, size[1]))
        )
        width, height = self._right - self._left, self._bottom - self._top
        scale = min(1.0, _MOST_PX / max(width, height))
        self._size = (round(width * scale), round(height * scale))
        self._step = (width / self._size[0], height / self._size[1])
        self._planes: dict[int, Plane] = {}

    def add(self, index: int, frame: LinearImage) -> None:
        """Keep what a frame, linear RGB (height, width, 3), shows there."""
        cut = frame[self._top : self._bottom, self._left : self._right]
        plane = cv2.resize(cut.mean(axis=2), self._size, interpolation=cv2.INTER_AREA)
        self._planes[index] = plane.astype(np.float16)

    def highlights(
        self, bright: Iterable[int], view: PinholeView, episodes: Iterable[BallEpisode] = ()
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
        self, index: int, dark: NDArray[np.intp], view: PinholeView, episodes: list[BallEpisode], typical_area_px: float
    ) -> Highlight | NoHighlight:
        outline = outline_at_frame(episodes, view.outline, index)
        if outline is None:
            return NoHighlight("something is before the ball")
        here = view if outline == view.outline else PinholeView(outline, view.size, view.focal_px)
        cut = _CropView(here, (self._left, self._top), self._step)
        if here is not view and not _whole(cut.outline, self._size):
            return NoHighlight("the ball is out of its place so far that not all of it is seen")
        room = None
        if len(dark):
            room = self._planes[int(dark[np.abs(dark - index).argmin()])].astype(np.float32)
        light = self._planes[index].astype(np.float32)
        pixel = self._step[0] * self._step[1]
        place = find_highlight_in_plane(light, cut, room, typical_area_px / pixel)
        if isinstance(place, NoHighlight):
            return place
        x, y = cut.whole(place.x, place.y)
        return Highlight(float(x), float(y), place.normal, place.brightness, round(place.area_px * pixel))


def _whole(outline: BallOutline, size: tuple[int, int]) -> bool:
    return all(
        outline.radius <= at <= side - outline.radius for at, side in zip((outline.x, outline.y), size, strict=True)
    )


class _CropView:
    """A view of the ball in pixels of a part of the picture, made smaller; see `BallView`."""

    def __init__(self, view: PinholeView, corner: tuple[int, int], step: tuple[float, float]) -> None:
        """Of the part with that left upper corner, so many pixels of the picture (x, y) becoming one."""
        self._view, self._corner, self._step = view, corner, step
        x, y = self._part(view.outline.x, view.outline.y)
        self.outline = BallOutline(float(x), float(y), view.outline.radius / step[0])

    def whole(self, x: NDArray | float, y: NDArray | float) -> tuple[NDArray, NDArray]:
        """Where in the whole picture a place in the part is."""
        return np.asarray(x) * self._step[0] + self._corner[0], np.asarray(y) * self._step[1] + self._corner[1]

    def _part(self, x: NDArray | float, y: NDArray | float) -> tuple[NDArray, NDArray]:
        return (np.asarray(x) - self._corner[0]) / self._step[0], (np.asarray(y) - self._corner[1]) / self._step[1]

    def normals(self, x: NDArray, y: NDArray) -> Vectors:
        return self._view.normals(*self.whole(x, y))

    def mirrored(self, normals: Vectors) -> Vectors:
        return self._view.mirrored(normals)

    def picture(self, normals: Vectors) -> tuple[NDArray, NDArray]:
        return self._part(*self._view.picture(normals))
