"""Eyeballs: gaze direction, and the texture projected onto them along it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from relit_camera.base.array_types import Float64Array
from relit_camera.base.easing import smoothstep
from relit_camera.base.images.color import uint8_from_linear
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.rotations import rotation_from_angles
from relit_studio.people.face.expressions import Expression
from relit_studio.people.face.face_model import CORNEA_MATERIALS, FaceModel, Part
from relit_studio.people.geometry import unit, vertices_of
from relit_studio.people.traits.person_traits import Traits

_WAYS = ("Out", "In", "Down", "Up")

LIMBUS_CM = 0.62
"""Radius of the iris. ICT-FaceKit's eyeballs have a radius of 1.5 cm."""
_PUPIL_CM = 0.21
VIEW_CM = 3.2
"""Width of the texture."""
_SIDE = 1024
_SCLERA = (0.60, 0.525, 0.48)
GAZE_DEG = 30.0
"""Eye rotation at an `eyeLook` weight of 1. The model's shapes move only the lids."""
_EYES = ((Part.EYE_LEFT, CORNEA_MATERIALS[0], "L", 1), (Part.EYE_RIGHT, CORNEA_MATERIALS[1], "R", -1))
"""Part, outer shell, suffix of its expressions, and on which side of the nose it lies."""


@dataclass(frozen=True, eq=False)
class EyeMap:
    """Mapping of the eye texture: texture coordinates (vertices, 2), and distance from the gaze axis (vertices,)."""

    uv: Float64Array
    eccentricity: Float64Array


def eye_map(model: FaceModel, neutral: Float64Array) -> EyeMap:
    """Project the texture onto both eyeballs of a neutral head along each gaze axis."""
    uv, eccentricity = np.zeros((len(neutral), 2)), np.zeros(len(neutral))
    for part, material, _, _ in _EYES:
        eyeball = vertices_of(model.faces[model.face_part == part])
        middle, axis = gaze(neutral[vertices_of(model.faces[model.face_material == material])])
        right = unit(np.cross([0, 1, 0], axis))
        offset = neutral[eyeball] - middle
        across, up, ahead = offset @ right, offset @ np.cross(axis, right), offset @ axis
        eccentricity[eyeball] = np.where(ahead > 0, np.hypot(across, up), (VIEW_CM / 2))
        uv[eyeball] = np.stack([across, up], axis=1) / VIEW_CM + 0.5
    return EyeMap(uv, eccentricity)


def gaze(shell: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Center (3,) and unit gaze axis (3,) of an eyeball's outer shell (n, 3): a fitted sphere, and its cornea."""
    back = shell[shell[:, 2] < np.percentile(shell[:, 2], 60)]
    system = np.column_stack([2 * back, np.ones(len(back))])
    middle = np.linalg.lstsq(system, (back**2).sum(axis=1), rcond=None)[0][:3]
    farthest = np.argsort(-np.linalg.norm(shell - middle, axis=1))[:10]
    return middle, unit(shell[farthest].mean(axis=0) - middle)


def turn_eyes(model: FaceModel, vertices: Float64Array, expression: Expression) -> Float64Array:
    """Vertices (count, 3) of an upright head with the eyeballs turned as the expression's `eyeLook` weights say."""
    moved = vertices.copy()
    for part, material, suffix, side in _EYES:
        outward, inward, down, up = (expression.get(f"eyeLook{way}_{suffix}", 0.0) for way in _WAYS)
        if not (outward or inward or down or up):
            continue
        middle, _ = gaze(vertices[vertices_of(model.faces[model.face_material == material])])
        eyeball = vertices_of(model.faces[model.face_part == part])
        turn = rotation_from_angles(side * GAZE_DEG * (outward - inward), GAZE_DEG * (down - up))
        moved[eyeball] = turn.apply(vertices[eyeball] - middle) + middle
    return moved


def lid_shade(model: FaceModel) -> Float64Array:
    """Darkening 0..1 (vertices,) by the lids, on the shells in front of the eyes."""
    shade = np.zeros(len(model.vertices))
    chosen = np.isin(model.face_part, (Part.OCCLUSION_LEFT, Part.OCCLUSION_RIGHT))
    height = model.uv[model.face_uv[chosen].ravel(), 1]
    shade[model.faces[chosen].ravel()] = np.maximum(smoothstep(height, 0.35, 1.0), 0.6 * smoothstep(height, 0.3, 0.0))
    return shade


def eye_picture(traits: Traits) -> DisplayImage:
    """Sclera with veins, limbal ring, iris fibers and pupil, (1024, 1024, 3) sRGB, 3.2 cm wide."""
    rng = np.random.default_rng(traits.seed + 7)
    place = ((np.arange(_SIDE) + 0.5) / _SIDE * 2 - 1) * (VIEW_CM / 2)
    x, y = np.meshgrid(place, -place)
    radius, angle = np.hypot(x, y), np.arctan2(y, x)
    iris = _iris(traits, radius, angle, rng)
    veins = _veins(rng)[..., None]
    # A full white looks unnatural beside dark skin.
    sclera = np.array(_SCLERA) * min(1.0, traits.skin[1] / 0.25) ** 0.2 * (1 - veins * [0.15, 0.6, 0.6])
    sclera = sclera * (1 - 0.25 * smoothstep(radius, 0.8, 1.5)[..., None] * [0.4, 0.9, 1.0])
    fraction = smoothstep(radius, LIMBUS_CM - 0.06, LIMBUS_CM + 0.07)[..., None]
    return uint8_from_linear((iris.clip(0, 1) * (1 - fraction) + sclera * fraction).astype(np.float32))


def _iris(traits: Traits, radius: Float64Array, angle: Float64Array, rng: np.random.Generator) -> Float64Array:
    around = np.linspace(-np.pi, np.pi, 4096)
    waves = [np.sin(f * around + rng.uniform(0, 6.28)) * rng.uniform(0.5, 1) for f in (9, 17, 31, 57, 93, 140)]
    noise = cv2.GaussianBlur(rng.normal(size=radius.shape), (0, 0), 5) * 9
    fibers = (np.interp(angle + 0.03 * noise, around, np.sum(waves, axis=0)) / 3)[..., None]
    color = np.array(traits.iris) * (1 + 0.38 * fibers + 0.075 * noise[..., None])
    outward = np.clip((radius - _PUPIL_CM) / (LIMBUS_CM - _PUPIL_CM), 0, 1)
    warm = max(traits.iris) * np.array([1.25, 0.75, 0.3])
    ring = 0.55 * np.exp(-(((outward - 0.16) / 0.13) ** 2))[..., None]
    color = color * (1 - ring) + warm * ring * (1 + 0.3 * fibers)
    limbal = 1 - 0.75 * smoothstep(outward, 0.72, 1.0)
    pupil = smoothstep(radius, _PUPIL_CM - 0.012, _PUPIL_CM + 0.02)
    return np.asarray(color * (limbal * pupil)[..., None])


def _veins(rng: np.random.Generator) -> Float64Array:
    canvas = np.zeros((_SIDE, _SIDE), np.float32)
    for _ in range(70):
        angle, radius, drift = rng.uniform(-np.pi, np.pi), 1.5, rng.normal() * 0.2
        points: list[Float64Array] = []
        while radius > rng.uniform(0.75, 1.1) and len(points) < 60:
            offset = radius * np.array([np.cos(angle), -np.sin(angle)])
            points.append((offset + (VIEW_CM / 2)) / VIEW_CM * _SIDE)
            radius -= 0.03
            drift = drift * 0.9 + rng.normal() * 0.05
            angle += drift * 0.12
        strength, width = float(rng.uniform(0.15, 0.5)), int(rng.integers(1, 3))
        cv2.polylines(canvas, [np.array(points, np.int32)], False, strength, width, cv2.LINE_AA)
    return np.asarray(cv2.GaussianBlur(canvas, (0, 0), 1.3), np.float64)
