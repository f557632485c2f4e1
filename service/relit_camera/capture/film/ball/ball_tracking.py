"""A mirror ball through a film: where it is hidden or moved, and the lamp's mirror image in every bright frame."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import linear_from_uint8, luminance, uint8_from_linear
from relit_camera.base.images.image_types import LinearImage
from relit_camera.capture.film.ball.ball_detection import DetectedBall
from relit_camera.capture.film.ball.frame_sample import FrameSample, Plane
from relit_camera.capture.film.ball.specular_highlight import BallCrops, Highlight, NoHighlight
from relit_camera.capture.film.ball.sphere_projection import BallOutline, PinholeView


@dataclass(frozen=True)
class TrackingTunables:
    """How a ball is followed; `relit evaluate capture` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        iterations: maximum number of steps of an alignment.
        window_px: side of the square in which the ball is compared; it shows a shift of a hundredth of the radius.
        window_radii: half that side in radii, and so the reach of the search.
        disc_radii: radius of what is compared: the ball with its limb and hardly any background.
        lamp_codes: pixels brighter than in that appearance by more sRGB codes than this belong to the lamp's mirror
            image; they are left out, as they would bias the alignment.
        max_lamp: fraction of the ball from which they are not left out, being no lamp's.
        moved_radii: least shift, in radii, that counts: 2 degrees of light.
        hidden_correlation: relative to the film's median, the correlation below which the ball is hidden.
        sure_correlation: correlation below which the whole window is searched.
        min_frames: least length of an episode; a shift in fewer frames is noise or compression.
    """

    iterations: int = 12
    window_px: int = 96
    window_radii: float = 1.5
    disc_radii: float = 1.04
    lamp_codes: float = 25.0
    max_lamp: float = 0.15
    moved_radii: float = 0.02
    hidden_correlation: float = 0.6
    sure_correlation: float = 0.9
    min_frames: int = 2


_TUNABLES = TrackingTunables()
_SIDE_PX = _TUNABLES.window_px


@dataclass(frozen=True)
class BallObservation:
    """The ball in one frame.

    Attributes:
        index: of the frame.
        dx, dy: shift from where it was found, in pixels.
        correlation: with its typical appearance, at most 1.
    """

    index: int
    dx: float
    dy: float
    correlation: float


@dataclass(frozen=True)
class BallEpisode:
    """Successive dark frames in which the ball is hidden or moved.

    Attributes:
        kind: which of the two.
        first, last: indices of the frames, both included.
        dx, dy: median shift in pixels from its typical position; 0 where it is hidden.
    """

    kind: Literal["hidden", "moved"]
    first: int
    last: int
    dx: float
    dy: float


class BallTracker:
    """Aligns a ball's median appearance to frames of a film."""

    def __init__(self, sample: FrameSample, outline: BallOutline) -> None:
        """Learn the ball's median appearance.

        Args:
            sample: of the frames in which it was found.
            outline: of the ball, in pixels of the frames.
        """
        self._outline = outline
        self._scale = _SIDE_PX / (2 * _TUNABLES.window_radii * outline.radius)
        # The median has no highlight, which is at another place in each frame.
        appearance = linear_from_uint8(np.median(sample.codes, axis=0).astype(np.uint8))
        self._appearance = self._window(appearance, sample.scale)
        middle = _SIDE_PX / 2
        rows, columns = np.mgrid[:_SIDE_PX, :_SIDE_PX]
        distance = np.hypot(columns + 0.5 - middle, rows + 0.5 - middle)
        self._disc = distance < _TUNABLES.disc_radii * outline.radius * self._scale
        reach = int(np.ceil(_TUNABLES.disc_radii * outline.radius * self._scale))
        self._box = slice(int(middle) - reach, int(middle) + reach)

    def observe(self, index: int, frame: LinearImage) -> BallObservation:
        """Shift and correlation of the ball in a frame, linear RGB (height, width, 3)."""
        window = self._window(luminance(frame), 1.0)
        correlation, shift = self._align(window, (0.0, 0.0))
        if correlation < _TUNABLES.sure_correlation:
            correlation, shift = max((correlation, shift), self._align(window, self._best_whole_pixel_shift(window)))
        return BallObservation(index, float(shift[0] / self._scale), float(shift[1] / self._scale), correlation)

    def _window(self, light: Plane, scale: float) -> Plane:
        """The ball and its surroundings (side, side) in sRGB codes, resampled from a picture.

        Args:
            light: linear luminance (height, width).
            scale: size of the picture relative to the frames.
        """
        factor = self._scale / scale
        shrunk = min(1.0, factor)
        # Low-pass filtered first, so that a large ball does not alias.
        smooth = cv2.GaussianBlur(light, (0, 0), 0.5 / shrunk) if shrunk < 1 else light
        from_window = np.array(
            [
                [1 / factor, 0, self._outline.x * scale - 0.5 - (_SIDE_PX - 1) / 2 / factor],
                [0, 1 / factor, self._outline.y * scale - 0.5 - (_SIDE_PX - 1) / 2 / factor],
            ]
        )
        codes = uint8_from_linear(_resample(smooth, from_window)).astype(np.float32)
        return np.asarray(cv2.GaussianBlur(codes, (0, 0), 1.0), np.float32)

    def _best_whole_pixel_shift(self, window: Plane) -> tuple[float, float]:
        """Shift in window pixels, to a pixel, at which the ball fits the window best."""
        template, mask = self._appearance[self._box, self._box], self._disc[self._box, self._box].astype(np.float32)
        fits = cv2.matchTemplate(window, template, cv2.TM_CCOEFF_NORMED, mask=mask)
        _, _, _, place = cv2.minMaxLoc(np.where(np.isfinite(fits), fits, -1))
        return float(place[0] - self._box.start), float(place[1] - self._box.start)

    def _align(self, window: Plane, start: tuple[float, float]) -> tuple[float, tuple[float, float]]:
        """Correlation, and shift in window pixels, by least squares in shift, gain and offset.

        After Lucas and Kanade (1981).
        """
        shift = np.array(start, np.float64)
        disc, flat = self._disc, np.ones(int(self._disc.sum()))
        down, across = (np.asarray(slope)[disc] for slope in np.gradient(self._appearance))
        template = self._appearance[disc]
        correlation = 0.0
        for _ in range(_TUNABLES.iterations):
            shifted = np.array([[1, 0, shift[0]], [0, 1, shift[1]]])
            seen = _resample(window, shifted)[disc]
            lamp = seen > template + _TUNABLES.lamp_codes
            used = ~lamp if lamp.mean() < _TUNABLES.max_lamp else np.ones_like(lamp)
            terms = np.stack([across, down, template, flat], axis=1)[used]
            (x, y, gain, _), *_ = np.linalg.lstsq(terms, seen[used], rcond=None)
            correlation = _correlation(template[used], seen[used])
            step = np.array([x, y]) / gain if gain > 0.1 else np.zeros(2)
            shift -= step
            if np.hypot(*step) < 0.01 or np.abs(shift - start).max() > _SIDE_PX / 8:
                break
        return correlation, (float(shift[0]), float(shift[1]))


def _resample(picture: Plane, from_window: NDArray[np.float64]) -> Plane:
    """The window (side, side) of a picture, by the affine map (2, 3) from window to picture pixels."""
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    size = (_SIDE_PX, _SIDE_PX)
    return np.asarray(cv2.warpAffine(picture, from_window, size, flags=flags, borderMode=cv2.BORDER_REPLICATE))


def _correlation(a: Plane, b: Plane) -> float:
    """Pearson correlation; 0 where either is constant."""
    spread = float(np.std(a) * np.std(b))
    return float(np.mean((a - a.mean()) * (b - b.mean()))) / spread if spread > 0 else 0.0


def find_episodes(observations: Iterable[BallObservation], radius: float) -> list[BallEpisode]:
    """Episodes in which a ball was hidden or away from its typical position, in order.

    Args:
        observations: in the order of their frames.
        radius: of the ball, pixels.
    """
    seen = list(observations)
    if not seen:
        return []
    x, y, median_correlation = np.median(
        [(observation.dx, observation.dy, observation.correlation) for observation in seen], axis=0
    )
    seen = [replace(observation, dx=observation.dx - float(x), dy=observation.dy - float(y)) for observation in seen]
    kinds = [_kind(observation, float(median_correlation), radius) for observation in seen]
    found, start = [], 0
    for end in range(1, len(seen) + 1):
        if end < len(seen) and kinds[end] == kinds[start]:
            continue
        kind = kinds[start]
        if kind is not None and end - start >= _TUNABLES.min_frames:
            dx, dy = (0.0, 0.0) if kind == "hidden" else np.median([(s.dx, s.dy) for s in seen[start:end]], axis=0)
            found.append(BallEpisode(kind, seen[start].index, seen[end - 1].index, float(dx), float(dy)))
        start = end
    return found


def outline_at_frame(episodes: Iterable[BallEpisode], outline: BallOutline, index: int) -> BallOutline | None:
    """Outline of the ball in a frame: shifted if the ball moved, None while it is hidden."""
    for episode in episodes:
        if episode.first <= index <= episode.last:
            return outline.moved(episode.dx, episode.dy) if episode.kind == "moved" else None
    return outline


def _kind(observation: BallObservation, median_correlation: float, radius: float) -> Literal["hidden", "moved"] | None:
    """Which episode a frame belongs to, by the median correlation and the radius in pixels, or None."""
    if observation.correlation < _TUNABLES.hidden_correlation * median_correlation:
        return "hidden"
    return "moved" if np.hypot(observation.dx, observation.dy) > _TUNABLES.moved_radii * radius else None


@dataclass(frozen=True, eq=False)
class ObservedBall:
    """A mirror ball through a film.

    Attributes:
        found: the ball in its typical position.
        view: the camera's view of it there.
        episodes: in which it was hidden or moved.
        highlights: of the bright frames about which the face was found, by index.
    """

    found: DetectedBall
    view: PinholeView
    episodes: list[BallEpisode]
    highlights: Mapping[int, Highlight | NoHighlight]

    def view_at(self, index: int) -> PinholeView:
        """The camera's view of the ball in a frame; that of its typical position while it is hidden."""
        return self.view.with_outline(outline_at_frame(self.episodes, self.view.outline, index) or self.view.outline)

    def highlight(self, index: int) -> Highlight | NoHighlight:
        """The lamp's mirror image in a bright frame, or the reason why there is none."""
        if outline_at_frame(self.episodes, self.view.outline, index) is None:
            return NoHighlight("the ball is hidden")
        return self.highlights[index]


class BallRecorder:
    """Collects what a ball shows, frame by frame."""

    def __init__(self, found: DetectedBall, sample: FrameSample, view: PinholeView) -> None:
        """Prepare for a ball.

        Args:
            found: the ball in this sample.
            sample: of the film's frames.
            view: the camera's view of the ball.
        """
        self._found, self._view = found, view
        self._crops, self._tracker = BallCrops(found.outline, sample.size), BallTracker(sample, found.outline)
        self._observations: list[BallObservation] = []

    def add(self, index: int, frame: LinearImage, *, dark: bool) -> None:
        """Take the next bright or dark frame, linear RGB (height, width, 3)."""
        self._crops.add(index, frame)
        if dark:
            self._observations.append(self._tracker.observe(index, frame))

    def observed(self, bright: Iterable[int]) -> ObservedBall:
        """The ball through the frames that were added, of which these are bright."""
        episodes = find_episodes(self._observations, self._found.outline.radius)

        def view_at(index: int) -> PinholeView | None:
            outline = outline_at_frame(episodes, self._view.outline, index)
            return None if outline is None else self._view.with_outline(outline)

        return ObservedBall(self._found, self._view, episodes, self._crops.highlights(bright, view_at))
