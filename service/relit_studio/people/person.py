"""A person put together: everything about them that does not move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relit_studio.people.beard import grow_beard
from relit_studio.people.brows import grow_brows
from relit_studio.people.expressions import Expression
from relit_studio.people.eyes import turn_eyes
from relit_studio.people.face_model import FaceModel, Part
from relit_studio.people.geometry import Floats
from relit_studio.people.glasses import Glasses, fit_glasses
from relit_studio.people.hair import FLATTENS_EARS, grow_hair
from relit_studio.people.hairs import Hairs
from relit_studio.people.identity import neutral_face
from relit_studio.people.lashes import grow_lashes
from relit_studio.people.posture import Posture, follows_head, rigid_motion, turned
from relit_studio.people.scalp import ears
from relit_studio.people.shirt import Shirt, sew_shirt
from relit_studio.people.traits import Traits
from relit_studio.people.wardrobe import Wardrobe

_SHIRT_HAIR_CM = -10.5
"""Cloth below this keeps long hair out."""


@dataclass(frozen=True, eq=False)
class Person:
    """A person.

    Attributes:
        traits: who it is.
        wardrobe: what all people share.
        neutral: (vertices, 3) the face model's vertices for this identity, upright, expression 0.
        hair: on the upright head.
        shirt: what they wear; it stands still.
        glasses: on the upright head, with which they go, or None.
    """

    traits: Traits
    wardrobe: Wardrobe
    neutral: Floats
    hair: Hairs
    shirt: Shirt
    glasses: Glasses | None = None

    @property
    def model(self) -> FaceModel:
        """The face model."""
        return self.wardrobe.model

    def face(self, expression: Expression) -> Floats:
        """Vertices (count, 3) of the upright head in an expression."""
        return turn_eyes(self.model, self.neutral + self.model.displacement(expression), expression)

    def vertices(self, posture: Posture) -> Floats:
        """Vertices (count, 3) in room axes; those of the head move rigidly, the neck's in part."""
        return turned(self.face(posture.expression), posture.rotation, follows_head(self.neutral))

    def brows(self, posture: Posture) -> Hairs:
        """Brows in room axes."""
        face, traits = self.face(posture.expression), self.traits
        return _turned_hairs(grow_brows(self.model, self.neutral, face, traits.seed, traits.brows), posture)

    def beard(self, posture: Posture) -> Hairs | None:
        """The beard in room axes, if there is one."""
        face, traits = self.face(posture.expression), self.traits
        grown = grow_beard(self.model, self.neutral, face, traits.seed, traits.beard)
        return None if grown is None else _turned_hairs(grown, posture)

    def lashes(self, posture: Posture) -> Hairs:
        """Lashes in room axes."""
        face = self.face(posture.expression)
        return _turned_hairs(grow_lashes(self.model, face, self.traits.seed, self.traits.lashes), posture)

    def head_motion(self, posture: Posture) -> Floats:
        """A matrix (4, 4) that takes what goes with the head, hair and glasses, to where it is in this posture."""
        return rigid_motion(posture.rotation)

    def hair_points(self, posture: Posture) -> Floats:
        """`hair` in room axes where it hangs down to the shoulders, which do not turn."""
        flat = self.hair.points.reshape(-1, 3)
        moved = turned(flat, posture.rotation, follows_head(flat))
        return moved.reshape(self.hair.points.shape)


def make_person(traits: Traits, wardrobe: Wardrobe) -> Person:
    """Build a person; some seconds, most of them for the hair."""
    model = wardrobe.model
    neutral = neutral_face(model, traits)
    if traits.hair in FLATTENS_EARS:
        # Ears lie flat under long hair.
        beyond = np.clip(np.abs(neutral[:, 0]) - 7.1, 0, None)
        neutral[:, 0] -= np.sign(model.vertices[:, 0]) * ears(model) * beyond * 0.75
    skin = model.triangles(Part.FACE, Part.HEAD)
    shirt = sew_shirt(wardrobe.body, wardrobe.body_triangles, neutral, skin, traits.neckline)
    hair = grow_hair(model, neutral, shirt.cloth[shirt.cloth[:, 1] < _SHIRT_HAIR_CM], traits)
    glasses = None if traits.glasses is None else fit_glasses(model, neutral, traits.glasses)
    return Person(traits, wardrobe, neutral, hair, shirt, glasses)


def _turned_hairs(hairs: Hairs, posture: Posture) -> Hairs:
    flat = hairs.points.reshape(-1, 3)
    return Hairs(turned(flat, posture.rotation).reshape(hairs.points.shape), hairs.radius, hairs.shade)
