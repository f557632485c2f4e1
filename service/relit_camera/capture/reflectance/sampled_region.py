"""The thesis's extension beyond the sampled region: black samples round it (thesis 5.6, its final approach)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.reflectance.barycentric_methods import SphericalBarycentric
from relit_camera.capture.reflectance.delaunay_triangulation import spherical_delaunay
from relit_camera.capture.reflectance.samples import Samples

DISTANCE_DEG = 25.0
"""How far outside of the region the ring lies; the thesis gives no figure. Beyond it the field is black."""


def boundary_lights(directions: NDArray[np.float64]) -> NDArray[np.intp]:
    """Indices (count,) of the lights on the edge of the sampled region; none where they surround the whole sphere.

    Raises:
        LightsError: the directions (lights, 3) span no region.
    """
    triangles = spherical_delaunay(directions)
    sides = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    # A side of the edge belongs to one triangle only.
    different, count = np.unique(sides, axis=0, return_counts=True)
    return np.unique(different[count == 1])


def ring_directions(directions: NDArray[np.float64], distance_deg: float = DISTANCE_DEG) -> NDArray[np.float64]:
    """Where the ring's samples lie: unit vectors (count, 3), one beyond each of `boundary_lights`'s lights (lights, 3).

    Each lies on the great circle from the region's middle through its light, `distance_deg` farther out.

    Raises:
        LightsError: the directions span no region.
    """
    edge = directions[boundary_lights(directions)]
    middle = directions.sum(axis=0)
    middle /= max(float(np.linalg.norm(middle)), 1e-12)
    along = edge @ middle
    outward = edge * along[:, None] - middle
    length = np.linalg.norm(outward, axis=1)
    # None past the pole opposite to the middle, where all ways meet.
    distance = np.minimum(np.radians(distance_deg), 0.9 * (np.pi - np.arccos(np.clip(along, -1, 1))))
    ring = edge * np.cos(distance)[:, None] + outward * (np.sin(distance) / np.maximum(length, 1e-12))[:, None]
    # A light in the middle itself has no way out.
    return np.asarray(ring[length > 1e-6])


def with_black_ring(samples: Samples, distance_deg: float = DISTANCE_DEG) -> Samples:
    """The samples with the black ring: there the field fades instead of ending.

    What is to use the person's shape must know it before: the ring's pictures are no shadows.

    Raises:
        LightsError: the directions span no region.
    """
    ring = ring_directions(samples.directions, distance_deg)
    black = np.zeros((len(ring), *samples.pictures.shape[1:]), np.float32)
    return replace(
        samples,
        pictures=np.concatenate([samples.pictures, black]),
        directions=np.concatenate([samples.directions, ring]),
    )


def region_coverage(
    directions: NDArray[np.float64], queries: NDArray[np.float64], distance_deg: float = DISTANCE_DEG
) -> NDArray[np.float32]:
    """1 for queries (count, 3) in the region of the lights (lights, 3), falling to 0 over the ring: (count,).

    Fitted methods are worth nothing far from their data; this ends them as the black ring ends interpolation.

    Raises:
        LightsError: the directions span no region.
    """
    ringed = np.concatenate([directions, ring_directions(directions, distance_deg)])
    fading = SphericalBarycentric().weights(ringed, queries)[: len(directions)].sum(axis=0)
    # With the ring's points, triangles at the region's edge may be others than without.
    return np.asarray(np.maximum(fading, SphericalBarycentric().weights(directions, queries).sum(axis=0)))
