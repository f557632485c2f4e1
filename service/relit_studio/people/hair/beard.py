"""Beards: hairs rooted on the face mesh, so that they follow jaw and lips."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from relit_camera.base.array_types import Float64Array
from relit_camera.base.easing import smoothstep
from relit_studio.people.face.face_model import FaceModel, Part
from relit_studio.people.geometry import SurfacePoints, areas, find_nearest, scatter, unit, vertex_normals
from relit_studio.people.hair.hair_combing import kept_out
from relit_studio.people.hair.hair_strands import Hairs
from relit_studio.people.hair.scalp import Obstacle
from relit_studio.people.skin.skin_texture import lips
from relit_studio.people.traits.person_traits import BeardStyle

_POINTS = 7
_CHEEK = np.array([[0, 2.3, 3.1, 4.4, 5.6, 6.4, 7.0, 7.5], [-1.45, -1.6, -2.9, -2.9, -1.9, -0.4, 1.6, 3.4]])
"""Upper edge of the cheek beard on the mean head: distance from the middle, and height there, centimeters."""
_NECK_CM = -8.9
_LOCK = 14
"""Hairs in a lock."""


class _Style(NamedTuple):
    hairs: int
    moustache_cm: float
    chin_cm: float
    cheek_cm: float
    radius_cm: float


_STYLES: dict[BeardStyle, _Style] = {
    "stubble": _Style(15_000, 0.14, 0.16, 0.14, 0.0042),
    "moustache": _Style(2_600, 0.7, 0.0, 0.0, 0.0058),
    "goatee": _Style(6_000, 0.65, 1.3, 0.0, 0.0058),
    "full": _Style(17_000, 0.7, 1.9, 1.0, 0.0058),
}


@dataclass(frozen=True, eq=False)
class _Roots:
    """Hair roots on the mesh, with density 0..1 (n,) and hair length (n,)."""

    surface: SurfacePoints
    density: Float64Array
    length_cm: Float64Array


def grow_beard(
    model: FaceModel, neutral: Float64Array, vertices: Float64Array, seed: int, style: BeardStyle
) -> Hairs | None:
    """A beard rooted on the `neutral` head, posed on the head with `vertices` in any expression."""
    if style == "none":
        return None
    kind, rng = _STYLES[style], np.random.default_rng(seed + 400)
    triangles = model.triangles(Part.FACE, Part.HEAD)
    roots = _scatter_roots(model, neutral, triangles, kind, rng)
    place, normals = roots.surface.interpolate(vertices), vertex_normals(vertices, triangles)
    hairs = _hairs(
        roots, roots.surface.interpolate(neutral), place, unit(roots.surface.interpolate(normals)), kind, rng
    )
    skin = np.unique(triangles)
    obstacle = Obstacle(vertices[skin], normals[skin], cKDTree(vertices[skin]))
    # Hairs over the hollow below the lip would enter the chin. Roots stay in place.
    outside = kept_out(hairs.points[:, 1:], obstacle)
    return hairs._replace(points=np.concatenate([hairs.points[:, :1], outside], axis=1))


def beard_area(model: FaceModel) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Density 0..1 (vertices,) of mustache, chin beard and whiskers."""
    mean = model.vertices
    x, y, z = np.abs(mean[:, 0]), mean[:, 1], mean[:, 2]
    skin = (model.vertex_part <= Part.HEAD) * (1 - lips(mean, mean[model.landmarks68[48:60], :2]))
    skin = skin * smoothstep(z, 2.6, 3.8)
    below = smoothstep(np.interp(x, *_CHEEK) - y, -0.25, 0.55)
    neck = smoothstep(y + 0.3 * (z - 7), _NECK_CM - 0.6, _NECK_CM + 0.8)
    upper = smoothstep(y, -3.8, -3.2) * smoothstep(x, 3.1, 2.4) * smoothstep(y, -1.3, -1.7) * (z > 8.5)
    # Fewer hairs grow on the philtrum and at the corners under the lower lip.
    upper = upper * (1 - 0.35 * np.exp(-((x / 0.18) ** 2)))
    bare = np.exp(-(((x - 1.35) / 0.6) ** 2) - ((y + 4.95) / 0.45) ** 2)
    middle = smoothstep(x, 3.0, 2.3) * smoothstep(y, -3.4, -4.2) * (z > 6)
    chin = middle * neck * (1 - 0.75 * bare)
    beside = smoothstep(x, 2.2, 2.9) * smoothstep(y, -2.0, -3.0)
    whiskers = below * neck * np.maximum(smoothstep(x, 2.3, 3.2), beside) * (1 - middle)
    return skin * upper, skin * chin, skin * whiskers


def _scatter_roots(
    model: FaceModel, neutral: Float64Array, triangles: np.ndarray, kind: _Style, rng: np.random.Generator
) -> _Roots:
    areas_of = np.stack(beard_area(model), axis=1) * (np.array(kind[1:4]) > 0)
    thickness = areas_of.max(axis=1)
    lengths = (areas_of * kind[1:4]).sum(axis=1) / np.maximum(areas_of.sum(axis=1), 1e-6)
    # The mustache's strip is narrow, and its hairs lie side by side.
    crowded = np.maximum(thickness, 2.6 * areas_of[:, 0])
    surface = scatter(triangles, areas(neutral, triangles) * crowded[triangles].mean(axis=1), kind.hairs, rng)
    return _Roots(surface, surface.interpolate(thickness), surface.interpolate(lengths))


def _hairs(
    roots: _Roots, rest: Float64Array, place: Float64Array, normal: Float64Array, kind: _Style, rng: np.random.Generator
) -> Hairs:
    """Hairs with roots at `place` and skin normals `normal`; `rest` are the roots on the neutral face."""
    count = len(place)
    aside = np.sign(rest[:, 0]) * smoothstep(np.abs(rest[:, 0]), 0.05, 0.6)
    moustache = smoothstep(rest[:, 1], -4.2, -3.4) * (rest[:, 2] > 8)
    down = np.stack([aside * (0.15 + 0.5 * moustache), -1 + 0.2 * moustache, 0.12 * (1 - moustache)], axis=1)
    along = unit(down - (down * normal).sum(axis=1, keepdims=True) * normal)
    direction = unit(along + 0.42 * normal + 0.22 * rng.normal(size=(count, 3)))
    length = roots.length_cm * rng.uniform(0.55, 1.1, count) * (0.35 + 0.65 * roots.density)
    t = np.linspace(0, 1, _POINTS)[:, None]
    hang = np.array([0, -0.35, 0.05]) - 0.30 * normal
    wave = 0.05 * rng.normal(size=(count, 1, 3)) * np.sin(5 * t + 6.28 * rng.random((count, 1, 3)))
    offset = direction[:, None] * t + hang[:, None] * t**2 + wave * t
    guides = rng.choice(count, max(1, count // _LOCK), replace=False)
    _, nearest = find_nearest(cKDTree(rest[guides]), rest)
    guide = guides[nearest]
    tips = (offset * length[:, None, None])[guide] + 0.25 * (place[guide] - place)[:, None] * t
    points = place[:, None] + offset * length[:, None, None] * (1 - 0.5 * t) + 0.5 * t * tips
    thick = kind.radius_cm * rng.uniform(0.75, 1.15, (count, 1)) * np.linspace(1, 0.4, _POINTS)
    shade = 0.6 * rng.normal(size=count) + 0.4 * rng.normal(size=count)[guide]
    return Hairs(points, thick, shade)
