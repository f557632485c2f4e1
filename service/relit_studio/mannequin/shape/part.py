"""A part of the mannequin at rest: mesh, color and gloss."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from relit_camera.base.array_types import Float64Array
from relit_studio.mannequin.shape.mesh import Triangles, grid_triangles
from relit_studio.mannequin.shape.texture_atlas import PLAIN


@dataclass(frozen=True)
class Gloss:
    """Gloss of a surface: Blinn-Phong reflectance toward the viewer, and exponent."""

    shine: float
    exponent: float


SKIN = Gloss(0.03, 12)
HAIR = Gloss(0.035, 22)
CLOTH = Gloss(0.01, 6)
EYE = Gloss(0.03, 160)
TOOTH = Gloss(0.03, 40)


@dataclass(frozen=True, eq=False)
class Part:
    """A mesh with its surface.

    Attributes:
        name: unique in the figure.
        vertices: (count, 3) centimeters.
        triangles: indices into them.
        casters: fewer triangles over the same vertices, enough to cast shadows.
        color: (count, 3) linear albedo, multiplied by the paint.
        paint: (count, 2) position in the paint atlas, pixels.
        finish: how it shines.
    """

    name: str
    vertices: Float64Array
    triangles: Triangles
    casters: Triangles
    color: Float64Array
    paint: Float64Array
    finish: Gloss


def grid_part(
    name: str,
    vertices: Float64Array,
    color: ArrayLike,
    finish: Gloss,
    *,
    closed: bool = False,
    mirrored: bool = False,
    paint: Float64Array | None = None,
    caster_step: int = 2,
) -> Part:
    """A part of a grid of vertices (rows, columns, 3), as `grid_triangles` joins them.

    Args:
        name: of the part.
        vertices: rows run down and columns right, seen from outside; `mirrored` left.
        color: one (3,), or one a vertex (rows, columns, 3).
        finish: how it shines.
        closed: joins the last column to the first.
        mirrored: columns run to the left.
        paint: (rows, columns, 2) position in the atlas; without, plain white.
        caster_step: shadows are cast by every so many vertices.
    """
    rows, columns = vertices.shape[:2]
    triangles, casters = (grid_triangles(rows, columns, closed=closed, step=step) for step in (1, caster_step))
    position = np.broadcast_to(np.array(PLAIN), (rows, columns, 2)) if paint is None else paint
    return Part(
        name=name,
        vertices=vertices.reshape(-1, 3),
        triangles=triangles[:, ::-1] if mirrored else triangles,
        casters=casters[:, ::-1] if mirrored else casters,
        color=np.broadcast_to(np.asarray(color, np.float64), vertices.shape).reshape(-1, 3),
        paint=position.reshape(-1, 2),
        finish=finish,
    )
