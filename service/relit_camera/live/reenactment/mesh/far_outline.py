"""The outline of a turned face at its far side, drawn pixel by pixel over the moved picture.

Between two cells of a warp positions are interpolated. Where one looks at the cheek and the next at what is behind it,
all that the cheek hides shows between them as a thin line: ear, sideburn, jaw.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import RgbaImage
from relit_camera.live.reenactment.mesh.triangle_drawing import draw_triangles
from relit_camera.live.reenactment.source_image import BEYOND, UPSAMPLING
from relit_camera.live.reenactment.warp import PositionGrid, sample_points

STRIP_CELLS = 2
"""Cells beyond the outline of a cheek, over which what is farther out shows instead: what the warp shows there is the
hidden side of the head, narrowed to a line. At half the resolution, where cells are twice as large, it stays: a strip
that comes and goes by such cells as the head turns would be seen more."""
SUBPIXELS = 4
"""Points across a pixel, and down it, by which the share of the face in it is counted: 2, 4 or 8. OpenCV counts those
too that a border touches: the face is wider by an eighth to a quarter of a pixel."""
SHIFT = 4
"""Binary digits that OpenCV is told of a fraction of a pixel."""


@dataclass(frozen=True)
class Silhouette:
    """Where a moved face ends, in pixels of the moved picture.

    Attributes:
        corners: (triangles, 3, 2) float64 of all that shows of the face.
        edges: (count, 2, 2) float64 the ends of the sides along which it is to be drawn, folds within the face among
            them, where that changes nothing.
        shares: (count,) float64 how far each is, 0..1.
        hiding: (count,) float64 how far what lies right behind it is left out, 0..1.
    """

    corners: NDArray[np.float64]
    edges: NDArray[np.float64]
    shares: NDArray[np.float64]
    hiding: NDArray[np.float64]


@dataclass(frozen=True)
class OutlineTask:
    """What is drawn along an outline.

    Attributes:
        pixels: (2, count) rows and columns of the moved picture.
        face, behind: (count, 2) float32 where each looks on the face, and where at what is behind it, in source pixels;
            both go on a little beyond the outline.
        within: (count,) float32 the share of each that the face fills.
        cover: (count,) float32 how far each is drawn.
    """

    pixels: NDArray[np.intp]
    face: NDArray[np.float32]
    behind: NDArray[np.float32]
    within: NDArray[np.float32]
    cover: NDArray[np.float32]

    def draw(self, moved: RgbaImage, person: RgbaImage) -> None:
        """Draw into the moved picture, in place, from the person as `Cutout.image` has them."""
        at = tuple(self.pixels)
        sampled = (sample_points(person, looks, UPSAMPLING, BEYOND) for looks in (self.face, self.behind))
        face, behind, below = (np.ascontiguousarray(each.T, np.float32) for each in (*sampled, moved[at]))
        moved[at] = np.rint(_mixed(_mixed(face, behind, self.within), below, self.cover)).T


def plan_far_outline(silhouette: Silhouette | None, grid: PositionGrid, half_size: bool = False) -> OutlineTask | None:
    """What is to be drawn along an outline; None where there is none, or nothing of it in the picture.

    Args:
        silhouette: of the face in this picture.
        grid: where the picture's pixels look.
        half_size: the picture has half its resolution, and positions are twice as far apart.
    """
    if silhouette is None:
        return None
    strip = 0 if half_size else STRIP_CELLS
    step, (rows, columns) = grid.step, grid.nodes().shape[:2]
    ends, margin = silhouette.edges.reshape(-1, 2) / step, 2 * strip + 2
    first = np.maximum(np.floor(ends.min(axis=0)).astype(int) - margin, 0)
    last = np.minimum(np.ceil(ends.max(axis=0)).astype(int) + margin, (columns, rows))
    if (last <= first).any():
        return None
    low, high = step * first, np.minimum(step * last, (grid.box[2] - grid.box[0], grid.box[3] - grid.box[1]))
    width, height = high - low
    positions = grid.positions[first[1] : last[1] + 2, first[0] : last[0] + 2]
    # The middle of a cell is a whole number, and there is one cell more round the box: see `PositionGrid`.
    corners, edges = ((points - low) / step + 0.5 for points in (silhouette.corners, silhouette.edges))
    inside = draw_triangles(corners, np.ones((*corners.shape[:2], 1)), positions.shape[:2])[0] > 0
    beside = _filled(positions, ~inside, 1)
    beyond = _filled(beside, ~_grown(inside, strip), strip + 2)
    hiding = _band(edges, silhouette.hiding, inside.shape, strip)[..., None]
    # Farther in the face alone shows as it is, and farther out what is behind it.
    seen = (_grown(inside, strip + 1) & _grown(~inside, 1))[1:-1, 1:-1]
    shares = cv2.resize(_band(edges, silhouette.shares, inside.shape, strip), None, fx=step, fy=step)
    drawn = cv2.resize(seen.view(np.uint8), None, fx=step, fy=step, interpolation=cv2.INTER_NEAREST)
    cover = shares[step : step + height, step : step + width] * drawn[:height, :width]
    pixels = np.nonzero(cover > 0)
    if not pixels[0].size:
        return None
    both: NDArray[np.float32] = np.dstack([_filled(positions, inside, 1), beside + hiding * (beyond - beside)])
    places = (np.column_stack(pixels[::-1]).astype(np.float32) + np.float32(0.5)) / np.float32(step) + 1
    looks = sample_points(both, places)
    return OutlineTask(
        pixels=np.stack([pixels[0] + low[1], pixels[1] + low[0]]),
        face=looks[:, :2],
        behind=looks[:, 2:],
        within=_filled_share(corners, seen, step, pixels),
        cover=cover[pixels],
    )


def _grown(cells: NDArray[np.bool_], by: int) -> NDArray[np.bool_]:
    """The cells and those that are up to so many away."""
    grown = cv2.dilate(cells.view(np.uint8), np.ones((2 * by + 1, 2 * by + 1), np.uint8))
    return np.asarray(grown.view(np.bool_))


def _filled(positions: NDArray[np.float32], known: NDArray[np.bool_], reach: int) -> NDArray[np.float32]:
    """Positions (rows, columns, 2), where they are not known the mean of those that are, up to `reach` cells away."""
    size, mask = (2 * reach + 1, 2 * reach + 1), known.view(np.uint8)
    share = cv2.blur(mask.astype(np.float32), size)
    sums = cv2.blur(cv2.copyTo(positions, mask), size)
    filled, places = positions.copy(), np.nonzero(~known & (share > 1e-6))
    filled[places] = sums[places] / share[places][:, None]
    return filled


def _band(
    edges: NDArray[np.float64], shares: NDArray[np.float64], shape: tuple[int, ...], reach: int
) -> NDArray[np.float32]:
    """How far cells (rows, columns) belong to lines: as far as `shares` say up to `reach` cells aside, then less."""
    band = np.zeros(shape, np.float32)
    ends, order = np.rint(edges * 2**SHIFT).astype(np.int32), np.argsort(shares)
    order = order[shares[order] > 0]
    for share, (start, end) in zip(shares[order].tolist(), ends[order].tolist(), strict=True):
        cv2.line(band, start, end, share, 4 * reach + 4, cv2.LINE_8, SHIFT)
    return np.asarray(cv2.blur(band, (2 * reach + 1, 2 * reach + 1)), np.float32)


def _filled_share(
    corners: NDArray[np.float64],
    seen: NDArray[np.bool_],
    step: int,
    pixels: tuple[NDArray[np.intp], ...],
) -> NDArray[np.float32]:
    """The share that triangles fill of each of these pixels (count,), which lie in cells that are seen."""
    (rows, columns), scale = seen.shape, step * SUBPIXELS
    sums = cv2.integral(seen.view(np.uint8))
    first, second, third = corners.transpose(1, 0, 2)
    nearest, farthest = (most(most(first, second), third) - 0.5 for most in (np.minimum, np.maximum))
    low = np.clip(np.floor(nearest).astype(int), 0, (columns, rows))
    high = np.clip(np.ceil(farthest).astype(int), 0, (columns, rows))
    (left, top), (right, bottom) = low.T, high.T
    touching = sums[bottom, right] - sums[bottom, left] - sums[top, right] + sums[top, left] > 0
    filled, whole = np.zeros((scale * rows, scale * columns), np.uint8), SUBPIXELS**2
    points = scale * (corners[touching] - 0.5) - 0.5
    for triangle in np.rint(points * 2**SHIFT).astype(np.int32):
        cv2.fillConvexPoly(filled, triangle, whole, cv2.LINE_8, SHIFT)
    # Their mean over a pixel is the number of points in it that are filled. OpenCV is fastest at halving.
    for _ in range(SUBPIXELS.bit_length() - 1):
        filled = cv2.resize(filled, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    return np.asarray(filled[pixels] / np.float32(whole), np.float32)


def _mixed(front: NDArray[np.float32], back: NDArray[np.float32], share: NDArray[np.float32]) -> NDArray[np.float32]:
    """Two pictures of straight alpha (4, count), the first by a share (count,) of each pixel.

    A channel at a time: numpy takes several times as long for rows of four.
    """
    by_front, by_back = share * front[3], (1 - share) * back[3]
    alpha = by_front + by_back
    colors = by_front * front[:3] + by_back * back[:3]
    return np.vstack([colors / np.maximum(alpha, np.float32(1e-3)), alpha])
