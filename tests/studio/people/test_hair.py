"""Hair and beards against the head that they grow on."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest
from scipy.spatial import cKDTree

from relit_studio.people.face.face_model import Part
from relit_studio.people.face.mesh478_points import nearest_on_surface
from relit_studio.people.geometry import vertex_normals
from relit_studio.people.hair.beard import grow_beard
from relit_studio.people.hair.head_hair import grow_hair
from relit_studio.people.person import Person
from relit_studio.people.traits.person_traits import BeardStyle, HairStyle, Traits

NOTHING = np.zeros((0, 3))
BEARDS = [style for style in get_args(BeardStyle) if style != "none"]


def distance_outside(person: Person, points: np.ndarray) -> np.ndarray:
    """Centimeters (n,) of points (n, 3) before the head's nearest vertex, along its normal; less than 0 is inside."""
    triangles = person.model.triangles(Part.FACE, Part.HEAD)
    skin = np.unique(triangles)
    normals = vertex_normals(person.neutral, triangles)[skin]
    _, nearest = cKDTree(person.neutral[skin]).query(points)
    return np.asarray(((points - person.neutral[skin][nearest]) * normals[nearest]).sum(axis=1))


@pytest.mark.slow
@pytest.mark.parametrize("style", get_args(HairStyle))
def test_hair_stays_out_of_the_head_and_the_face(person: Person, style: HairStyle) -> None:
    hair = grow_hair(person.model, person.neutral, NOTHING, Traits("x", 4, hair=style), fraction=0.08)
    again = grow_hair(person.model, person.neutral, NOTHING, Traits("x", 4, hair=style), fraction=0.08)
    np.testing.assert_array_equal(hair.points, again.points)
    assert np.isfinite(hair.points).all()
    assert (hair.radius > 0).all()
    points = hair.points[:, ::2].reshape(-1, 3)
    assert (distance_outside(person, points) < -0.4).mean() < 0.004
    brows, chin = person.neutral[person.model.landmarks68[[19, 8]], 1]
    face = (np.abs(points[:, 0]) < 4) & (points[:, 2] > 7.5) & (points[:, 1] < brows) & (points[:, 1] > chin)
    assert face.mean() < 0.001
    throat = (np.abs(points[:, 0]) < 2.5) & (points[:, 2] > 3) & (points[:, 1] < chin)
    assert throat.mean() < 0.002


def test_the_bald_are_bare_on_top_and_the_receding_at_the_temples(person: Person) -> None:
    def roots(style: HairStyle) -> np.ndarray:
        grown = grow_hair(person.model, person.neutral, NOTHING, Traits("x", 4, hair=style), fraction=0.1)
        return grown.points[:, 0]

    full, bald, receding = roots("short"), roots("bald"), roots("receding")
    top = full[:, 1].max()
    assert bald[:, 1].max() < top - 4
    assert (np.abs(bald[:, 0]) > 5).any()
    assert receding[:, 1].max() > top - 0.5
    assert np.percentile(receding[:, 2], 99) < np.percentile(full[:, 2], 99) - 1


@pytest.mark.parametrize("style", BEARDS)
def test_beards_stand_on_the_skin_beside_the_lips(person: Person, style: BeardStyle) -> None:
    model = person.model
    beard = grow_beard(model, person.neutral, person.neutral, 4, style)
    assert beard is not None
    roots = beard.points[::11, 0]
    surface = nearest_on_surface(roots, person.neutral, model.triangles(Part.FACE, Part.HEAD)).interpolate(
        person.neutral
    )
    assert np.linalg.norm(roots - surface, axis=1).max() < 1e-6
    lips = person.neutral[model.landmarks68[48:60]]
    inside = (np.abs(roots[:, 0]) < 0.7) & (roots[:, 1] < lips[3, 1] - 0.25) & (roots[:, 1] > lips[9, 1] + 0.25)
    assert not inside.any()
    assert roots[:, 1].max() < person.neutral[model.landmarks68[36:48], 1].min() + 1.5
    tips = beard.points[::11, -1]
    assert (distance_outside(person, tips) < -0.25).mean() < 0.002
    lengths = np.linalg.norm(beard.points[:, -1] - beard.points[:, 0], axis=1)
    assert (lengths.max() < 0.3) == (style == "stubble")


def test_a_beard_follows_the_jaw(person: Person) -> None:
    model = person.model
    opened = person.face({"jawOpen": 0.8})
    closed_beard, open_beard = (grow_beard(model, person.neutral, face, 4, "full") for face in (person.neutral, opened))
    assert closed_beard is not None
    assert open_beard is not None
    triangles = model.triangles(Part.FACE, Part.HEAD)
    where = nearest_on_surface(closed_beard.points[::7, 0], person.neutral, triangles)
    np.testing.assert_allclose(open_beard.points[::7, 0], where.interpolate(opened), atol=1e-6)
    drop = (open_beard.points - closed_beard.points)[..., 1].mean(axis=1)
    marks = model.landmarks68
    chin = (opened - person.neutral)[marks[8], 1]
    roots = closed_beard.points[:, 0]
    assert chin < -1.5
    at_chin = (np.abs(roots[:, 0]) < 1) & (roots[:, 1] < person.neutral[marks[8], 1] + 0.5) & (roots[:, 2] > 8)
    assert abs(drop[at_chin].mean() - chin) < 0.25 * abs(chin)
    moustache = (np.abs(roots[:, 0]) < 1.5) & (roots[:, 1] > person.neutral[marks[51], 1])
    assert np.abs(drop[moustache]).max() < 0.3 * abs(chin)


def test_a_bare_face_has_no_beard(person: Person) -> None:
    assert grow_beard(person.model, person.neutral, person.neutral, 4, "none") is None
