"""Stills of the small generated person: the source image in another light, said to show another expression."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import uint8_from_linear
from relit_camera.base.rotations import Rotation, rotation_from_angles
from relit_camera.light.directions import texel_directions
from relit_camera.light.light_map import LightMap
from relit_camera.subject.expression_stills import ExpressionStill
from relit_camera.subject.relighting.basis_relighter import BasisRelighter
from relit_camera.subject.relighting.relighter import RelighterOptions
from relit_camera.subject.subject import Subject
from tests.live.people import SCHEME, close_up, face_of

LOWER = sorted({*SCHEME.lower_lip_inner[1:-1], *SCHEME.lower_lip_outer[1:-1]})


def expression(open_cm: float = 0.0, shut: float = 0.0) -> NDArray[np.float32]:
    """Centimetres since neutral: the lower lip let down, and upper lids brought down to the lower ones."""
    moved = np.zeros((SCHEME.count, 3), np.float32)
    moved[LOWER, 1] -= open_cm
    for eye in (SCHEME.right_eye, SCHEME.left_eye):
        inner = eye.lids.index(eye.inner)
        for upper, lower in zip(eye.lids[1:inner], eye.lids[:inner:-1], strict=True):
            moved[upper] = shut * (SCHEME.canonical[lower] - SCHEME.canonical[upper])
    return moved


def soft_light(toward: tuple[float, float, float] = (0.3, 0.3, 1.0), color: float = 1.0) -> LightMap:
    """Light from about one direction."""
    cosine = texel_directions() @ (np.array(toward) / np.linalg.norm(toward))
    return np.repeat((0.1 + np.exp(4 * (cosine - 1)))[..., None] * 0.4 * color, 3, axis=2).astype(np.float32)


def relit(subject: Subject, light: LightMap) -> NDArray[np.float32]:
    """The source image in a light, linear."""
    return BasisRelighter(subject, RelighterOptions()).relight(light[None])[0]


def still(
    light: LightMap, moved: NDArray[np.float32], turn: Rotation | None = None, exposure: float = 1.0
) -> ExpressionStill:
    """A still whose picture is the source image in `light`, said to have moved."""
    subject = close_up()
    picture = uint8_from_linear((relit(subject, light) * np.float32(exposure)).astype(np.float32))
    rotation = (turn or Rotation.identity()).as_rotvec().astype(np.float32)
    return ExpressionStill(picture, face_of(subject).landmarks, moved, rotation, light)


def with_stills(*stills: ExpressionStill) -> Subject:
    """The person with some stills; without any given, with an open mouth, shut eyes, and turned to both sides."""
    light = soft_light()
    made = stills or (
        still(light, expression(open_cm=1.0)),
        still(light, expression(shut=1.0)),
        still(light, expression(), rotation_from_angles(25)),
        still(light, expression(), rotation_from_angles(-25)),
    )
    return replace(close_up(), stills=made)
