"""The lamp's mirror image on a ball: found in one picture, and in every bright frame of a film."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import CaptureError
from relit_camera.base.images.image_types import LinearImage
from relit_camera.capture.film.ball.sphere_projection import BallOutline, BallView, CroppedView, PinholeView, Vectors

Plane = NDArray[np.float32]


@dataclass(frozen=True)
class HighlightTunables:
    """What counts as the lamp's mirror image; `relit evaluate capture` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        within: radii within which pixels count; those farther out are mixed with what is behind the ball.
        min_brightness: least brightness beyond what the ball shows without the lamp; white is 1.
        min_signal_to_noise: least brightness over the noise.
        max_lit: largest median brightness of the whole ball, relative to the highlight's: a mirror shows a lit room
            but is not lit itself.
        threshold: brightness relative to the highlight's peak from which a pixel belongs to it.
        core: rays of a highlight are cut off if thinner than this fraction of its thickest place.
        max_area: largest fraction of the ball's picture that a lamp's mirror image takes.
        white: brightness without the lamp from which the lamp does not show.
        max_white_rim: fraction of the highlight's rim that may lie on white; with more, its center is fitted as a
            disc's.
        min_area: least area relative to the other frames' median; a smaller one is the image of an image.
        min_visible: least fraction of a partly hidden disc that must be visible.
        max_misfit: largest fraction of the disc's area on which the picture may contradict it.
        search_radii: half the side of the square that is kept of each frame, in radii: a ball that moves farther is
            not read.
        max_crop_px: longer side of that square in pixels; more of a large ball does not make the direction more exact.
    """

    within: float = 0.985
    min_brightness: float = 0.1
    min_signal_to_noise: float = 8.0
    max_lit: float = 0.15
    threshold: float = 0.5
    core: float = 0.5
    max_area: float = 0.08
    white: float = 0.8
    max_white_rim: float = 0.2
    min_area: float = 0.1
    min_visible: float = 0.5
    max_misfit: float = 0.35
    search_radii: float = 2.0
    max_crop_px: int = 256


_TUNABLES = HighlightTunables()
_DISC_MARGIN_PX = 2


@dataclass(frozen=True, eq=False)
class Highlight:
    """The lamp's mirror image on a ball.

    Attributes:
        x, y: center in pixels.
        normal: (3,) unit normal of the ball's surface there, camera axes.
        brightness: beyond what the ball shows without the lamp; white is 1.
        area_px: number of pixels that belong to it.
    """

    x: float
    y: float
    normal: Vectors
    brightness: float
    area_px: int


@dataclass(frozen=True)
class NoHighlight:
    """A frame without a usable highlight.

    Attributes:
        reason: why, for the report.
    """

    reason: str


def find_highlight(
    light: Plane, view: BallView, dark: Plane | None = None, typical_area_px: float = 0.0
) -> Highlight | NoHighlight:
    """Find the lamp's mirror image and its center to a fraction of a pixel.

    Thesis 4.3.4 with a correction: the mean, weighted with the brightness above a threshold, is taken of surface
    normals, not of pixel positions, which would draw highlights at the side inward. Of several bright places the one
    with most light counts, without the thin rays that glare or scratches draw out of it; so the far smaller second
    image of a lamp that another mirror shows does not count. A highlight that lies partly on what is white anyway is
    fitted as a disc of the typical area, if that is known and half of the disc shows.

    Args:
        light: linear brightness (height, width) float32.
        view: the camera's view of the ball, in pixels of this picture.
        dark: the same without the lamp; it is matched in exposure and subtracted.
        typical_area_px: median area of the highlights of other frames, 0 if unknown.

    Returns:
        The highlight, or the reason why there is none.

    Raises:
        CaptureError: the ball is not in the picture.
    """
    size = (light.shape[1], light.shape[0])
    outline = view.outline
    rows, columns = outline.pixels_within(_TUNABLES.within, size)
    if len(rows) == 0:
        place = f"the mirror ball at {outline.x:.0f}, {outline.y:.0f}"
        raise CaptureError(
            f"{place} is not in a picture of {size[0]}x{size[1]}", "give its centre and radius in pixels"
        )
    box = (slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1))
    inside = np.zeros(light[box].shape, bool)
    inside[rows - rows.min(), columns - columns.min()] = True
    light, room = light[box], None if dark is None else dark[box]
    excess = np.where(inside, light if room is None else light - _match_exposure(light, room, inside), np.float32(0))
    level = float(cv2.GaussianBlur(excess, (0, 0), max(0.5, 0.004 * outline.radius)).max())
    spread = float(np.median(np.abs(excess[inside] - np.median(excess[inside]))))
    if level < max(_TUNABLES.min_brightness, _TUNABLES.min_signal_to_noise * spread):
        return NoHighlight(f"nothing in the ball is brighter by more than {level:.2f} of white")
    if dark is not None and np.median(excess[inside]) > _TUNABLES.max_lit * level:
        return NoHighlight("all of the ball is lit by the lamp, as no mirror is")
    weights = np.clip(excess, 0, level) - np.float32(_TUNABLES.threshold * level)
    blob = _largest_sum(weights)
    area = int(blob.sum())
    if area > _TUNABLES.max_area * inside.sum():
        return NoHighlight(f"{area / inside.sum():.0%} of the ball is as bright as the highlight")
    if area < _TUNABLES.min_area * typical_area_px:
        return NoHighlight(f"the brightest place has {area} pixels, in other frames {typical_area_px:.0f}")
    if room is not None and _lies_on_white(blob, room):
        known = inside & (room < 1 - _TUNABLES.threshold * level)
        return _occluded(view, weights > 0, known, (box[1].start, box[0].start), level, typical_area_px)
    y, x = np.nonzero(_without_rays(blob))
    normals = view.normals(x + box[1].start + 0.5, y + box[0].start + 0.5)
    on_ball = np.isfinite(normals[:, 0])
    if not on_ball.any():
        return NoHighlight("the brightest place is on the ball's rim")
    mean = (weights[y, x][on_ball, None] * normals[on_ball]).sum(axis=0)
    mean /= np.linalg.norm(mean)
    at = view.project(mean)
    return Highlight(float(at[0]), float(at[1]), mean, level, area)


def _occluded(
    view: BallView,
    lit: NDArray[np.bool_],
    known: NDArray[np.bool_],
    corner: tuple[int, int],
    level: float,
    area_px: float,
) -> Highlight | NoHighlight:
    """A partly hidden highlight, fitted as a disc of the area of other frames' highlights.

    Args:
        view: the camera's view of the ball.
        lit: (height, width) pixels of the crop that are bright by the lamp.
        known: (height, width) where the lamp would show.
        corner: x and y of the crop in the picture.
        level: brightness of the highlight.
        area_px: area of the disc, 0 if unknown.
    """
    center = fit_occluded_disc(lit, known, area_px) if area_px > 0 else None
    if center is not None:
        x, y = center[0] + corner[0], center[1] + corner[1]
        normal = view.normals(np.array(x), np.array(y))
        if np.isfinite(normal).all():
            return Highlight(x, y, normal, level, round(area_px))
    return NoHighlight("the lamp's mirror image lies on that of another lamp, or of a bright window")


def _match_exposure(light: Plane, room: Plane, inside: NDArray[np.bool_]) -> Plane:
    """The dark picture scaled to the exposure of the bright one, by the median ratio of unclipped pixels inside."""
    usable = inside & (room > 0.01) & (room < 0.9) & (light < 0.9)
    gain = float(np.median(light[usable] / room[usable])) if usable.sum() > 50 else 1.0
    return room * np.float32(np.clip(gain, 0.5, 2.0))


def _lies_on_white(blob: NDArray[np.bool_], room: Plane) -> bool:
    """Whether much of a blob's rim lies where the picture is white without the lamp, which hides the lamp's edge."""
    rim = cv2.dilate(blob.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool) & ~blob
    return bool(np.count_nonzero(rim & (room > _TUNABLES.white)) > _TUNABLES.max_white_rim * np.count_nonzero(rim))


def _largest_sum(weights: Plane) -> NDArray[np.bool_]:
    """The connected component of positive weights with the largest sum."""
    count, labels = cv2.connectedComponents((weights > 0).astype(np.uint8))
    sums = np.bincount(labels.ravel(), np.maximum(weights, 0).ravel(), count)
    return np.asarray(labels == int(np.argmax(sums[1:])) + 1)


def _without_rays(blob: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The blob opened by a disc half as thick as its thickest place, which cuts thin rays off."""
    padded = np.pad(blob.astype(np.uint8), 1)
    radius = _TUNABLES.core * float(cv2.distanceTransform(padded, cv2.DIST_L2, 5).max())
    if radius < 1:
        return blob
    reach = int(np.ceil(radius))
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    disc = (np.hypot(x, y) <= radius).astype(np.uint8)
    opened = cv2.morphologyEx(padded, cv2.MORPH_OPEN, disc)[1:-1, 1:-1] > 0
    return _largest_sum(opened.astype(np.float32)) & blob


def fit_occluded_disc(lit: NDArray[np.bool_], known: NDArray[np.bool_], area_px: float) -> tuple[float, float] | None:
    """Center x, y in pixels of the disc that best fits its visible part; None where too little is visible.

    Least squares over all whole-pixel positions, by correlation, refined by a parabola.

    Args:
        lit: (height, width) pixels that are bright by the lamp.
        known: (height, width) where the lamp would show; `lit` does not count elsewhere.
        area_px: area of the disc.
    """
    radius = float(np.sqrt(area_px / np.pi))
    reach = int(np.ceil(radius)) + _DISC_MARGIN_PX
    if min(lit.shape) <= 2 * reach:
        return None
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    disc = np.clip(radius + 0.5 - np.hypot(x, y), 0, 1).astype(np.float32)
    visible, telling = (lit & known).astype(np.float32), known.astype(np.float32)
    overlap = _correlate(visible, disc)
    visible_fraction = _correlate(telling, disc) / float(disc.sum())
    cost = float(visible.sum()) - 2 * overlap + _correlate(telling, disc**2)
    allowed = np.where(visible_fraction >= _TUNABLES.min_visible, cost, np.float32(np.inf))
    row, column = np.unravel_index(int(np.argmin(allowed)), cost.shape)
    if not allowed[row, column] <= _TUNABLES.max_misfit * area_px:
        return None
    down = _parabola_minimum(cost[max(row - 1, 0) : row + 2, column])
    across = _parabola_minimum(cost[row, max(column - 1, 0) : column + 2])
    return float(column + across + 0.5), float(row + down + 0.5)


def _correlate(picture: Plane, disc: Plane) -> Plane:
    return np.asarray(cv2.filter2D(picture, cv2.CV_32F, disc, borderType=cv2.BORDER_CONSTANT))


def _parabola_minimum(costs: Plane) -> float:
    """Offset from the middle of three costs to the minimum of a parabola through them; 0 at a border."""
    if len(costs) < 3:
        return 0.0
    before, here, after = costs.astype(float)
    bend = before - 2 * here + after
    return float(np.clip((before - after) / 2 / bend, -0.5, 0.5)) if bend > 0 else 0.0


class BallCrops:
    """A ball's surroundings cropped from the frames of a film, kept until highlights are found in them.

    Memory: 130 KB a frame at most.
    """

    def __init__(self, outline: BallOutline, size: tuple[int, int]) -> None:
        """Crop the surroundings of this outline.

        Args:
            outline: of the ball where it was found, in pixels.
            size: width and height of the frames.
        """
        self._outline = outline
        reach = _TUNABLES.search_radii * outline.radius
        self._left, self._top = (max(0, int(middle - reach)) for middle in (outline.x, outline.y))
        self._right, self._bottom = (
            min(side, int(middle + reach) + 1) for middle, side in ((outline.x, size[0]), (outline.y, size[1]))
        )
        width, height = self._right - self._left, self._bottom - self._top
        scale = min(1.0, _TUNABLES.max_crop_px / max(width, height))
        self._size = (round(width * scale), round(height * scale))
        self._step = (width / self._size[0], height / self._size[1])
        self._planes: dict[int, NDArray[np.float16]] = {}

    def add(self, index: int, frame: LinearImage) -> None:
        """Keep the crop of a frame, linear RGB (height, width, 3)."""
        crop = frame[self._top : self._bottom, self._left : self._right]
        plane = cv2.resize(crop.mean(axis=2), self._size, interpolation=cv2.INTER_AREA)
        self._planes[index] = plane.astype(np.float16)

    def highlights(
        self, bright: Iterable[int], view_at: Callable[[int], PinholeView | None]
    ) -> dict[int, Highlight | NoHighlight]:
        """The highlight of each bright frame, compared with the nearest dark frame, in pixels of the whole picture.

        Args:
            bright: indices of frames that were added; all others that were added are dark.
            view_at: the camera's view of the ball in a frame; None while the ball is hidden.
        """
        bright = list(bright)
        dark = np.setdiff1d(list(self._planes), bright)
        found = {index: self._highlight(index, dark, view_at(index), 0.0) for index in bright}
        areas = [place.area_px for place in found.values() if isinstance(place, Highlight)]
        typical = float(np.median(areas)) if areas else 0.0
        return {index: self._highlight(index, dark, view_at(index), typical) for index in bright}

    def _highlight(
        self, index: int, dark: NDArray[np.intp], view: PinholeView | None, typical_area_px: float
    ) -> Highlight | NoHighlight:
        if view is None:
            return NoHighlight("something is before the ball")
        crop = CroppedView(view, (self._left, self._top), self._step)
        if view.outline != self._outline and not _contains(self._size, crop.outline):
            return NoHighlight("the ball is out of its place so far that not all of it is seen")
        dark_plane = None
        if len(dark):
            dark_plane = self._planes[int(dark[np.abs(dark - index).argmin()])].astype(np.float32)
        light = self._planes[index].astype(np.float32)
        pixel = self._step[0] * self._step[1]
        place = find_highlight(light, crop, dark_plane, typical_area_px / pixel)
        if isinstance(place, NoHighlight):
            return place
        x, y = crop.to_picture(place.x, place.y)
        return Highlight(float(x), float(y), place.normal, place.brightness, round(place.area_px * pixel))


def _contains(size: tuple[int, int], outline: BallOutline) -> bool:
    """Whether a picture of this width and height contains all of an outline."""
    return all(
        outline.radius <= at <= side - outline.radius for at, side in zip((outline.x, outline.y), size, strict=True)
    )
