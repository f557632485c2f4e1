"""Mug, hands and sleeve: closed surfaces of the right size, and where they go."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import cKDTree

from relit_studio.people.face.face_model import Part
from relit_studio.people.geometry import vertex_normals
from relit_studio.people.person import Person
from relit_studio.people.posture import Posture
from relit_studio.people.props.hand import gripping_hand, open_hand
from relit_studio.people.props.held_objects import Gesture, HeldObjects
from relit_studio.people.props.mug import HEIGHT_CM, RADIUS_CM, throw_mug
from relit_studio.people.props.sleeve import sew_sleeve
from relit_studio.people.props.solids import Blob, Solid, revolve, surface_nets, union_surface


def volume(solid: Solid) -> float:
    first, second, third = np.moveaxis(solid.vertices[solid.triangles], 1, 0)
    return float(np.einsum("ni,ni->n", first, np.cross(second, third)).sum() / 6)


def directed_edges(solid: Solid) -> np.ndarray:
    triangles = solid.triangles
    return np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])


@pytest.mark.slow
@pytest.mark.parametrize("make", [lambda: throw_mug()[0], lambda: throw_mug()[1], gripping_hand, open_hand, sew_sleeve])
def test_surfaces_are_closed_and_face_outward(make: Callable[[], Solid]) -> None:
    solid = make()
    edges = directed_edges(solid)
    # Each edge is used as often in one direction as in the other.
    np.testing.assert_array_equal(sorted(edges.tolist()), sorted(edges[:, ::-1].tolist()))
    assert volume(solid) > 0


def test_a_turned_profile_has_its_volume() -> None:
    cylinder = revolve([(0, 0), (2, 0), (2, 5), (0, 5)], 256)
    assert volume(cylinder) == pytest.approx(np.pi * 4 * 5, rel=1e-3)


def test_surface_nets_find_a_sphere() -> None:
    x, y, z = np.indices((24, 25, 26)) - 12.0
    vertices, _ = surface_nets(np.sqrt(x * x + y * y + z * z) - 8)
    np.testing.assert_allclose(np.linalg.norm(vertices - 12, axis=1), 8, atol=0.1)


def test_a_round_cone_has_its_radii() -> None:
    cone = Blob((np.array([[0, 0, 0, 2.0], [6, 0, 0, 1.0]]),), 0.1)
    along = np.array([0.0, 3.0, 6.0])
    on_surface = np.stack([along, 2 - along / 6, 0 * along], axis=1)
    np.testing.assert_allclose(cone.distance(on_surface), 0, atol=1e-9)
    solid = union_surface([cone], 0.1, 0.25)
    np.testing.assert_allclose(cone.distance(solid.vertices), 0, atol=0.05)


def test_a_mug_holds_a_cup_of_coffee() -> None:
    body, _ = throw_mug()
    outside = np.pi * RADIUS_CM**2 * HEIGHT_CM
    assert 250 < outside - volume(body) < outside  # cubic centimeters, wall and all


@pytest.fixture(scope="module")
def held(person: Person) -> HeldObjects:
    return HeldObjects(person)


def placed(held: HeldObjects, name: str, gesture: Gesture) -> np.ndarray:
    motion = held.motions(Posture(), gesture)[name]
    return held.solids[name].vertices @ motion[:3, :3].T + motion[:3, 3]


def depth_in_head(person: Person, points: np.ndarray) -> float:
    """How far, in centimeters, the deepest of the points is inside the face; negative: how far the nearest is off.

    What is far off is outside: below the neck, where the face ends, no normal tells.
    """
    triangles = person.model.triangles(Part.FACE)
    used = np.unique(triangles)
    normals = vertex_normals(person.neutral, triangles)[used]
    distance, nearest = cKDTree(person.neutral[used]).query(points)
    outward = ((points - person.neutral[used][nearest]) * normals[nearest]).sum(axis=1)
    return float(-np.where(distance < 4, np.sign(outward) * distance, distance).min())


def test_at_rest_all_is_below_the_picture_and_clear_of_the_head(person: Person, held: HeldObjects) -> None:
    for name in held.solids:
        points = placed(held, name, Gesture())
        assert points[:, 1].max() < -16
        assert depth_in_head(person, points) < -5


def test_the_mug_meets_the_lips_and_does_not_enter_the_face(person: Person, held: HeldObjects) -> None:
    lips = person.neutral[person.model.landmarks68[[51, 57]]]
    for tilt_deg in (0, 20, 40):
        gesture = Gesture(mug=1, tilt_deg=tilt_deg)
        mug = placed(held, "mug", gesture)
        assert cKDTree(mug).query(lips.mean(axis=0))[0] < 1
        assert depth_in_head(person, mug) < 0.5
        assert depth_in_head(person, placed(held, "right_hand", gesture)) < 0


def test_a_hand_that_passes_does_not_touch_the_face(person: Person, held: HeldObjects) -> None:
    for across_cm in (-8, 0, 9):
        assert depth_in_head(person, placed(held, "left_hand", Gesture(hand=1, across_cm=across_cm))) < -0.5


def test_hand_and_mug_keep_together_and_sleeves_begin_at_wrists(held: HeldObjects) -> None:
    gestures = [Gesture(mug=fraction, tilt_deg=30 * fraction, hand=fraction) for fraction in np.linspace(0, 1, 9)]
    motions = [held.motions(Posture(), gesture) for gesture in gestures]
    for each in motions:
        np.testing.assert_array_equal(each["mug"], each["right_hand"])
        np.testing.assert_allclose(each["left_sleeve"][:3, 3], each["left_hand"][:3, 3])
        for motion in each.values():
            np.testing.assert_allclose(motion[:3, :3] @ motion[:3, :3].T, np.eye(3), atol=1e-9)
            assert np.linalg.det(motion[:3, :3]) == pytest.approx(1)
    steps = [np.abs(after["right_sleeve"] - before["right_sleeve"]).max() for before, after in pairwise(motions)]
    assert max(steps) < 5
