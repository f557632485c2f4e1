"""Input of the transport solver: surfaces with their reflectance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_studio.mannequin.shape.figure import Posture, mannequin
from relit_studio.mannequin.shape.mesh import Triangles

Values = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Surfaces:
    """A mesh to be lit, in the camera's axes, centimeters.

    Attributes:
        vertices, normals: (count, 3) float32; unit normals.
        triangles: counter-clockwise from outside.
        casters: fewer triangles over the same vertices, which throw shadows and exchange light.
        albedo: (count, 3) float32 linear diffuse reflectance.
        f0: (count,) float32 Fresnel reflectance at normal incidence; 0 has no gloss at all.
        alpha: (count,) float32 GGX width, roughness squared.
    """

    vertices: Values
    normals: Values
    triangles: Triangles
    casters: Triangles
    albedo: Values
    f0: Values
    alpha: Values


def mannequin_surfaces(place: NDArray) -> Surfaces:
    """The neutral mannequin with its head's origin at `place` (3,) in camera axes."""
    figure = mannequin()
    vertices = figure.vertices(Posture())
    return Surfaces(
        vertices=vertices + np.asarray(place, np.float32),
        normals=figure.normals(vertices),
        triangles=figure.triangles,
        casters=figure.casters,
        albedo=figure.albedo(figure.color, figure.paint),
        f0=figure.shine,
        # The GGX lobe as wide as the mannequin's Blinn-Phong lobe (Walter et al. 2007): α² = 2 / (n + 2).
        alpha=np.sqrt(2 / (figure.exponent + 2)).astype(np.float32),
    )
