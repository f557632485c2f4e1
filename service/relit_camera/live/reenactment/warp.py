"""Warping the source image into the output: an affine placement of the whole, with a smooth flow inside it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import ceil, floor
from typing import Protocol, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.easing import smoothstep
from relit_camera.base.images.image_types import Box, Flow

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
    return np.asarray(cv2.invertAffineTransform(affine), dtype=np.float64)


BAND_CELLS = 16
"""Rows of cells that are sampled at a time: their positions stay in the processor's cache."""

POINT_COLUMNS = 64
"""Single points are sampled in rows of so many."""


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

    def halved(self) -> PositionGrid:
        """The same positions for a picture of half the size, if `step` is even."""
        left, top, right, bottom = self.box
        return PositionGrid(self.positions, (0, 0, -(-(right - left) // 2), -(-(bottom - top) // 2)), self.step // 2)

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
        step = self.step
        for first in range(0, len(self.positions) - 2, BAND_CELLS):
            cells = self.positions[first : first + BAND_CELLS + 2]
            top, bottom, left, right = first * step, min((first + BAND_CELLS) * step, height), 0, width
            if seen is not None:
                columns = np.flatnonzero(seen[first : first + BAND_CELLS].any(axis=0))
                if columns.size == 0:
                    continue
                left, right = columns[0] * step, min((columns[-1] + 1) * step, width)
                cells = cells[:, columns[0] : columns[-1] + 3]
            cells = cells * np.float32(enlarged)
            cells -= np.float32(0.5)  # cv2 counts pixel centers as integers: x_ours = x_cv + ½
            fine = cv2.resize(cells, None, fx=step, fy=step, interpolation=cv2.INTER_LINEAR)
            band = fine[step : step + bottom - top, step : step + right - left]
            onto = sampled[top:bottom, left:right]
            cv2.remap(image, band, None, cv2.INTER_LINEAR, dst=onto, borderMode=beyond, borderValue=0)
        return sampled


def sample_points(
    image: Picture, looks: NDArray[np.float32], enlarged: float = 1, beyond: int = cv2.BORDER_REPLICATE
) -> Picture:
    """What single points show: (count, channels), bilinear, in the type of `image`.

    Args:
        image: (rows, columns, channels ≤ 4), what they look at.
        looks: (count, 2) where each looks in the source image, pixels; one at least.
        enlarged: by how much it is larger than the source image.
        beyond: as in `PositionGrid.sample`.
    """
    # As rows of a picture, for OpenCV limits the sides of what it samples; the last one is filled up.
    places = np.resize(looks, (-(-len(looks) // POINT_COLUMNS), POINT_COLUMNS, 2)) * np.float32(enlarged)
    places -= np.float32(0.5)
    sampled: Picture = cv2.remap(image, places, None, cv2.INTER_LINEAR, borderMode=beyond, borderValue=0)
    return sampled.reshape(-1, image.shape[2])[: len(looks)]


@dataclass(frozen=True)
class Nodes:
    """The points of a grid over the output while positions are written there.

    Attributes:
        source_from_node: (2, 3) float64, column and row of a node → its place, where it would look if nothing moved.
        positions: (2, rows, columns) float32, x and y in source pixels where each looks; patches change it in place.
    """

    source_from_node: NDArray[np.float64]
    positions: NDArray[np.float32]

    @cached_property
    def places(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Of the places: x and y in source pixels, each of a shape that broadcasts to (rows, columns)."""
        rows, columns = self.positions.shape[1:]
        column, row = np.arange(columns, dtype=np.float32), np.arange(rows, dtype=np.float32)[:, None]
        x, y = (
            # Where the axes of output and source are the same, x is one row and y one column.
            (a * column if a else np.float32(0)) + (b * row if b else np.float32(0)) + c
            for a, b, c in self.source_from_node.astype(np.float32)
        )
        return x, y

    def within(self, box: NDArray[np.float64]) -> Nodes | None:
        """A view of the smallest rectangle of nodes with all whose places lie in a box (4,); None where none do."""
        # Numbers, which must be finite: arrays of so few take several times as long.
        corners = [(x, y) for x in box[::2].tolist() for y in box[1::2].tolist()]
        to_node = inverse_affine(self.source_from_node).tolist()
        across, down = ([a * x + b * y + c for x, y in corners] for a, b, c in to_node)
        rows, columns = self.positions.shape[1:]
        left, right = max(ceil(min(across)), 0), min(floor(max(across)) + 1, columns)
        top, bottom = max(ceil(min(down)), 0), min(floor(max(down)) + 1, rows)
        if right <= left or bottom <= top:
            return None
        moved = self.source_from_node.copy()
        moved[:, 2] += moved[:, :2] @ [left, top]
        return Nodes(moved, self.positions[:, top:bottom, left:right])

    def blend(self, x: NDArray[np.float32], y: NDArray[np.float32], cover: NDArray[np.float32]) -> None:
        """Let other positions count by a share `cover`; all are of shapes that broadcast to (rows, columns)."""
        for current, other in zip(self.positions, (x, y), strict=True):
            change = other - current
            change *= cover
            current += change


class Patch(Protocol):
    """Part of a warp."""

    def write(self, nodes: Nodes) -> None:
        """Change the positions of the nodes that it covers."""
        ...


PATCH_FADE = 0.1
"""Share of a patch's side over which it gives way to what lies under it."""


def patch_cover(nodes: Nodes, box: NDArray[np.float64]) -> NDArray[np.float32]:
    """How far a patch over a box (4,) counts at each node, 0..1 (rows, columns): it fades in from its sides."""
    left, top, right, bottom = box.astype(np.float32)
    x, y = nodes.places
    across = np.minimum(x - left, right - x) / (np.float32(PATCH_FADE) * (right - left))
    down = np.minimum(y - top, bottom - y) / (np.float32(PATCH_FADE) * (bottom - top))
    return np.asarray(np.minimum(np.clip(across, 0, 1), np.clip(down, 0, 1)))


@dataclass(frozen=True)
class FlowPatch:
    """Flow on a grid over part of the source image.

    Attributes:
        flow: (rows, columns, 2) float32 backward flow in source pixels; the grid's corners are the box's.
        box: (4,) float64 left, top, right, bottom in source pixels.
    """

    flow: Flow
    box: NDArray[np.float64]

    def write(self, nodes: Nodes) -> None:
        """See `Patch.write`."""
        part = nodes.within(self.box)
        if part is not None:
            part.blend(*self.positions(part), patch_cover(part, self.box))

    def positions(self, nodes: Nodes) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Where the nodes look by this flow: x and y, each (rows, columns), source pixels."""
        rows, columns = self.flow.shape[:2]
        spacing = (self.box[2:] - self.box[:2]) / [columns - 1, rows - 1]
        grid_from_node = nodes.source_from_node.copy()
        grid_from_node[:, 2] -= self.box[:2]
        grid_from_node /= spacing[:, None]
        rows, columns = nodes.positions.shape[1:]
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        flow = cv2.warpAffine(self.flow, grid_from_node, (columns, rows), flags=flags, borderMode=cv2.BORDER_REPLICATE)
        x, y = nodes.places
        across, down = cv2.split(flow)
        across += x
        down += y
        return across, down


BORDER_FADE = 0.08
"""Share of the source image's shorter side over which motion fades to none at a border that cuts the face off."""


@dataclass(frozen=True)
class FixedBorder:
    """Holds the border of the source image where it is: what lies beyond was not captured and must not come into view.

    Attributes:
        size: (width, height) of the source image.
    """

    size: tuple[int, int]

    def write(self, nodes: Nodes) -> None:
        """See `Patch.write`."""
        x, y = nodes.places
        inward = np.minimum(np.minimum(x, self.size[0] - x), np.minimum(y, self.size[1] - y))
        nodes.blend(x, y, 1 - smoothstep(inward, 0, BORDER_FADE * min(self.size)))


GRID_STEP = 4
"""Output pixels between computed positions; what lies between is interpolated."""


@dataclass(frozen=True)
class Warp:
    """Where each output pixel looks in the source image: at its affine place, moved by the patches.

    Attributes:
        affine: (2, 3) float64, output pixels → source pixels (centers at integers + ½ in both).
        patches: in the order in which they are written, later ones over earlier ones.
    """

    affine: NDArray[np.float64]
    patches: tuple[Patch, ...]

    def grid(self, box: Box, step: int = GRID_STEP) -> PositionGrid:
        """Where the output pixels of `box` (left, top, right, bottom) look."""
        columns, rows = -(-(box[2] - box[0]) // step) + 2, -(-(box[3] - box[1]) // step) + 2
        node = np.array([[step, 0, box[0] - 0.5 * step], [0, step, box[1] - 0.5 * step], [0, 0, 1]])
        source_from_node = np.asarray(self.affine @ node)
        nodes = Nodes(source_from_node, np.empty((2, rows, columns), np.float32))
        nodes.positions[0], nodes.positions[1] = nodes.places
        for patch in self.patches:
            patch.write(nodes)
        return PositionGrid(np.asarray(cv2.merge(list(nodes.positions)), dtype=np.float32), box, step)
