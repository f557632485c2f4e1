"""Scalp: where hair grows, and the surface that it must not enter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from relit_camera.base.array_types import Float64Array, Indices
from relit_camera.base.easing import smoothstep
from relit_studio.people.face.face_model import FaceModel, Part
from relit_studio.people.geometry import SurfacePoints, areas, find_nearest, scatter, unit, vertex_normals
from relit_studio.people.traits.person_traits import HairStyle

_HAIRLINE = np.array(
    [
        [0, 18, 32, 45, 56, 64, 71, 76, 84, 98, 106, 116, 140, 180],
        [10.4, 10.7, 10.3, 8.4, 6.2, 3.4, 2.4, 3.9, 4.4, 3.9, 1.2, -1.5, -4.2, -4.6],
    ]
)
"""Height of the hairline on the mean head over the azimuth from the front, degrees and centimeters."""


def scalp(model: FaceModel, style: HairStyle = "short") -> Float64Array:
    """Density 0..1 (vertices,) of hair growth."""
    mean = model.vertices
    azimuth = np.degrees(np.arctan2(np.abs(mean[:, 0]), mean[:, 2]))
    above = mean[:, 1] - np.interp(azimuth, *_HAIRLINE)
    grown = smoothstep(above, -0.25, 0.75) * (model.vertex_part <= Part.HEAD) * (mean[:, 1] > -6)
    return grown * _left(mean, style)


def _left(mean: Float64Array, style: HairStyle) -> Float64Array:
    """Share 0..1 (vertices,) of the hair that has not fallen out."""
    x, y, z = np.abs(mean[:, 0]), mean[:, 1], mean[:, 2]
    if style == "receding":
        corners = np.exp(-(((x - 4.6) / 2.0) ** 2)) * smoothstep(z, 0.5, 4.0) * smoothstep(y, 8.0, 9.5)
        front = smoothstep(z, 5.2, 6.8) * smoothstep(y, 8.0, 9.5)
        return (1 - np.clip(1.3 * corners, 0, 1)) * (1 - 0.9 * front)
    if style == "bald":
        return np.asarray(1 - smoothstep(y + 0.1 * z, 6.2, 8.2))
    return np.ones(len(mean))


def ears(model: FaceModel) -> Float64Array:
    """Membership 0..1 (vertices,) of the ears."""
    x, y, z = np.abs(model.vertices[:, 0]), model.vertices[:, 1], model.vertices[:, 2]
    height = smoothstep(y, -3.2, -1.8) * smoothstep(y, 4.3, 3.2)
    return smoothstep(x, 7.2, 7.9) * height * smoothstep(z, -2.4, -1) * smoothstep(z, 3.4, 2.2)


@dataclass(frozen=True, eq=False)
class Roots:
    """Hair roots on the scalp.

    Attributes:
        place, normal: (n, 3).
        density: (n,) 0 at the hairline to 1 inside.
    """

    place: Float64Array
    normal: Float64Array
    density: Float64Array


@dataclass(frozen=True, eq=False)
class Obstacle:
    """Surface that hair must not enter, as points and their outward normals, (n, 3) each."""

    points: Float64Array
    normals: Float64Array
    tree: cKDTree

    def nearest(self, places: Float64Array) -> tuple[Float64Array, Float64Array]:
        """Nearest point and its normal, (n, 3) each."""
        _, index = find_nearest(self.tree, places)
        return self.points[index], self.normals[index]


def place_roots(model: FaceModel, head: Float64Array, count: int, rng: np.random.Generator, style: HairStyle) -> Roots:
    """`count` roots on the scalp of a head (vertices, 3)."""
    triangles = model.triangles(Part.FACE, Part.HEAD)
    mask = scalp(model, style)
    density = areas(head, triangles) * mask[triangles].mean(axis=1) ** 1.5
    surface: SurfacePoints = scatter(triangles, density, count, rng)
    normals = vertex_normals(head, triangles)
    return Roots(surface.interpolate(head), unit(surface.interpolate(normals)), surface.interpolate(mask))


def head_and_body(model: FaceModel, head: Float64Array, body: Float64Array) -> Obstacle:
    """Obstacle of the head's skin and the clothes' points (n, 3), whose normals slope like a hill."""
    triangles: Indices = model.triangles(Part.FACE, Part.HEAD)
    skin = np.unique(triangles)
    slope = unit(body * [0.3, 0, 0.3] + [0, 8, 1])
    points = np.concatenate([head[skin], body])
    return Obstacle(points, np.concatenate([vertex_normals(head, triangles)[skin], slope]), cKDTree(points))
