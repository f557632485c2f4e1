"""The lamp's mirror image where it lies on that of another lamp or of a bright window, which is white anyway.

Where a mirror ball shows the lamp.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import CaptureError
from relit_camera.base.images.image_types import LinearImage, check_image
from relit_camera.capture.film.ball.sphere_projection import BallView, Vectors

_LEAST_SEEN = 0.5
"""Share of the disc that must lie where the lamp can be told from the rest."""
_MISFIT = 0.35
"""Share of the disc's area on which the picture may differ from it."""
_MARGIN = 2

Plane = NDArray[np.float32]


def fit_occluded_disc(lit: NDArray[np.bool_], known: NDArray[np.bool_], area_px: float) -> tuple[float, float] | None:
    """The centre x, y in pixels of the disc that fits best to what is seen of it; None where too little is.

    Least squares over all whole pixels, by correlation, then the top of a parabola.

    Args:
        lit: (height, width) where the lamp shows.
        known: (height, width) where it can be seen whether it does; `lit` elsewhere counts not.
        area_px: of the disc.
    """
    radius = float(np.sqrt(area_px / np.pi))
    reach = int(np.ceil(radius)) + _MARGIN
    if min(lit.shape) <= 2 * reach:
        return None
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    disc = np.clip(radius + 0.5 - np.hypot(x, y), 0, 1).astype(np.float32)
    shows, tells = (lit & known).astype(np.float32), known.astype(np.float32)
    overlap = _correlated(shows, disc)
    seen = _correlated(tells, disc) / float(disc.sum())
    cost = float(shows.sum()) - 2 * overlap + _correlated(tells, disc**2)
    allowed = np.where(seen >= _LEAST_SEEN, cost, np.float32(np.inf))
    row, column = np.unravel_index(int(np.argmin(allowed)), cost.shape)
    if not allowed[row, column] <= _MISFIT * area_px:
        return None
    down = _parabola_minimum(cost[max(row - 1, 0) : row + 2, column])
    across = _parabola_minimum(cost[row, max(column - 1, 0) : column + 2])
    return float(column + across + 0.5), float(row + down + 0.5)


def _correlated(picture: Plane, disc: Plane) -> Plane:
    return np.asarray(cv2.filter2D(picture, cv2.CV_32F, disc, borderType=cv2.BORDER_CONSTANT))


def _parabola_minimum(costs: Plane) -> float:
    """Where a parabola through three costs is least, beside the middle one; 0 at a border."""
    if len(costs) < 3:
        return 0.0
    before, here, after = costs.astype(float)
    bend = before - 2 * here + after
    return float(np.clip((before - after) / 2 / bend, -0.5, 0.5)) if bend > 0 else 0.0


_WITHIN = 0.985
"""Of the radius: pixels farther out are mixed with what is behind the ball."""
_LEAST = 0.1
"""Least brightness of a highlight beside what the ball shows anyway; white is 1."""
_NOISE = 8.0
"""A highlight is so many times as bright as the noise."""
_LIT = 0.15
"""Share of the highlight's brightness: a mirror ball shows a lit room, but is not lit itself."""
_THRESHOLD = 0.5
"""Share of the highlight's brightness from which a pixel belongs to it."""
_CORE = 0.5
"""Rays of a glint that are thinner than this share of its thickest place are cut off."""
_LARGEST = 0.08
"""Share of the ball's picture: no lamp's mirror image is larger."""
_WHITE = 0.8
_RIM = 0.2
"""Share of the highlight's rim that may lie on white: with more, its middle is not known."""
_SMALLEST = 0.1
"""Share of the other frames' highlights: a smaller one is a mirror image of a mirror image."""


@dataclass(frozen=True, eq=False)
class Highlight:
    """The lamp's mirror image.

    Attributes:
        x, y: its centre in pixels.
        normal: (3,) of the ball's surface there.
        brightness: how much brighter than what the ball shows without the lamp; white is 1.
        area_px: how many pixels belong to it.
    """

    x: float
    y: float
    normal: Vectors
    brightness: float
    area_px: int


@dataclass(frozen=True)
class NoHighlight:
    """Why a frame shows none."""

    reason: str


def find_highlight(
    frame: LinearImage, view: BallView, dark: LinearImage | None = None, typical_area_px: float = 0.0
) -> Highlight | NoHighlight:
    """Find the lamp's mirror image and its centre to a fraction of a pixel.

    After thesis 4.3.4, with its correction: the mean, weighted with the brightness above a threshold, is of normals of
    the ball's surface and not of places in the picture, which would draw highlights at the side inward. Of several
    bright places the one that holds most light counts, without thin rays that glare or scratches draw out of it. So
    lamps seen twice (in another mirror that the ball shows) do not count: their second image is far smaller. One that
    lies partly on what is white anyway is taken for a disc of the usual size, where that is known and half of it shows.

    Args:
        frame: linear RGB (height, width, 3).
        view: of the ball.
        dark: the same without the lamp: what the room mirrors there is taken off, matched in exposure.
        typical_area_px: median `area_px` in other frames of the video, 0 if not known: a far smaller one is not it.

    Raises:
        CaptureError: the frames differ in size, or the ball is not in the picture.
        ImageError: one is no linear RGB picture.
    """
    check_image(frame, np.float32, "frame")
    light = frame.mean(axis=2)
    return find_highlight_in_plane(
        light, view, None if dark is None else _same(dark, frame).mean(axis=2), typical_area_px
    )


def find_highlight_in_plane(
    light: Plane, view: BallView, dark: Plane | None = None, typical_area_px: float = 0.0
) -> Highlight | NoHighlight:
    """The same for pictures of one plane, float32 (height, width).

    Raises:
        CaptureError: the ball is not in the picture.
    """
    size = (light.shape[1], light.shape[0])
    outline = view.outline
    rows, columns = outline.pixels_within(_WITHIN, size)
    if len(rows) == 0:
        place = f"the mirror ball at {outline.x:.0f}, {outline.y:.0f}"
        raise CaptureError(
            f"{place} is not in a picture of {size[0]}x{size[1]}", "give its centre and radius in pixels"
        )
    box = (slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1))
    inside = np.zeros(light[box].shape, bool)
    inside[rows - rows.min(), columns - columns.min()] = True
    light, room = light[box], None if dark is None else dark[box]
    excess = np.where(inside, light if room is None else light - _matched(light, room, inside), np.float32(0))
    level = float(cv2.GaussianBlur(excess, (0, 0), max(0.5, 0.004 * outline.radius)).max())
    spread = float(np.median(np.abs(excess[inside] - np.median(excess[inside]))))
    if level < max(_LEAST, _NOISE * spread):
        return NoHighlight(f"nothing in the ball is brighter by more than {level:.2f} of white")
    if dark is not None and np.median(excess[inside]) > _LIT * level:
        return NoHighlight("all of the ball is lit by the lamp, as no mirror is")
    weights = np.clip(excess, 0, level) - np.float32(_THRESHOLD * level)
    blob = _brightest(weights)
    area = int(blob.sum())
    if area > _LARGEST * inside.sum():
        return NoHighlight(f"{area / inside.sum():.0%} of the ball is as bright as the highlight")
    if area < _SMALLEST * typical_area_px:
        return NoHighlight(f"the brightest place has {area} pixels, in other frames {typical_area_px:.0f}")
    if room is not None and _cut_short(blob, room):
        known = inside & (room < 1 - _THRESHOLD * level)
        return _covered(view, weights > 0, known, (box[1].start, box[0].start), level, typical_area_px)
    y, x = np.nonzero(_core(blob))
    normals = view.normals(x + box[1].start + 0.5, y + box[0].start + 0.5)
    seen = np.isfinite(normals[:, 0])
    if not seen.any():
        return NoHighlight("the brightest place is on the ball's rim")
    mean = (weights[y, x][seen, None] * normals[seen]).sum(axis=0)
    mean /= np.linalg.norm(mean)
    at = view.picture(mean)
    return Highlight(float(at[0]), float(at[1]), mean, level, area)


def _covered(
    view: BallView,
    lit: NDArray[np.bool_],
    known: NDArray[np.bool_],
    corner: tuple[int, int],
    level: float,
    area_px: float,
) -> Highlight | NoHighlight:
    """A highlight that is seen in part only: a disc as large as those of other frames."""
    centre = fit_occluded_disc(lit, known, area_px) if area_px > 0 else None
    if centre is not None:
        x, y = centre[0] + corner[0], centre[1] + corner[1]
        normal = view.normals(np.array(x), np.array(y))
        if np.isfinite(normal).all():
            return Highlight(x, y, normal, level, round(area_px))
    return NoHighlight("the lamp's mirror image lies on that of another lamp, or of a bright window")


def _same(dark: LinearImage, frame: LinearImage) -> LinearImage:
    check_image(dark, np.float32, "dark frame")
    if dark.shape != frame.shape:
        sizes = [f"{picture.shape[1]}x{picture.shape[0]}" for picture in (dark, frame)]
        raise CaptureError(f"the dark frame is {sizes[0]}, the bright one {sizes[1]}", "take both from one video")
    return dark


def _matched(light: Plane, room: Plane, inside: NDArray[np.bool_]) -> Plane:
    """What the room mirrors in the ball without the lamp, at the exposure of the frame with it."""
    usable = inside & (room > 0.01) & (room < 0.9) & (light < 0.9)
    gain = float(np.median(light[usable] / room[usable])) if usable.sum() > 50 else 1.0
    return room * np.float32(np.clip(gain, 0.5, 2.0))


def _cut_short(blob: NDArray[np.bool_], room: Plane) -> bool:
    """Whether a good part of a blob's rim is where the camera sees nothing but white anyway."""
    rim = cv2.dilate(blob.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool) & ~blob
    return bool(np.count_nonzero(rim & (room > _WHITE)) > _RIM * np.count_nonzero(rim))


def _brightest(weights: Plane) -> NDArray[np.bool_]:
    """The connected place with the largest sum of weights above 0."""
    count, labels = cv2.connectedComponents((weights > 0).astype(np.uint8))
    sums = np.bincount(labels.ravel(), np.maximum(weights, 0).ravel(), count)
    return np.asarray(labels == int(np.argmax(sums[1:])) + 1)


def _core(blob: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """What a disc half as thick as the blob's thickest place reaches inside of it."""
    padded = np.pad(blob.astype(np.uint8), 1)
    radius = _CORE * float(cv2.distanceTransform(padded, cv2.DIST_L2, 5).max())
    if radius < 1:
        return blob
    reach = int(np.ceil(radius))
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    disc = (np.hypot(x, y) <= radius).astype(np.uint8)
    opened = cv2.morphologyEx(padded, cv2.MORPH_OPEN, disc)[1:-1, 1:-1] > 0
    return _brightest(opened.astype(np.float32)) & blob
