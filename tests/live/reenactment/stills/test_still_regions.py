"""Regions of the face for expression stills: what they hold, and where they end."""

from __future__ import annotations

from dataclasses import replace

from relit_camera.base.rotations import rotation_from_angles
from relit_camera.face.head_pose import project
from relit_camera.live.reenactment.stills.still_regions import face_in_still, facing, shown_landmarks, still_regions
from tests.live.people import SCHEME, close_up, face_of
from tests.live.reenactment.stills.made_stills import expression, soft_light, still

NOSE_TIP, CHEEKS = 1, (50, 280)
"""Landmarks of the scheme `mesh478`."""
REGIONS = {region.name: region for region in still_regions(SCHEME)}


def test_the_mouth_holds_its_inside() -> None:
    inner = {*SCHEME.upper_lip_inner, *SCHEME.lower_lip_inner}
    inside = [triangle for triangle in REGIONS["mouth"].triangles if set(map(int, triangle)) <= inner]
    upper, lower = set(SCHEME.upper_lip_inner[1:-1]), set(SCHEME.lower_lip_inner[1:-1])
    assert sum(bool(set(map(int, t)) & upper and set(map(int, t)) & lower) for t in inside) == 18


def test_all_of_a_face_from_the_front_faces_the_camera_and_nothing_from_behind() -> None:
    for region in REGIONS.values():
        corners = SCHEME.canonical[region.triangles, :2]
        assert facing(corners * [10, -10]).mean() > 0.97
        assert facing(corners * [-10, -10]).mean() < 0.03


def test_each_region_fades_out_and_leaves_the_rest_alone() -> None:
    for name, features in {
        "mouth": SCHEME.lips, "right_eye": SCHEME.right_eye.lids, "left_eye": SCHEME.left_eye.lids
    }.items():  # fmt: skip
        trust = REGIONS[name].trust
        assert trust[list(features)].min() > 0.99
        assert (trust > 0).mean() < 0.35


def test_a_turned_face_is_its_cheeks_and_the_eye_that_turns_away() -> None:
    """Not the near eye, whose gaze is the driver's, nor the nose, which is seen from the front as well."""
    for name, far, near in (
        ("left_turn", SCHEME.left_eye, SCHEME.right_eye),
        ("right_turn", SCHEME.right_eye, SCHEME.left_eye),
    ):
        region = REGIONS[name]
        assert region.eye_name == name.replace("turn", "eye")
        assert (region.trust[far.outer], region.eye[far.outer]) == (1, 1)
        assert max(region.trust[list(near.lids)].max(), region.eye[list(near.lids)].max()) == 0
        assert max(region.trust[list(SCHEME.oval)].max(), region.trust[NOSE_TIP]) == 0
        assert region.trust[list(CHEEKS)].min() > 0.95


def test_a_still_does_not_show_at_the_outline_of_its_face() -> None:
    face, made = face_of(close_up()), still(soft_light(), expression())
    shown = shown_landmarks(made, face, face_in_still(made, face))
    assert shown[list(SCHEME.oval)].max() < 0.5
    assert shown[list(SCHEME.lips)].min() == 1


def test_what_a_turned_nose_hides_is_not_shown() -> None:
    """Of a head that is turned by 50 degrees the cheek beside the nose is hidden, the cheek on the near side is not."""
    face = face_of(close_up())
    turn = rotation_from_angles(50)
    turned = replace(
        still(soft_light(), expression(), turn),
        landmarks=project(SCHEME.canonical.copy(), replace(face.pose, rotation=turn * face.pose.rotation), face.size),
    )
    shown = shown_landmarks(turned, face, face_in_still(turned, face))
    beside_nose, mirrored = 358, 129
    assert SCHEME.canonical[beside_nose, 0] == -SCHEME.canonical[mirrored, 0] > 0
    assert shown[beside_nose] < 0.2
    assert shown[mirrored] > 0.8
