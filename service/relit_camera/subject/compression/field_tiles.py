"""Reading a reflectance field tile by tile, and splitting the tiles into clusters of neighbouring pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import Mask
from relit_camera.subject.reflectance_field import TEXELS, ReflectanceField

TILE_HEIGHT, TILE_WIDTH = 8, 256
"""Rows and columns of pixels read together: 57 MB of rows at 250 lights."""
CLUSTER_PIXELS = 128
"""Pixels of a cluster, about 8 × 16. Larger clusters need more components, smaller ones more bytes to describe them."""


@dataclass(frozen=True)
class FieldRowReader:
    """Reads rows of the field: a pixel's values under all texels of a light map, then under the captured lights.

    Attributes:
        field: the reflectance field.
        captured: (lights, height, width, 3) the pictures that the field was built from.
    """

    field: ReflectanceField
    captured: NDArray[np.float32]

    def read(self, pixels: NDArray[np.integer]) -> NDArray[np.float32]:
        """Rows (some, 3, 2048 + lights) of ascending row-major pixels (some,)."""
        lights, _, width, _ = self.captured.shape
        rows = np.empty((len(pixels), 3, TEXELS + lights), np.float32)
        # One read for each line of the picture: the pixels between two lines' parts do not belong to the tile.
        for line in np.split(np.arange(len(pixels)), np.flatnonzero(np.diff(pixels // width)) + 1):
            start, stop = int(pixels[line[0]]), int(pixels[line[-1]]) + 1
            rows[line, :, :TEXELS] = self.field.dense(start, stop)[pixels[line] - start].transpose(0, 2, 1)
        rows[:, :, TEXELS:] = self.captured.reshape(lights, -1, 3)[:, pixels].transpose(1, 2, 0)
        return rows


def tiles(matte: Mask) -> list[NDArray[np.int32]]:
    """The pixels where the matte is not 0, tile by tile, as clusters (count, CLUSTER_PIXELS) of row-major indices.

    Where a cluster has fewer pixels, its last one is repeated.
    """
    height, width = matte.shape
    found = []
    for top in range(0, height, TILE_HEIGHT):
        for left in range(0, width, TILE_WIDTH):
            # Column by column: consecutive pixels then lie in a block.
            columns, rows = np.nonzero(matte[top : top + TILE_HEIGHT, left : left + TILE_WIDTH].T > 0)
            if len(rows):
                found.append(_split_into_clusters(((top + rows) * width + left + columns).astype(np.int32)))
    return found


def _split_into_clusters(pixels: NDArray[np.int32]) -> NDArray[np.int32]:
    parts = np.array_split(pixels, -(-len(pixels) // CLUSTER_PIXELS))
    return np.stack([np.pad(part, (0, CLUSTER_PIXELS - len(part)), mode="edge") for part in parts])


def distinct_inside(cluster: NDArray[np.int32], inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mask (CLUSTER_PIXELS,) of a cluster's pixels that are `inside` (pixels,), without repeated ones."""
    repeated = np.zeros(len(cluster), bool)
    repeated[1:] = cluster[1:] == cluster[:-1]
    return inside[cluster] & ~repeated
