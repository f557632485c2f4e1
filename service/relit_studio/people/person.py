"""A person: everything about them that does not depend on the posture, and what follows from a posture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relit_camera.base.array_types import Float64Array
from relit_studio.people.clothing.glasses import Glasses, fit_glasses
from relit_studio.people.clothing.shirt import Shirt, sew_shirt
from relit_studio.people.face.expressions import Expression
from relit_studio.people.face.eyes import turn_eyes
from relit_studio.people.face.face_model import FaceModel, Part
from relit_studio.people.face.identity import neutral_face
from relit_studio.people.hair.beard import grow_beard
from relit_studio.people.hair.brows import grow_brows
from relit_studio.people.hair.hair_strands import Hairs
from relit_studio.people.hair.head_hair import FLATTENS_EARS, grow_hair
from relit_studio.people.hair.lashes import grow_lashes
from relit_studio.people.hair.scalp import ears
from relit_studio.people.people_assets import PeopleAssets
from relit_studio.people.posture import Posture, follows_head, rigid_motion, turned
from relit_studio.people.traits.person_traits import Traits

_SHIRT_HAIR_CM = -10.5
"""Height below which cloth is an obstacle for long hair."""


@dataclass(frozen=True, eq=False)
class Person:
    """A person.

    Attributes:
        traits: who it is.
        people_assets: what all people share.
        neutral: (vertices, 3) the face model's vertices for this identity, upright, expression 0.
        hair: on the upright head.
        shirt: what they wear; it stands still.
        glasses: on the upright head, with which they go, or None.
    """

    traits: Traits
    people_assets: PeopleAssets
    neutral: Float64Array
    hair: Hairs
    shirt: Shirt
    glasses: Glasses | None = None

    @property
    def model(self) -> FaceModel:
        """The face model."""
        return self.people_assets.model

    def face(self, expression: Expression) -> Float64Array:
        """Vertices (count, 3) of the upright head in an expression."""
        return turn_eyes(self.model, self.neutral + self.model.displacement(expression), expression)

    def vertices(self, posture: Posture) -> Float64Array:
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

    def head_motion(self, posture: Posture) -> Float64Array:
        """Rigid motion (4, 4) of hair and glasses with the head in this posture."""
        return rigid_motion(posture.rotation)

    def hair_points(self, posture: Posture) -> Float64Array:
        """Points of hair that reaches the shoulders, in room axes; its lower part does not turn with the head."""
        flat = self.hair.points.reshape(-1, 3)
        moved = turned(flat, posture.rotation, follows_head(flat))
        return moved.reshape(self.hair.points.shape)


def make_person(traits: Traits, people_assets: PeopleAssets) -> Person:
    """Build a person. It takes some seconds, most of them for the hair."""
    model = people_assets.model
    neutral = neutral_face(model, traits)
    if traits.hair in FLATTENS_EARS:
        # Ears lie flat under long hair.
        beyond = np.clip(np.abs(neutral[:, 0]) - 7.1, 0, None)
        neutral[:, 0] -= np.sign(model.vertices[:, 0]) * ears(model) * beyond * 0.75
    skin = model.triangles(Part.FACE, Part.HEAD)
    shirt = sew_shirt(people_assets.body, people_assets.body_triangles, neutral, skin, traits.neckline)
    hair = grow_hair(model, neutral, shirt.cloth[shirt.cloth[:, 1] < _SHIRT_HAIR_CM], traits)
    glasses = None if traits.glasses is None else fit_glasses(model, neutral, traits.glasses)
    return Person(traits, people_assets, neutral, hair, shirt, glasses)


def _turned_hairs(hairs: Hairs, posture: Posture) -> Hairs:
    flat = hairs.points.reshape(-1, 3)
    return Hairs(turned(flat, posture.rotation).reshape(hairs.points.shape), hairs.radius, hairs.shade)
