"""Whether the ball stays where it is, and is seen, through a video."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import linear_from_uint8, luminance, uint8_from_linear
from relit_camera.base.images.image_types import LinearImage
from relit_camera.capture.film.ball.scene_sample import SceneSample
from relit_camera.capture.film.ball.sphere_projection import BallOutline

_ROUNDS = 12
_SIDE_PX = 96
"""The ball's picture is looked at with so many pixels a side: that shows a shift of a hundredth of the radius."""
SEARCH_RADII = 2.0
"""Radii about the place where a ball was found, farther than which none of it is followed."""
_AROUND = 1.5
"""Half the side of the window that is searched, in radii."""
_DISC = 1.04
"""Radius of what is compared: the ball with its limb, and hardly anything behind it."""
_LAMP_CODES = 25
"""What is so much brighter than usual is the lamp's mirror image, which would draw the ball along ..."""
_LAMP_SHARE = 0.15
"""... if it is no more than this share of the ball."""
_MOVED_RADII = 0.02
"""A shift that is 2 degrees of light."""
_LIKE = 0.6
"""Likeness below which the ball is not seen, as a share of what is usual in the video."""
_SURE = 0.9
"""Likeness below which the ball is looked for farther off."""
_LASTING = 2
"""Frames: a shift in fewer is noise, or compression."""

Plane = NDArray[np.float32]


@dataclass(frozen=True)
class BallObservation:
    """The ball in one frame.

    Attributes:
        index: of the frame.
        dx, dy: how far it is from where it was found, in pixels.
        correlation: correlation, at most 1, with what it looks like otherwise.
    """

    index: int
    dx: float
    dy: float
    correlation: float


@dataclass(frozen=True)
class BallEpisode:
    """Frames, the first and the last included, in which the ball is hidden or elsewhere.

    Attributes:
        kind: which.
        first, last: indices.
        dx, dy: median shift in pixels from where it mostly is; 0 where it is hidden.
    """

    kind: Literal["hidden", "moved"]
    first: int
    last: int
    dx: float
    dy: float


class BallTracker:
    """Looks for a ball near the place where it was found."""

    def __init__(self, sample: SceneSample, outline: BallOutline) -> None:
        """Learn how it usually looks.

        Args:
            sample: the frames in which it was found.
            outline: in pixels of the frames.
        """
        self._outline, self._size = outline, sample.size
        self._scale = _SIDE_PX / (2 * _AROUND * outline.radius)
        # The median knows no highlight: it is elsewhere in each frame.
        usual = linear_from_uint8(np.median(sample.codes, axis=0).astype(np.uint8))
        self._usual = self._window(usual, sample.scale)
        middle = _SIDE_PX / 2
        rows, columns = np.mgrid[:_SIDE_PX, :_SIDE_PX]
        distance = np.hypot(columns + 0.5 - middle, rows + 0.5 - middle)
        self._disc = distance < _DISC * outline.radius * self._scale
        reach = int(np.ceil(_DISC * outline.radius * self._scale))
        self._box = slice(int(middle) - reach, int(middle) + reach)

    def see(self, index: int, frame: LinearImage) -> BallObservation:
        """Look at a frame, linear RGB (height, width, 3)."""
        window = self._window(luminance(frame), 1.0)
        correlation, shift = self._aligned(window, (0.0, 0.0))
        if correlation < _SURE:
            correlation, shift = max((correlation, shift), self._aligned(window, self._far(window)))
        return BallObservation(index, float(shift[0] / self._scale), float(shift[1] / self._scale), correlation)

    def _window(self, light: Plane, scale: float) -> Plane:
        """The ball and its surroundings (side, side), sRGB codes, of a picture with `scale` pixels a pixel."""
        factor = self._scale / scale
        shrunk = min(1.0, factor)
        # Filtered first, so that a large ball does not alias.
        smooth = cv2.GaussianBlur(light, (0, 0), 0.5 / shrunk) if shrunk < 1 else light
        inverse = np.array(
            [
                [1 / factor, 0, self._outline.x * scale - 0.5 - (_SIDE_PX - 1) / 2 / factor],
                [0, 1 / factor, self._outline.y * scale - 0.5 - (_SIDE_PX - 1) / 2 / factor],
            ]
        )
        codes = uint8_from_linear(_warped(smooth, inverse)).astype(np.float32)
        return np.asarray(cv2.GaussianBlur(codes, (0, 0), 1.0), np.float32)

    def _far(self, window: Plane) -> tuple[float, float]:
        """Where in the window the ball fits best, to a pixel."""
        template, mask = self._usual[self._box, self._box], self._disc[self._box, self._box].astype(np.float32)
        fits = cv2.matchTemplate(window, template, cv2.TM_CCOEFF_NORMED, mask=mask)
        _, _, _, place = cv2.minMaxLoc(np.where(np.isfinite(fits), fits, -1))
        return float(place[0] - self._box.start), float(place[1] - self._box.start)

    def _aligned(self, window: Plane, start: tuple[float, float]) -> tuple[float, tuple[float, float]]:
        """Likeness and shift in window pixels: least squares in shift, gain and offset (Lucas and Kanade 1981)."""
        shift = np.array(start, np.float64)
        disc, flat = self._disc, np.ones(int(self._disc.sum()))
        down, across = (np.asarray(slope)[disc] for slope in np.gradient(self._usual))
        usual = self._usual[disc]
        correlation = 0.0
        for _ in range(_ROUNDS):
            back = np.array([[1, 0, shift[0]], [0, 1, shift[1]]])
            flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
            seen = cv2.warpAffine(window, back, (_SIDE_PX, _SIDE_PX), flags=flags, borderMode=cv2.BORDER_REPLICATE)[
                disc
            ]
            lamp = seen > usual + _LAMP_CODES
            used = ~lamp if lamp.mean() < _LAMP_SHARE else np.ones_like(lamp)
            terms = np.stack([across, down, usual, flat], axis=1)[used]
            (x, y, gain, _), *_ = np.linalg.lstsq(terms, seen[used], rcond=None)
            correlation = _correlation(usual[used], seen[used])
            step = np.array([x, y]) / gain if gain > 0.1 else np.zeros(2)
            shift -= step
            if np.hypot(*step) < 0.01 or np.abs(shift - start).max() > _SIDE_PX / 8:
                break
        return correlation, (float(shift[0]), float(shift[1]))


def _warped(picture: Plane, from_window: NDArray[np.float64]) -> Plane:
    """What a picture shows at the places (2, 3) of the window's pixels."""
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    size = (_SIDE_PX, _SIDE_PX)
    return np.asarray(cv2.warpAffine(picture, from_window, size, flags=flags, borderMode=cv2.BORDER_REPLICATE))


def _correlation(a: Plane, b: Plane) -> float:
    spread = float(np.std(a) * np.std(b))
    return float(np.mean((a - a.mean()) * (b - b.mean()))) / spread if spread > 0 else 0.0


def find_episodes(sightings: Iterable[BallObservation], radius: float) -> list[BallEpisode]:
    """Where a ball of this radius (pixels) was hidden or not where it mostly is, in order.

    Args:
        sightings: in the order of their frames.
        radius: of the ball, pixels.
    """
    seen = list(sightings)
    if not seen:
        return []
    x, y, usual = np.median([(sighting.dx, sighting.dy, sighting.correlation) for sighting in seen], axis=0)
    seen = [replace(sighting, dx=sighting.dx - float(x), dy=sighting.dy - float(y)) for sighting in seen]
    kinds = [_kind(sighting, float(usual), radius) for sighting in seen]
    found, start = [], 0
    for end in range(1, len(seen) + 1):
        if end < len(seen) and kinds[end] == kinds[start]:
            continue
        kind = kinds[start]
        if kind is not None and end - start >= _LASTING:
            dx, dy = (0.0, 0.0) if kind == "hidden" else np.median([(s.dx, s.dy) for s in seen[start:end]], axis=0)
            found.append(BallEpisode(kind, seen[start].index, seen[end - 1].index, float(dx), float(dy)))
        start = end
    return found


def outline_at_frame(found: Iterable[BallEpisode], outline: BallOutline, index: int) -> BallOutline | None:
    """Where the ball is in a frame: elsewhere if it moved, None while it is hidden."""
    for episode in found:
        if episode.first <= index <= episode.last:
            return outline.moved(episode.dx, episode.dy) if episode.kind == "moved" else None
    return outline


def _kind(sighting: BallObservation, usual: float, radius: float) -> Literal["hidden", "moved"] | None:
    if sighting.correlation < _LIKE * usual:
        return "hidden"
    return "moved" if np.hypot(sighting.dx, sighting.dy) > _MOVED_RADII * radius else None
