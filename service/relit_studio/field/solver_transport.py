"""Diffuse light transport between the vertices of a mesh, as a sparse matrix of form factors.

Bundles of parallel rays (Szirmay-Kalos 1998): the whole mesh is rasterized along a direction with all layers kept, and
neighboring layers of a pixel that face each other exchange light. A bundle serves all surfaces at once, and what one
end sends the other receives, so that light is neither made nor lost.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from relit_camera.light.directions import fibonacci_directions
from relit_studio.mannequin.rendering.rasterizer import fragments
from relit_studio.mannequin.rendering.shading import axes_along
from relit_studio.mannequin.shape.mesh import Triangles

Values = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Transport:
    """Diffuse exchange of light between vertices.

    Attributes:
        form_factors: (vertices, vertices) float32: fraction of vertex i's cosine-weighted hemisphere that the surface
            at vertex j fills. Rows sum to 1 - sky - (fraction of back faces).
        sky: (vertices,) float32, the fraction that is open.
    """

    form_factors: sparse.csr_array
    sky: Values

    def gather(self, sent: Values) -> Values:
        """Light (vertices, k) that vertices receive when they send out `sent` (vertices, k), in white-wall units."""
        return np.asarray(self.form_factors @ sent, np.float32)


def transport(vertices: Values, triangles: Triangles, directions: int, size: int) -> Transport:
    """Trace `directions` bundles over the hemisphere, each of size x size rays, through `triangles` (count, 3).

    Every line is followed both ways, so that half the sphere of directions is all of them.
    """
    count = len(vertices)
    both_sides = np.concatenate([triangles, triangles[:, ::-1]])
    receivers: list[NDArray[np.int64]] = []
    senders: list[NDArray[np.int64]] = []
    open_ends, heard = np.zeros(count), np.zeros(count)
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    reach = float(np.linalg.norm(vertices - middle, axis=1).max()) * 1.001
    for direction in fibonacci_directions(2 * directions)[:directions]:
        seen = (vertices - middle) @ axes_along(direction).T
        seen[:, :2] = (seen[:, :2] + reach) * (size / (2 * reach))
        vertex, upward, pixel = _layers(seen, both_sides, len(triangles), size)
        # Sorted from below within each pixel: light goes from a layer that faces up to the next if that faces down.
        above_same = np.append(pixel[1:] == pixel[:-1], False)
        meets = above_same & upward & np.append(~upward[1:], False)
        low, high = vertex[meets.nonzero()[0]], vertex[meets.nonzero()[0] + 1]
        receivers += [low, high]
        senders += [high, low]
        highest = upward & ~above_same
        lowest = ~upward & np.append(True, pixel[1:] != pixel[:-1])
        open_ends += np.bincount(vertex[highest | lowest], minlength=count)
        heard += np.bincount(vertex, minlength=count)
    fraction = 1 / np.maximum(heard, 1)
    rows, columns = np.concatenate(receivers), np.concatenate(senders)
    seen_by = sparse.coo_array((fraction[rows].astype(np.float32), (rows, columns)), shape=(count, count)).tocsr()
    return Transport(seen_by, np.asarray(open_ends * fraction, np.float32))


def bounce_light(light: Values, albedo: Values, between: Transport, bounces: int) -> Values:
    """Light (vertices, lights, 3) that vertices receive from each other after up to `bounces` reflections.

    Args:
        light: (vertices, lights) direct irradiance.
        albedo: (vertices, 3).
        between: who sees whom.
        bounces: how many reflections on the way to the receiver are followed.
    """
    count, lights = light.shape
    first = (light[..., None] * albedo[:, None]).reshape(count, -1)
    received = np.zeros_like(first)
    for _ in range(bounces):
        sent = first + (received.reshape(count, lights, 3) * albedo[:, None]).reshape(count, -1)
        received = between.gather(sent)
    return received.reshape(count, lights, 3)


def _layers(
    seen: Values, both_sides: Triangles, fronts: int, size: int
) -> tuple[NDArray[np.int64], NDArray[np.bool_], NDArray[np.int64]]:
    """All surfaces at all pixels, sorted by pixel and then by depth, lowest first.

    Returns:
        The nearest corner's vertex, whether the surface faces up along the bundle, and the pixel; each (count,).
    """
    pixels, depths, corners, upward = [], [], [], []
    for pixel, depth, index, weight in fragments(seen, both_sides, size, size):
        whole = np.concatenate([weight, 1 - weight.sum(axis=1, keepdims=True)], axis=1)
        corners.append(both_sides[index, whole.argmax(axis=1)])
        pixels.append(pixel)
        depths.append(depth)
        upward.append(index < fronts)
    pixel, depth = np.concatenate(pixels), np.concatenate(depths)
    order = np.lexsort((depth, pixel))
    return np.concatenate(corners)[order], np.concatenate(upward)[order], pixel[order]
