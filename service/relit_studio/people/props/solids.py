"""Closed surfaces: solids of revolution, and smooth unions of round cones by signed distance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import logsumexp

from relit_camera.base.array_types import Float64Array
from relit_studio.people.geometry import triangles_of

_MARGIN_CM = 1.0
"""Margin around a shape when its surface is extracted."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A closed surface.

    Attributes:
        vertices: (n, 3) centimeters.
        faces: (m, 4) int, counter-clockwise from outside, -1 in the last column of a triangle.
    """

    vertices: Float64Array
    faces: NDArray[np.int64]

    @property
    def triangles(self) -> NDArray[np.intp]:
        """Triangles (k, 3)."""
        return triangles_of(self.faces)


def revolve(profile: ArrayLike, segments: int = 48) -> Solid:
    """Solid of revolution of a profile (points, 2) of radius and height about the Y axis, where it begins and ends.

    Seen with the axis at its left, the profile runs with the solid at its left: from the bottom up outside.
    """
    radius, height = np.asarray(profile, np.float64)[1:-1].T
    around = 2 * np.pi * np.arange(segments) / segments
    rings = np.stack(
        [
            radius[:, None] * np.sin(around),
            np.broadcast_to(height[:, None], (len(height), segments)),
            radius[:, None] * np.cos(around),
        ],
        axis=-1,
    )
    ends = [(0.0, float(np.asarray(profile)[end][1]), 0.0) for end in (0, -1)]
    vertices = np.concatenate([rings.reshape(-1, 3), ends])
    index = np.arange(len(radius) * segments).reshape(len(radius), segments)
    beside = np.roll(index, -1, axis=1)
    sides = np.stack([index[:-1], beside[:-1], beside[1:], index[1:]], axis=-1).reshape(-1, 4)
    none = np.full(segments, -1)
    bottom = np.stack([np.full(segments, index.size), beside[0], index[0], none], axis=-1)
    top = np.stack([np.full(segments, index.size + 1), index[-1], beside[-1], none], axis=-1)
    return Solid(vertices, np.concatenate([sides, bottom, top]))


@dataclass(frozen=True, eq=False)
class Blob:
    """Implicit shape: round cones along polylines, joined with soft creases.

    Attributes:
        chains: each (points, 4): center and radius of the spheres that its cones join.
        crease_cm: how wide the creases are between chains.
    """

    chains: tuple[Float64Array, ...]
    crease_cm: float

    def distance(self, points: Float64Array) -> Float64Array:
        """Approximate signed distance (n,) of points (n, 3); negative inside."""
        nearest = [_distance_of_chain(points, chain) for chain in self.chains]
        return np.asarray(-self.crease_cm * logsumexp(-np.array(nearest) / self.crease_cm, axis=0))

    @property
    def bounds(self) -> tuple[Float64Array, Float64Array]:
        """Lowest and highest corner, with a margin."""
        spheres = np.concatenate(self.chains)
        reach = spheres[:, 3:] + _MARGIN_CM
        return (spheres[:, :3] - reach).min(axis=0), (spheres[:, :3] + reach).max(axis=0)


def union_surface(blobs: Sequence[Blob], crease_cm: float, step_cm: float) -> Solid:
    """Surface of the smooth union of several shapes, extracted on a grid with cells of `step_cm`."""
    bounds = [blob.bounds for blob in blobs]
    low, high = np.min([each[0] for each in bounds], axis=0), np.max([each[1] for each in bounds], axis=0)
    axes = [np.arange(start, end + step_cm, step_cm) for start, end in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    shape = points.shape[:3]
    nearest = np.array([blob.distance(points.reshape(-1, 3)) for blob in blobs])
    field = -crease_cm * logsumexp(-nearest / crease_cm, axis=0)
    vertices, faces = surface_nets(field.reshape(shape))
    return Solid(low + step_cm * vertices, faces)


def surface_nets(field: Float64Array) -> tuple[Float64Array, NDArray[np.int64]]:
    """Zero surface of a field (i, j, k) that is positive at the border: vertices (n, 3) in grid units, quads (m, 4).

    Naive surface nets (Gibson 1998): each cell that the surface cuts has one vertex, the mean of the cuts of its edges,
    and each edge that it cuts is crossed by the quad of the four cells about it.
    """
    inside = field < 0
    cells = tuple(size - 1 for size in field.shape)
    total, count = np.zeros((*cells, 3)), np.zeros(cells)
    corners = np.moveaxis(np.indices(cells, np.float64), 0, -1)
    crossings = []
    for axis in range(3):
        along = np.eye(3, dtype=int)[axis]
        first, second = _shifted(field, (0, 0, 0), along), _shifted(field, tuple(along), along)
        cut = (first < 0) != (second < 0)
        fraction = np.where(cut, first / np.where(cut, first - second, 1), 0)
        crossings.append(cut)
        # The edge belongs to the four cells that share it.
        others = [other for other in range(3) if other != axis]
        for near in ((0, 0), (0, 1), (1, 0), (1, 1)):
            offset = np.zeros(3, int)
            offset[others] = near
            window = tuple(slice(shift, shift + size) for shift, size in zip(offset, cells, strict=True))
            total += cut[window][..., None] * (corners + offset + fraction[window][..., None] * along)
            count += cut[window]
    used = count > 0
    number = np.full(cells, -1)
    number[used] = np.arange(int(used.sum()))
    vertices = total[used] / count[used][:, None]
    quads = []
    for axis, cut in enumerate(crossings):
        place = np.argwhere(cut)
        first, second = (np.eye(3, dtype=int)[(axis + turn) % 3] for turn in (1, 2))
        around = [place - first - second, place - second, place, place - first]
        quad = np.stack([number[tuple(cell.T)] for cell in around], axis=1)
        leaving = inside[tuple(place.T)]
        quads.append(np.where(leaving[:, None], quad, quad[:, ::-1]))
    return vertices, np.concatenate(quads).astype(np.int64)


def _shifted(field: Float64Array, start: tuple[int, ...], along: NDArray[np.int_]) -> Float64Array:
    """The ends of the edges along one axis: the field without its last plane there, or without its first."""
    return field[tuple(slice(at, at + size - step) for at, size, step in zip(start, field.shape, along, strict=True))]


def _distance_of_chain(points: Float64Array, chain: Float64Array) -> Float64Array:
    distances = []
    for (*start, wide), (*end, narrow) in pairwise(chain):
        axis, offset = np.subtract(end, start), points - start
        fraction = np.clip(offset @ axis / (axis @ axis), 0, 1)
        apart = np.linalg.norm(offset - fraction[:, None] * axis, axis=1)
        distances.append(apart - (wide + fraction * (narrow - wide)))
    return np.asarray(np.min(distances, axis=0))
