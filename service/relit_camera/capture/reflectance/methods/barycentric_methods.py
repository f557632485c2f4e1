"""Barycentric interpolation between the three captured lights around a direction (thesis 5.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, QhullError

from relit_camera.capture.reflectance.delaunay_triangulation import (
    TOLERANCE,
    degenerate_directions_error,
    find_triangles,
)
from relit_camera.capture.reflectance.method_registry import factored_field
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.light.directions import spherical_from_direction
from relit_camera.subject.measured_light import MAX_GAP_DEG
from relit_camera.subject.reflectance_field import FactoredField


@dataclass(frozen=True)
class SphericalBarycentric:
    """Method `barycentric`: weights by areas of sub-triangles on the sphere (Langer et al. 2006)."""

    max_gap_deg: float = MAX_GAP_DEG

    def build(self, samples: OlatSamples) -> FactoredField:
        """The field; see `ReflectanceMethod.build`."""
        return factored_field(self, samples)

    def weights(self, directions: NDArray[np.float64], queries: NDArray[np.float64]) -> NDArray[np.float32]:
        """Weights (lights, queries); see `LinearMethod.weights`."""
        found = find_triangles(directions, queries, self.max_gap_deg)
        weights = np.zeros((len(directions), len(queries)), dtype=np.float32)
        np.add.at(weights, (found.corners.T, found.covered[None, :]), found.weights.T)
        return weights


@dataclass(frozen=True)
class PlanarBarycentric:
    """Method `planar`: triangles and weights in the plane of azimuth and elevation, the thesis's first variant.

    As in the thesis no triangle crosses the seam behind the subject.
    """

    def build(self, samples: OlatSamples) -> FactoredField:
        """The field; see `ReflectanceMethod.build`."""
        return factored_field(self, samples)

    def weights(self, directions: NDArray[np.float64], queries: NDArray[np.float64]) -> NDArray[np.float32]:
        """Weights (lights, queries); see `LinearMethod.weights`."""
        plane = np.stack(spherical_from_direction(directions), axis=1)
        try:
            triangulation = Delaunay(plane)
        except (QhullError, ValueError) as error:
            raise degenerate_directions_error(len(directions)) from error
        points = np.stack(spherical_from_direction(queries), axis=1)
        # Not `find_simplex`: its tolerance is relative to each triangle's size, not an angle. The triangles are
        # counter-clockwise, so a point inside lies to the left of every side.
        corners = plane[triangulation.simplices]
        sides = np.roll(corners, -1, axis=1) - corners
        lengths = np.linalg.norm(sides, axis=2)
        offsets = points[:, None, None] - corners
        doubled_areas = sides[..., 0] * offsets[..., 1] - sides[..., 1] * offsets[..., 0]
        inside = (doubled_areas / lengths).min(axis=2)
        chosen = inside.argmax(axis=1)
        covered = np.flatnonzero(inside[np.arange(len(queries)), chosen] >= -TOLERANCE)
        # A corner's weight is the area between the point and the side opposite to it, which starts at the next corner.
        local = np.maximum(np.roll(doubled_areas[covered, chosen[covered]], -1, axis=1), 0)
        local /= np.maximum(local.sum(axis=1, keepdims=True), 1e-300)
        weights = np.zeros((len(directions), len(queries)), dtype=np.float32)
        vertices = triangulation.simplices[chosen[covered]]
        np.add.at(weights, (vertices.T, covered[None, :]), local.T.astype(np.float32))
        return weights
