"""Accessories of a person as Cycles objects: beard, glasses, collar."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_studio.cycles.job import Material, Mesh, Shape, Strands
from relit_studio.people.person import Person
from relit_studio.people.posture import Posture

_LINEN = [0.62, 0.63, 0.65]


def extra_objects(person: Person) -> list[Mesh | Strands]:
    """Objects of the person's accessories, upright and neutral."""
    objects: list[Mesh | Strands] = []
    if (beard := person.beard(Posture())) is not None:
        objects.append(Strands("beard", *beard, "beard"))
    if (glasses := person.glasses) is not None:
        objects += [
            _plain("frame", glasses.frame, glasses.frame_faces),
            _plain("lenses", glasses.lenses, glasses.lens_faces),
        ]
    if (under := person.shirt.under) is not None:
        objects.append(_plain("under", *under))
    return objects


def extra_shape(person: Person, posture: Posture) -> Shape:
    """Geometry of the accessories that changes for a posture."""
    shape: dict[str, NDArray] = {}
    if (beard := person.beard(posture)) is not None:
        shape["beard.points"] = beard.points
    if person.glasses is not None:
        shape |= {f"{name}.matrix": person.head_motion(posture) for name in ("frame", "lenses")}
    return shape


def extra_materials(person: Person) -> dict[str, Material]:
    """Materials of the accessories by name."""
    traits, materials = person.traits, dict[str, Material]()
    if traits.beard != "none":
        materials["beard"] = {
            "kind": "hair",
            "melanin": 0.92 * traits.melanin,
            "redness": min(1.0, traits.redness + 0.1),
            "roughness": 0.4,
            "grey": traits.grey,
        }
    if (glasses := traits.glasses) is not None:
        materials["frame"] = {
            "kind": "plain",
            "colour": list(glasses.colour),
            "roughness": 0.22 if glasses.metal else 0.3,
            "metallic": float(glasses.metal),
        }
        materials["lenses"] = {"kind": "lens"}
    if traits.neckline == "collar":
        materials["under"] = {"kind": "cloth", "colour": _LINEN}
    return materials


def _plain(name: str, vertices: NDArray, faces: NDArray) -> Mesh:
    """Mesh with one material of the same name."""
    return Mesh(name, vertices, faces, np.zeros(len(faces)), (name,), subdivision=1)
