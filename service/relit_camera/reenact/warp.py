"""A dense warp: an affine view of the still with a smooth flow inside it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.space.images import Flow

Box = tuple[int, int, int, int]

FADE = 0.1
"""Share of a patch's side over which it gives way to what lies under it."""


@dataclass(frozen=True)
class FlowPatch:
    """Flow on a grid.

    Attributes:
        flow: (rows, columns, 2) float32 backward flow in still pixels; the grid's corners are the region's.
        region: (4,) float64 left, top, right, bottom in still pixels.
    """

    flow: Flow
    region: NDArray[np.float64]


@dataclass(frozen=True)
class Warp:
    """Where each output pixel looks in the still: u = affine(x), then u + flow(u).

    Attributes:
        affine: (2, 3) float64, output pixels → still pixels (centres at integers + ½ in both).
        patches: the first covers the head and fades to 0 outside; later ones refine it where motion is fine.
    """

    affine: NDArray[np.float64]
    patches: tuple[FlowPatch, ...]

    def map(self, box: Box, enlarged: int = 1, step: int = 1) -> NDArray[np.float32]:
        """Positions (height, width, 2) for cv2.remap, for the output pixels of `box` (left, top, right, bottom).

        Args:
            box: in output pixels.
            enlarged: by how much the still to be sampled is larger than the one that the warp was made for.
            step: compute every `step`-th position and interpolate: the flow's grids are coarser still.
        """
        width, height = box[2] - box[0], box[3] - box[1]
        columns, rows = -(-width // step), -(-height // step)
        # cv2 counts pixel centres as integers: x_ours = x_cv + ½ on either side.
        first = box[0] + 0.5 * step, box[1] + 0.5 * step
        still_from_pixel = self.affine @ np.array([[step, 0, first[0]], [0, step, first[1]], [0, 0, 1]])
        flow = np.zeros((rows, columns, 2), dtype=np.float32)
        for patch in self.patches:
            _paste(flow, patch, still_from_pixel)
        a = still_from_pixel.astype(np.float32)
        flow += (a[:, 0] * np.arange(columns, dtype=np.float32)[:, None] + a[:, 2])[None]
        flow += (a[:, 1] * np.arange(rows, dtype=np.float32)[:, None])[:, None]
        flow *= np.float32(enlarged)
        flow -= np.float32(0.5)
        if step > 1:
            size = (columns * step, rows * step)
            flow = cv2.resize(flow, size, interpolation=cv2.INTER_LINEAR)[:height, :width]
        return np.asarray(flow, dtype=np.float32)

    def apply(self, still: NDArray[np.float32], box: Box, enlarged: int = 1, step: int = 1) -> NDArray[np.float32]:
        """The still (height, width, channels ≤ 4) float32 as seen at the output pixels of `box`; 0 beyond its edges."""
        positions = self.map(box, enlarged, step)
        view = cv2.remap(still, positions, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
        return np.asarray(view, dtype=np.float32)


def _paste(flow: NDArray[np.float32], patch: FlowPatch, still_from_pixel: NDArray[np.float64]) -> None:
    """Blend a patch into the flow of a box of output pixels, in place."""
    rows, columns = patch.flow.shape[:2]
    spacing = (patch.region[2:] - patch.region[:2]) / [columns - 1, rows - 1]
    grid_from_still = np.array([[1 / spacing[0], 0, 0], [0, 1 / spacing[1], 0], [0, 0, 1]])
    grid_from_still[:2, 2] = -patch.region[:2] / spacing
    grid_from_pixel = grid_from_still @ np.vstack([still_from_pixel, [0, 0, 1]])
    corners = np.array([[0, 0, 1], [columns - 1, 0, 1], [0, rows - 1, 1], [columns - 1, rows - 1, 1]], dtype=float)
    seen = (corners @ np.linalg.inv(grid_from_pixel).T)[:, :2]
    left, top = np.maximum(np.floor(seen.min(axis=0)).astype(int), 0)
    right, bottom = np.minimum(np.ceil(seen.max(axis=0)).astype(int) + 1, flow.shape[1::-1])
    if right <= left or bottom <= top:
        return
    local = (grid_from_pixel @ np.array([[1, 0, left], [0, 1, top], [0, 0, 1]]))[:2]
    edges = [np.clip(np.minimum(np.arange(n), np.arange(n)[::-1]) / (FADE * n), 0, 1) for n in (rows, columns)]
    cover = np.minimum.outer(*edges).astype(np.float32)
    stacked = np.dstack([patch.flow * cover[..., None], cover])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    pasted = cv2.warpAffine(stacked, local, (int(right - left), int(bottom - top)), flags=flags)
    area = flow[top:bottom, left:right]
    area *= 1 - pasted[..., 2:]
    area += pasted[..., :2]
