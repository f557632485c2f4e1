"""Glasses: stiff, outside the face, before the eyes, and gone with the head."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from relit_camera.base.rotations import Angles
from relit_studio.cycles.accessory_objects import extra_materials, extra_objects, extra_shape
from relit_studio.people.clothing.glasses import Glasses, fit_glasses
from relit_studio.people.face.face_model import Part
from relit_studio.people.face.identity import identity_weights
from relit_studio.people.face.mesh478_points import nearest_on_surface
from relit_studio.people.geometry import vertex_normals
from relit_studio.people.person import Person
from relit_studio.people.posture import Posture, turned
from relit_studio.people.traits.person_traits import GlassesTraits, LensShape
from relit_studio.people.traits.random_traits import random_traits


def fitted(person: Person, seed: int, shape: LensShape) -> tuple[np.ndarray, Glasses]:
    head = person.model.neutral(identity_weights(person.model, random_traits(seed)))
    return head, fit_glasses(person.model, head, GlassesTraits(shape))


@pytest.mark.parametrize("shape", get_args(LensShape))
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_glasses_do_not_cut_into_the_face(person: Person, seed: int, shape: LensShape) -> None:
    head, glasses = fitted(person, seed, shape)
    triangles = person.model.triangles(Part.FACE, Part.HEAD)
    # The temples' ends lie behind the ears.
    front = np.concatenate([glasses.frame[glasses.frame[:, 2] > 3.0][::5], glasses.lenses[::7]])
    where = nearest_on_surface(front, head, triangles)
    normal = where.interpolate(vertex_normals(head, triangles))
    assert ((front - where.interpolate(head)) * normal).sum(axis=1).min() > 0
    right, left = (head[person.model.landmarks68[each]].mean(axis=0) for each in (slice(36, 42), slice(42, 48)))
    for eye in (right, left):
        lens = glasses.lenses[np.linalg.norm(glasses.lenses[:, :2] - eye[:2], axis=1) < 0.8]
        assert 0.5 < (lens[:, 2] - eye[2]).min() < 3.5


def test_both_sides_are_alike(person: Person) -> None:
    glasses = fit_glasses(person.model, person.model.vertices, GlassesTraits())
    for points in (glasses.frame, glasses.lenses):
        assert np.abs(points[:, 0].min() + points[:, 0].max()) < 0.1
        assert np.isfinite(points).all()
    for points, faces in ((glasses.frame, glasses.frame_faces), (glasses.lenses, glasses.lens_faces)):
        assert faces.min() == 0
        assert faces.max() == len(points) - 1


def test_glasses_and_beard_go_with_the_head(person: Person) -> None:
    traits = replace(person.traits, beard="goatee", glasses=GlassesTraits("round"))
    glasses = fit_glasses(person.model, person.neutral, GlassesTraits("round"))
    dressed = replace(person, traits=traits, glasses=glasses)
    assert [each.name for each in extra_objects(dressed)] == ["beard", "frame", "lenses"]
    assert set(extra_materials(dressed)) == {"beard", "frame", "lenses"}
    posture = Posture(Angles(25.0, -8.0, 5.0))
    shape = extra_shape(dressed, posture)
    matrix = shape["frame.matrix"]
    np.testing.assert_array_equal(matrix, shape["lenses.matrix"])
    moved = glasses.frame @ matrix[:3, :3].T + matrix[:3, 3]
    np.testing.assert_allclose(moved, turned(glasses.frame, posture.rotation), atol=1e-9)
    # Stiff against the face's own bones.
    nose = person.model.landmarks68[27]
    before = np.linalg.norm(glasses.frame - dressed.vertices(Posture())[nose], axis=1)
    after = np.linalg.norm(moved - dressed.vertices(posture)[nose], axis=1)
    np.testing.assert_allclose(after, before, atol=1e-6)


def test_who_wears_nothing_has_nothing_extra(person: Person) -> None:
    assert extra_objects(person) == []
    assert extra_materials(person) == {}
    assert extra_shape(person, Posture()) == {}
