"""The sampled region of directions: its boundary, and the ring of black samples beyond it (thesis 5.6)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.reflectance.delaunay_triangulation import spherical_delaunay
from relit_camera.capture.reflectance.methods.barycentric_methods import SphericalBarycentric
from relit_camera.capture.reflectance.olat_samples import OlatSamples

RING_DISTANCE_DEG = 25.0
"""Distance of the ring from the region's boundary; the thesis gives no figure. Beyond the ring the field is black."""


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


def ring_directions(directions: NDArray[np.float64], distance_deg: float = RING_DISTANCE_DEG) -> NDArray[np.float64]:
    """Directions of the black ring: unit vectors (count, 3), one beyond each of the lights (lights, 3) on the boundary.

    Each lies `distance_deg` beyond its light on the great circle from the region's center through that light.

    Raises:
        LightsError: the directions span no region.
    """
    edge = directions[boundary_lights(directions)]
    center = directions.sum(axis=0)
    center /= max(float(np.linalg.norm(center)), 1e-12)
    along = edge @ center
    outward = edge * along[:, None] - center
    length = np.linalg.norm(outward, axis=1)
    # Never past the antipode of the center, where all great circles meet.
    distance = np.minimum(np.radians(distance_deg), 0.9 * (np.pi - np.arccos(np.clip(along, -1, 1))))
    ring = edge * np.cos(distance)[:, None] + outward * (np.sin(distance) / np.maximum(length, 1e-12))[:, None]
    # A light at the center itself has no outward direction.
    return np.asarray(ring[length > 1e-6])


def with_black_ring(samples: OlatSamples, distance_deg: float = RING_DISTANCE_DEG) -> OlatSamples:
    """The samples plus black ones on the ring, so that the field fades there instead of ending.

    Estimate `geometry` from the samples without the ring: its black pictures are no shadows.

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
    directions: NDArray[np.float64], queries: NDArray[np.float64], distance_deg: float = RING_DISTANCE_DEG
) -> NDArray[np.float32]:
    """Weight (count,) of a fitted field at queries (count, 3): 1 in the sampled region, 0 beyond the ring.

    Fitted methods mean nothing far from their data; this weight ends them as the black ring ends interpolation.

    Raises:
        LightsError: the directions span no region.
    """
    ringed = np.concatenate([directions, ring_directions(directions, distance_deg)])
    fading = SphericalBarycentric().weights(ringed, queries)[: len(directions)].sum(axis=0)
    # The ring's points may change the triangles at the region's boundary, so the larger of both counts.
    return np.asarray(np.maximum(fading, SphericalBarycentric().weights(directions, queries).sum(axis=0)))
