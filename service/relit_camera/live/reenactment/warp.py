"""Warping the source image into the output: an affine placement of the whole, with a smooth flow inside it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import Flow

Box = tuple[int, int, int, int]
Picture = TypeVar("Picture", NDArray[np.uint8], NDArray[np.float32])


def source_from_output(source: tuple[int, int], output: tuple[int, int]) -> NDArray[np.float64]:
    """The affine map (2, 3) from output to source pixels that fits the whole source image in, centred, at the bottom.

    Args:
        source: (width, height).
        output: (width, height).
    """
    scale = min(output[0] / source[0], output[1] / source[1])
    left = (output[0] - scale * source[0]) / 2
    top = output[1] - scale * source[1]
    return np.array([[1 / scale, 0, -left / scale], [0, 1 / scale, -top / scale]])


def move_body(
    placed: NDArray[np.float64], pivot: NDArray[np.float64], shift: NDArray[np.float64], scale: float, bottom: float
) -> NDArray[np.float64]:
    """`placed`, with the person moved by `shift` and grown by `scale` about `pivot`, all in source pixels.

    The source image's lower edge, at y = `bottom`, never rises into view: a person would seem to hover.
    """
    lift = shift[1] + (scale - 1) * (bottom - pivot[1])
    shift = shift - [0.0, min(lift, 0.0)]
    view = np.array([[1 / scale, 0, 0], [0, 1 / scale, 0]])
    view[:, 2] = pivot - (pivot + shift) / scale
    return np.asarray(view @ np.vstack([placed, [0, 0, 1]]))


def visible_box(placed: NDArray[np.float64], source: tuple[int, int], output: tuple[int, int]) -> Box:
    """The output pixels (left, top, right, bottom) that show the source image under an affine map without rotation."""
    inverse = inverse_affine(placed)
    corners = np.array([[0, 0], source]) @ inverse[:, :2].T + inverse[:, 2]
    left, top = np.clip(np.floor(corners.min(axis=0)), 0, output).astype(int)
    right, bottom = np.clip(np.ceil(corners.max(axis=0)), 0, output).astype(int)
    return int(left), int(top), int(right), int(bottom)


def inverse_affine(affine: NDArray[np.float64]) -> NDArray[np.float64]:
    """The inverse (2, 3) of an affine map (2, 3)."""
    return np.linalg.inv(np.vstack([affine, [0, 0, 1]]))[:2]


PATCH_FADE = 0.1
"""Share of a patch's side over which it gives way to what lies under it."""
MAX_STEP = 8
"""Positions outside the fine patches are computed for at least every eighth output pixel and interpolated."""


@dataclass(frozen=True)
class FlowPatch:
    """Flow on a grid.

    Attributes:
        flow: (rows, columns, 2) float32 backward flow in source pixels; the grid's corners are the region's.
        region: (4,) float64 left, top, right, bottom in source pixels.
    """

    flow: Flow
    region: NDArray[np.float64]

    @property
    def positions(self) -> NDArray[np.float32]:
        """Where each grid point looks: its own place plus the flow, (rows, columns, 2) source pixels."""
        rows, columns = self.flow.shape[:2]
        x = np.linspace(self.region[0], self.region[2], columns, dtype=np.float32)
        y = np.linspace(self.region[1], self.region[3], rows, dtype=np.float32)
        return np.asarray(self.flow + np.dstack(np.meshgrid(x, y)), dtype=np.float32)


GRID_STEP = 4
"""Output pixels between computed positions; what lies between is interpolated."""
BAND_CELLS = 16
"""Rows of cells that are sampled at a time: their positions stay in the processor's cache."""


@dataclass(frozen=True)
class PositionGrid:
    """Where the pixels of a box of the output look in the source image, given in the middle of cells of `step` pixels.

    The box is covered with cells of `step` × `step` pixels, beginning at its left upper corner, and one more round
    them, so that nothing in the box is extrapolated: `positions[i, j]` belongs to the output position
    (left + (j − ½) · step, top + (i − ½) · step). Between the middles of cells positions are bilinear.

    Attributes:
        positions: (rows + 2, columns + 2, 2) float32 source pixels, pixel centers at integers + ½.
        box: left, top, right, bottom in output pixels.
        step: the side of a cell in output pixels.
    """

    positions: NDArray[np.float32]
    box: Box
    step: int

    def nodes(self) -> NDArray[np.float32]:
        """Positions (rows, columns, 2) of the cells in the box: of the pixels of a picture 1/`step` of its size."""
        return self.positions[1:-1, 1:-1]

    def sample(
        self,
        image: Picture,
        enlarged: float = 1,
        beyond: int = cv2.BORDER_REPLICATE,
        seen: NDArray[np.bool_] | None = None,
    ) -> Picture:
        """The box's pixels (height, width[, channels]), bilinear, in the type of `image`.

        Args:
            image: (rows, columns[, channels ≤ 4]) uint8 or float32, what the positions look at.
            enlarged: by how much it is larger than the source image.
            beyond: OpenCV's border mode for what lies outside it; 0 where the mode takes a constant.
            seen: (rows, columns) the cells in the box that are needed, for all if None; others may be left 0.
        """
        width, height = self.box[2] - self.box[0], self.box[3] - self.box[1]
        sampled = (np.empty if seen is None else np.zeros)((height, width, *image.shape[2:]), image.dtype)
        # cv2 counts pixel centers as integers: x_ours = x_cv + ½.
        positions = self.positions * np.float32(enlarged) - np.float32(0.5)
        step = self.step
        for first in range(0, len(positions) - 2, BAND_CELLS):
            cells = positions[first : first + BAND_CELLS + 2]
            top, bottom, left, right = first * step, min((first + BAND_CELLS) * step, height), 0, width
            if seen is not None:
                columns = np.flatnonzero(seen[first : first + BAND_CELLS].any(axis=0))
                if columns.size == 0:
                    continue
                left, right = columns[0] * step, min((columns[-1] + 1) * step, width)
                cells = cells[:, columns[0] : columns[-1] + 3]
            fine = cv2.resize(cells, None, fx=step, fy=step, interpolation=cv2.INTER_LINEAR)
            band = fine[step : step + bottom - top, step : step + right - left]
            onto = sampled[top:bottom, left:right]
            cv2.remap(image, band, None, cv2.INTER_LINEAR, dst=onto, borderMode=beyond, borderValue=0)
        return sampled


@dataclass(frozen=True)
class Warp:
    """Where each output pixel looks in the source image: u = affine(x), then u + flow(u).

    Attributes:
        affine: (2, 3) float64, output pixels → source pixels (centres at integers + ½ in both).
        patches: the first covers the head and fades to 0 outside; later ones refine it where motion is fine.
    """

    affine: NDArray[np.float64]
    patches: tuple[FlowPatch, ...]

    def map(self, box: Box, enlarged: int = 1) -> NDArray[np.float32]:
        """Positions (height, width, 2) for cv2.remap, for the output pixels of `box` (left, top, right, bottom).

        `enlarged`: by how much the source image to be sampled is larger than the one that the warp was made for.
        """
        width, height = box[2] - box[0], box[3] - box[1]
        # Few positions, interpolated. One beyond each side, so that none is extrapolated.
        step = self._step()
        columns, rows = -(-width // step) + 2, -(-height // step) + 2
        coarse = np.zeros((rows, columns, 2), dtype=np.float32)
        from_coarse = self._source_from_pixel(box[0] - 0.5 * step, box[1] - 0.5 * step, step)
        for patch in self.patches[:1]:
            _blend_grid(coarse, patch.flow, patch.region, from_coarse)
        a = from_coarse.astype(np.float32)
        coarse += (a[:, 0] * np.arange(columns, dtype=np.float32)[:, None] + a[:, 2])[None]
        coarse += (a[:, 1] * np.arange(rows, dtype=np.float32)[:, None])[:, None]
        # cv2 counts pixel centres as integers: x_ours = x_cv + ½.
        coarse = coarse * np.float32(enlarged) - np.float32(0.5)
        fine = cv2.resize(coarse, (columns * step, rows * step), interpolation=cv2.INTER_LINEAR)
        positions = np.ascontiguousarray(fine[step : step + height, step : step + width])
        from_pixel = self._source_from_pixel(box[0] + 0.5, box[1] + 0.5, 1)
        for patch in self.patches[1:]:
            _blend_grid(positions, patch.positions * np.float32(enlarged) - np.float32(0.5), patch.region, from_pixel)
        return positions

    def grid(self, box: Box, step: int = GRID_STEP) -> PositionGrid:
        """Where the output pixels of `box` (left, top, right, bottom) look."""
        columns, rows = -(-(box[2] - box[0]) // step) + 2, -(-(box[3] - box[1]) // step) + 2
        from_node = self._source_from_pixel(box[0] - 0.5 * step, box[1] - 0.5 * step, step)
        positions = np.zeros((rows, columns, 2), np.float32)
        for patch in self.patches:
            _blend_grid(positions, patch.flow, patch.region, from_node)
        a = from_node.astype(np.float32)
        positions += a[:, 0] * np.arange(columns, dtype=np.float32)[:, None] + a[:, 2]
        positions += (a[:, 1] * np.arange(rows, dtype=np.float32)[:, None])[:, None]
        return PositionGrid(positions, box, step)

    def _step(self) -> int:
        """Output pixels between computed positions: no more than between the points of the first patch's grid."""
        if not self.patches:
            return MAX_STEP
        first = self.patches[0]
        spacing = (first.region[2:] - first.region[:2]) / (np.array(first.flow.shape[1::-1]) - 1)
        source_per_output = np.sqrt(abs(np.linalg.det(self.affine[:, :2])))
        return int(np.clip(spacing.min() / source_per_output, 1, MAX_STEP))

    def _source_from_pixel(self, left: float, top: float, step: float) -> NDArray[np.float64]:
        """The affine map (2, 3) from array indices to source pixels, index 0 at output position (left, top)."""
        return np.asarray(self.affine @ np.array([[step, 0, left], [0, step, top], [0, 0, 1]]))

    def apply(self, source: NDArray[np.float32], box: Box, enlarged: int = 1) -> NDArray[np.float32]:
        """Warp the source image (height, width[, channels ≤ 4]) to the output pixels of `box`; 0 beyond its edges."""
        return sample_bilinear(source, self.map(box, enlarged))


def sample_bilinear(
    source: NDArray[np.float32], positions: NDArray[np.float32], beyond: int = cv2.BORDER_CONSTANT
) -> NDArray[np.float32]:
    """Sample a picture at `positions` (height, width, 2) from `Warp.map`, bilinear; `beyond`: OpenCV's border mode."""
    view = cv2.remap(source, positions, None, cv2.INTER_LINEAR, borderMode=beyond, borderValue=0)
    return np.asarray(view, dtype=np.float32)


def _blend_grid(
    onto: NDArray[np.float32],
    values: NDArray[np.float32],
    region: NDArray[np.float64],
    source_from_index: NDArray[np.float64],
) -> None:
    """Blend a grid of values (rows, columns, 2) over a source region into an array of positions, in place."""
    rows, columns = values.shape[:2]
    spacing = (region[2:] - region[:2]) / [columns - 1, rows - 1]
    grid_from_source = np.array([[1 / spacing[0], 0, 0], [0, 1 / spacing[1], 0], [0, 0, 1]])
    grid_from_source[:2, 2] = -region[:2] / spacing
    grid_from_index = grid_from_source @ np.vstack([source_from_index, [0, 0, 1]])
    corners = np.array([[0, 0, 1], [columns - 1, 0, 1], [0, rows - 1, 1], [columns - 1, rows - 1, 1]], dtype=float)
    seen = (corners @ np.linalg.inv(grid_from_index).T)[:, :2]
    left, top = np.maximum(np.floor(seen.min(axis=0)).astype(int), 0)
    right, bottom = np.minimum(np.ceil(seen.max(axis=0)).astype(int) + 1, onto.shape[1::-1])
    if right <= left or bottom <= top:
        return
    local = (grid_from_index @ np.array([[1, 0, left], [0, 1, top], [0, 0, 1]]))[:2]
    edges = [np.clip(np.minimum(np.arange(n), np.arange(n)[::-1]) / (PATCH_FADE * n), 0, 1) for n in (rows, columns)]
    cover = np.minimum.outer(*edges).astype(np.float32)
    stacked = np.dstack([values * cover[..., None], cover])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    pasted = cv2.warpAffine(stacked, local, (int(right - left), int(bottom - top)), flags=flags)
    area = onto[top:bottom, left:right]
    area *= 1 - pasted[..., 2:]
    area += pasted[..., :2]
