"""A mug and two arms as objects for Cycles, and their motion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from relit_camera.base.array_types import Float64Array
from relit_camera.base.rotations import AnyRotation, rotation_from_angles
from relit_studio.cycles.job import Material, Mesh
from relit_studio.people.person import Person
from relit_studio.people.posture import Posture, turned
from relit_studio.people.props.hand import GRIP_WRIST, gripping_hand, open_hand
from relit_studio.people.props.mug import RIM, throw_mug
from relit_studio.people.props.sleeve import sew_sleeve
from relit_studio.people.props.solids import Solid

_LIPS68 = (51, 62, 66, 57)
"""The middle of the lips, above and below, outside and inside."""
_MUG_LOW, _HAND_LOW = np.array([-11.0, -34.0, 5.0]), np.array([16.0, -34.0, 2.0])
"""Offsets from the raised positions of mug and hand to positions below the picture."""
_HAND_WRIST, _HAND_LEAN_DEG = np.array([5.0, -10.5, 19.0]), 24.0
"""Wrist of the open hand in front of the face, and how far the hand leans to the picture's left."""
_ELBOWS = np.array([[-26.0, -36.0, 2.0], [27.0, -42.0, 4.0]])
"""Positions of the elbows: of the right arm, at the picture's left, and of the left arm."""
_GLAZE = (0.03, 0.16, 0.17)
"""Linear albedo of the mug."""
_REDDER = (1.0, 0.9, 0.87)
"""Tint of the hands, which are redder than the mean of the face."""


@dataclass(frozen=True)
class Gesture:
    """Positions of mug and hands.

    Attributes:
        mug: how far the right hand has raised it: 0 below the picture, 1 at the mouth.
        tilt_deg: of the mug, toward the mouth.
        hand: how far the left hand is raised: 0 below the picture, 1 before the face.
        across_cm: where it is then, right of the face's middle.
    """

    mug: float = 0.0
    tilt_deg: float = 0.0
    hand: float = 0.0
    across_cm: float = 0.0


class HeldObjects:
    """Hands and mug of one person."""

    def __init__(self, person: Person) -> None:
        """Prepare them for `person`: skin, sleeves and position of the mouth."""
        self._person = person
        self._lips = person.face({})[person.model.landmarks68[list(_LIPS68)]].mean(axis=0)

    @cached_property
    def solids(self) -> dict[str, Solid]:
        """Each object's surface, by name, in its own axes."""
        body, handle = throw_mug()
        sleeve = sew_sleeve()
        return {
            "mug": body,
            "mug_handle": handle,
            "right_hand": gripping_hand(),
            "right_sleeve": sleeve,
            "left_hand": open_hand(),
            "left_sleeve": sleeve,
        }

    def objects(self) -> tuple[Mesh, ...]:
        """Objects for Cycles, made of `materials` and the person's own cloth."""
        cloths = {"mug": "glaze", "mug_handle": "glaze", "right_sleeve": "cloth", "left_sleeve": "cloth"}
        return tuple(
            Mesh(name, solid.vertices, solid.faces, np.zeros(len(solid.faces)), (cloths.get(name, "hand"),))
            for name, solid in self.solids.items()
        )

    def materials(self) -> dict[str, Material]:
        """Materials of the objects, by name."""
        return {
            "hand": {
                "kind": "plain",
                "colour": [fraction * tint for fraction, tint in zip(self._person.traits.skin, _REDDER, strict=True)],
                "roughness": 0.5,
                "scattering": 1.0,
            },
            "glaze": {"kind": "plain", "colour": list(_GLAZE), "roughness": 0.12},
        }

    def motions(self, posture: Posture, gesture: Gesture) -> dict[str, Float64Array]:
        """Rigid motions (4, 4) from each object's axes to room axes, by name."""
        lips = turned(self._lips[None], posture.rotation)[0]
        tilt = rotation_from_angles(0, -gesture.tilt_deg)
        mug = _motion(tilt, lips + (1 - gesture.mug) * _MUG_LOW - tilt.apply(RIM))
        lean = rotation_from_angles(0, 0, _HAND_LEAN_DEG)
        hand = _motion(lean, _HAND_WRIST + [gesture.across_cm, 0, 0] + (1 - gesture.hand) * _HAND_LOW)
        wrists = mug[:3, :3] @ GRIP_WRIST + mug[:3, 3], hand[:3, 3]
        right, left = (_along(wrist, elbow) for wrist, elbow in zip(wrists, _ELBOWS, strict=True))
        return {
            "mug": mug,
            "mug_handle": mug,
            "right_hand": mug,
            "right_sleeve": right,
            "left_hand": hand,
            "left_sleeve": left,
        }


def _along(wrist: Float64Array, elbow: Float64Array) -> Float64Array:
    """The motion of a sleeve from wrist toward elbow."""
    return _motion(Rotation.align_vectors([elbow - wrist], [[0.0, 1.0, 0.0]])[0], wrist)


def _motion(rotation: AnyRotation, offset: ArrayLike) -> Float64Array:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation.as_matrix(), offset
    return matrix
