"""Landmarks of the service's schemes on a person's mesh."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from relit_camera.base.array_types import Float64Array
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_studio.people.face.eyes import LIMBUS_CM, VIEW_CM, eye_map
from relit_studio.people.face.face_model import CORNEA_MATERIALS, FaceModel, Part
from relit_studio.people.face.mesh478_points import IBUG_66, mesh_points, nearest_on_surface
from relit_studio.people.geometry import SurfacePoints, triangles_of
from relit_studio.people.person import Person
from relit_studio.people.posture import Posture

_IRIS_RING = np.array([[0, 0], [1, 0], [0, 1], [-1, 0], [0, -1]])
"""Iris points in radii: center, picture right, upper, picture left, lower."""


def landmarks(person: Person, posture: Posture) -> Mapping[str, Float64Array]:
    """Points (count, 3) in room axes by scheme.

    openseeface66 are the face model's own iBUG points; see `mesh478` for the others.
    """
    vertices = person.vertices(posture)
    model = person.model
    irises = [points.interpolate(vertices) for points in _irises(person)]
    return {
        "mesh478": np.concatenate([mesh_points(model).interpolate(vertices), *irises]),
        "openseeface66": vertices[model.landmarks68[IBUG_66]],
    }


def canonical_origin(model: FaceModel) -> tuple[Float64Array, float]:
    """Origin (3,) of the canonical face in the mean head's axes, and its unit in the model's centimeters.

    They are the least-squares scale and shift. Rotation is left out, so that an upright head has the identity pose.
    """
    source = landmark_scheme("openseeface66").canonical
    target = model.vertices[model.landmarks68[IBUG_66]]
    spread = source - source.mean(axis=0)
    scale = float((spread * (target - target.mean(axis=0))).sum() / (spread**2).sum())
    return target.mean(axis=0) - scale * source.mean(axis=0), scale


def _irises(person: Person) -> tuple[SurfacePoints, SurfacePoints]:
    """Center and limbus of the subject's right and left eye, on the eyeballs' outer shells."""
    model = person.model
    laid = eye_map(model, person.neutral)
    plane = np.column_stack([laid.uv, np.zeros(len(laid.uv))])
    # Texture coordinates run along the eye's own right, which is the picture's.
    ring = np.column_stack([_IRIS_RING * LIMBUS_CM / VIEW_CM + 0.5, np.zeros(5)])
    found = []
    for part, material in ((Part.EYE_RIGHT, CORNEA_MATERIALS[1]), (Part.EYE_LEFT, CORNEA_MATERIALS[0])):
        shell = triangles_of(model.faces[(model.face_part == part) & (model.face_material == material)])
        front = shell[(laid.eccentricity[shell] < 1.2).all(axis=1)]
        found.append(nearest_on_surface(ring, plane, front))
    return found[0], found[1]
