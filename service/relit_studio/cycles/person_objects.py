"""A person as Cycles objects: meshes, strands and materials, and their geometry in each posture."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float64Array
from relit_camera.base.images.image_files import write_display
from relit_camera.base.storage.atomic_files import make_folder
from relit_studio.base.assets.store import cache_folder
from relit_studio.cycles.accessory_objects import extra_materials, extra_objects, extra_shape
from relit_studio.cycles.job import Material, Mesh, Scene, Shape, Strands
from relit_studio.people.face.eyes import LIMBUS_CM, eye_map, eye_picture, lid_shade
from relit_studio.people.face.face_model import CORNEA_MATERIALS, Part
from relit_studio.people.geometry import vertices_of
from relit_studio.people.hair.head_hair import HANGING
from relit_studio.people.hair.scalp import scalp
from relit_studio.people.person import Person
from relit_studio.people.posture import Posture
from relit_studio.people.skin.skin_texture import folds_picture, lips, oil, skin_picture
from relit_studio.people.traits.person_traits import Traits

_SKIN = (Part.FACE, Part.HEAD, Part.MOUTH, Part.SOCKET_LEFT, Part.SOCKET_RIGHT)
_PARTS: dict[str, tuple[Part, ...]] = {
    "head": _SKIN,
    "eyes": (Part.EYE_LEFT, Part.EYE_RIGHT),
    "tears": (Part.TEAR_LEFT, Part.TEAR_RIGHT),
    "lid_shade": (Part.OCCLUSION_LEFT, Part.OCCLUSION_RIGHT),
    "teeth": (Part.GUMS, Part.TEETH),
}
"""Objects that are parts of the face model."""


class Figure:
    """Cycles objects of one person."""

    def __init__(self, person: Person) -> None:
        """Prepare the objects of `person`."""
        self.person = person
        self._model = person.model
        self._chosen = {name: np.isin(self._model.face_part, parts) for name, parts in _PARTS.items()}
        self._chosen["head"] &= ~person.shirt.covered[self._model.faces].all(axis=1)
        self._used = {name: vertices_of(self._model.faces[chosen]) for name, chosen in self._chosen.items()}

    def scene(self) -> Scene:
        """Scene of the person, upright and neutral; writes its textures into the cache.

        Raises:
            StorageError: the cache cannot be written.
        """
        posture = Posture()
        vertices = self.person.vertices(posture)
        part, material = self._model.face_part, self._model.face_material
        mean, landmarks = self._model.vertices, self._model.landmarks68
        on_lips = lips(mean, mean[landmarks[48:60], :2])
        oily = oil(mean) * (1 - on_lips)
        eyes = eye_map(self._model, self.person.neutral)
        skin_slots = np.where(part <= Part.HEAD, 0, np.where(part == Part.MOUTH, 1, 2))
        meshes = (
            self._mesh("head", vertices, skin_slots, ("skin", "mouth", "socket"), self.person.people_assets.uv,
                       {"lips": on_lips, "oil": oily, "scalp": scalp(self._model, self.person.traits.hair)}),
            self._mesh("eyes", vertices, np.isin(material, CORNEA_MATERIALS), ("iris", "cornea"), eyes.uv,
                       {"eccentricity": eyes.eccentricity}),
            self._mesh("tears", vertices, np.zeros(len(part)), ("wet",)),
            self._mesh("lid_shade", vertices, np.zeros(len(part)), ("lid_shade",), None,
                       {"edge": lid_shade(self._model)}),
            # Each tooth is a mesh of its own, which subdivision would shrink: gaps.
            self._mesh("teeth", vertices, part == Part.TEETH, ("gums", "teeth"), subdivision=0),
        )  # fmt: skip
        shirt, brows, lashes = self.person.shirt, self.person.brows(posture), self.person.lashes(posture)
        clothes = (
            Mesh("shirt", shirt.cloth, shirt.cloth_faces, np.zeros(len(shirt.cloth_faces)), ("cloth",), subdivision=2),
            Mesh(
                "collar", shirt.collar, shirt.collar_faces, np.zeros(len(shirt.collar_faces)), ("cloth",), subdivision=1
            ),
        )
        strands = (
            Strands("hair", *self.person.hair, "hair"),
            Strands("brows", *brows, "brow"),
            Strands("lashes", *lashes, "lash"),
        )
        return Scene((*meshes, *clothes, *strands, *extra_objects(self.person)), self._materials())

    def shape(self, posture: Posture) -> Shape:
        """Geometry that changes for a posture."""
        vertices = self.person.vertices(posture)
        moved = {f"{name}.vertices": vertices[used] for name, used in self._used.items()}
        if self.person.traits.hair in HANGING:
            hair: dict[str, NDArray] = {"hair.points": self.person.hair_points(posture)}
        else:
            hair = {"hair.matrix": self.person.head_motion(posture)}
        return {
            **moved,
            **hair,
            "brows.points": self.person.brows(posture).points,
            "lashes.points": self.person.lashes(posture).points,
            **extra_shape(self.person, posture),
        }

    def _mesh(
        self,
        name: str,
        vertices: Float64Array,
        slots: NDArray,
        materials: tuple[str, ...],
        uv: Float64Array | None = None,
        attributes: dict[str, Float64Array] | None = None,
        subdivision: int = 1,
    ) -> Mesh:
        """A part of the face model with the vertices that it uses; arrays are given for the whole model."""
        chosen, used = self._chosen[name], self._used[name]
        place = np.full(len(vertices) + 1, -1)
        place[used] = np.arange(len(used))
        return Mesh(
            name=name,
            vertices=vertices[used],
            # Index -1, a triangle's fourth corner, picks the last entry, which is -1.
            faces=place[self._model.faces[chosen]],
            slots=np.asarray(slots)[chosen],
            materials=materials,
            uv=None if uv is None else uv[used],
            attributes={key: values[used] for key, values in (attributes or {}).items()},
            subdivision=subdivision,
        )

    def _materials(self) -> dict[str, Material]:
        traits = self.person.traits
        skin, eye = str(self._pictures / "skin.png"), str(self._pictures / "eye.png")
        return {
            "skin": {
                "kind": "skin",
                "albedo": skin,
                "pores": str(self.person.people_assets.folder / "pores.png"),
                "scalp_shade": _scalp_shade(traits),
                "relief": traits.relief,
                "gloss": traits.gloss,
                "folds": str(self._pictures / "folds.png") if traits.age else "",
                "age": traits.age,
            },
            "mouth": {"kind": "plain", "colour": [0.28, 0.06, 0.05], "roughness": 0.35, "scattering": 0.6},
            "socket": {"kind": "plain", "colour": [0.5, 0.2, 0.16], "roughness": 0.4},
            "iris": {"kind": "iris", "picture": eye},
            "cornea": {"kind": "cornea", "picture": eye, "limbus_cm": LIMBUS_CM},
            "wet": {"kind": "wet"},
            "lid_shade": {"kind": "lid_shade", "colour": [0.5, 0.39, 0.36]},
            "gums": {"kind": "plain", "colour": [0.42, 0.12, 0.11], "roughness": 0.25, "scattering": 0.5},
            "teeth": {"kind": "plain", "colour": [0.66, 0.565, 0.42], "roughness": 0.2, "scattering": 0.4},
            "cloth": {"kind": "cloth", "colour": list(traits.shirt)},
            "hair": {"kind": "hair", "melanin": traits.melanin, "redness": traits.redness, "grey": traits.grey},
            "brow": {
                "kind": "hair",
                "melanin": min(1.0, traits.melanin - 0.03),
                "redness": traits.redness,
                "roughness": 0.45,
                "grey": 0.5 * traits.grey,
            },
            "lash": {"kind": "hair", "melanin": 1.0, "redness": 0.1, "roughness": 0.4},
            **extra_materials(self.person),
        }

    @cached_property
    def _pictures(self) -> Path:
        traits = self.person.traits
        folder = cache_folder() / "people" / traits.name
        make_folder(folder)
        write_display(folder / "skin.png", skin_picture(self.person.people_assets.albedo(traits.shaved), traits))
        write_display(folder / "eye.png", eye_picture(traits))
        if traits.age:
            write_display(folder / "folds.png", np.repeat(folds_picture(traits)[..., None], 3, axis=2))
        return folder


def _scalp_shade(traits: Traits) -> float:
    """Darkening of the scalp relative to other skin, weaker for pale hair."""
    pale = min(1.0, traits.melanin / 0.6) * (1 - 0.6 * traits.grey)
    return (0.8 if traits.hair == "buzz" else 0.55) * pale
