"""A field read in tiles, and the tiles cut into clusters of neighbouring pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.space.images import Mask
from relit_camera.subject.field import TEXELS, ReflectanceField

TILE_HEIGHT, TILE_WIDTH = 8, 256
"""Pixels read together: 57 MB of rows at 250 lights."""
PLACES = 128
"""Pixels of a cluster, about 8 × 16. Larger ones need more components, smaller ones spend more on describing them."""


@dataclass(frozen=True)
class FieldRows:
    """What pixels answer to all texels of a light map and, after them, to the captured lights.

    Attributes:
        field: the field.
        captured: (lights, height, width, 3) the pictures that it was built from.
    """

    field: ReflectanceField
    captured: NDArray[np.float32]

    def read(self, pixels: NDArray[np.integer]) -> NDArray[np.float32]:
        """Rows (some, 3, 2048 + lights) of ascending row-major pixels (some,)."""
        lights, _, width, _ = self.captured.shape
        rows = np.empty((len(pixels), 3, TEXELS + lights), np.float32)
        # Only what lies in one line of the picture is read in one go: what is between lines is no neighbour.
        for line in np.split(np.arange(len(pixels)), np.flatnonzero(np.diff(pixels // width)) + 1):
            start, stop = int(pixels[line[0]]), int(pixels[line[-1]]) + 1
            rows[line, :, :TEXELS] = self.field.dense(start, stop)[pixels[line] - start].transpose(0, 2, 1)
        rows[:, :, TEXELS:] = self.captured.reshape(lights, -1, 3)[:, pixels].transpose(1, 2, 0)
        return rows


def tiles(matte: Mask) -> list[NDArray[np.int32]]:
    """The pixels where the matte is not 0, tile by tile, as clusters (count, PLACES) of row-major indices.

    Where a cluster has fewer pixels, its last one is repeated.
    """
    height, width = matte.shape
    found = []
    for top in range(0, height, TILE_HEIGHT):
        for left in range(0, width, TILE_WIDTH):
            # Column by column: consecutive pixels then lie in a block.
            columns, rows = np.nonzero(matte[top : top + TILE_HEIGHT, left : left + TILE_WIDTH].T > 0)
            if len(rows):
                found.append(_cut(((top + rows) * width + left + columns).astype(np.int32)))
    return found


def _cut(pixels: NDArray[np.int32]) -> NDArray[np.int32]:
    parts = np.array_split(pixels, -(-len(pixels) // PLACES))
    return np.stack([np.pad(part, (0, PLACES - len(part)), mode="edge") for part in parts])


def counted_places(cluster: NDArray[np.int32], inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which places (PLACES,) of a cluster count: pixels inside, given for all (pixels,), and no repeated ones."""
    again = np.zeros(len(cluster), bool)
    again[1:] = cluster[1:] == cluster[:-1]
    return inside[cluster] & ~again
