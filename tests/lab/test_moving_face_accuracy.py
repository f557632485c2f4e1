"""Parts of a person in a picture, and how near each comes to the truth."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.rotations import rotation_from_angles
from relit_camera.face.head_pose import HeadPose, project
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.lab.evaluate.video.moving_face_accuracy import MAX_DB, PartAccuracy, figures_table
from relit_camera.lab.evaluate.video.person_regions import person_regions

SIZE = (320, 240)
SCHEME = landmark_scheme("mesh478")
MATTE = np.zeros(SIZE[::-1], np.float32)
MATTE[20:, 60:260] = 1


def posed(yaw_deg: float = 0.0, jaw_cm: float = 0.0) -> tuple[np.ndarray, HeadPose]:
    """Landmarks and pose of the mean face, turned, with the lower lip lowered."""
    pose = HeadPose(rotation_from_angles(yaw_deg), np.array([0.0, 0.0, -60.0]), 320.0)
    points = SCHEME.canonical.copy()
    points[list(SCHEME.lower_lip_inner[1:-1])] -= [0, jaw_cm, 0]
    return project(points, pose, SIZE), pose


def parts(yaw_deg: float = 0.0, jaw_cm: float = 0.0) -> dict[str, np.ndarray]:
    landmarks, pose = posed(yaw_deg, jaw_cm)
    return person_regions(MATTE, landmarks, SCHEME, pose)


def test_parts_lie_where_their_names_say() -> None:
    found = parts()
    middles = {name: np.argwhere(part).mean(axis=0) for name, part in found.items()}
    assert middles["hair"][0] < middles["face"][0] < middles["neck"][0] < middles["body"][0]
    assert not (found["hair"] & found["face"]).any()
    assert not (found["body"] & (found["hair"] | found["face"])).any()
    assert (found["neck"] <= found["body"]).all()
    assert all((part <= found["person"]).all() for part in found.values())


def test_the_mouth_counts_while_it_is_open() -> None:
    assert "mouth" not in parts()
    assert parts(jaw_cm=2.0)["mouth"].sum() > 50


@pytest.mark.parametrize("yaw_deg", [-30, 30])
def test_the_far_cheek_is_on_the_side_that_the_nose_points_to(yaw_deg: float) -> None:
    assert "far cheek" not in parts(0.5 * yaw_deg)
    found = parts(yaw_deg)
    far, face = (np.argwhere(found[name])[:, 1].mean() for name in ("far cheek", "face"))
    assert (far - face) * yaw_deg > 0
    assert found["far cheek"].sum() < 0.7 * found["face"].sum()


def test_one_gain_of_light_is_free_and_the_rest_is_not() -> None:
    truth = np.full((*SIZE[::-1], 3), 100, np.uint8)
    found, same, worse = parts(), PartAccuracy(), PartAccuracy()
    same.add(np.full_like(truth, 60), truth, found)
    half = truth.copy()
    half[:, :160] = 60
    worse.add(half, truth, found)
    assert same.figures().mean("person") > 45
    assert worse.figures().mean("person") < 25
    assert np.isnan(worse.figures().mean("mouth"))


def test_equal_pictures_have_the_largest_figure() -> None:
    truth, found, accuracy = np.full((*SIZE[::-1], 3), 90, np.uint8), parts(), PartAccuracy()
    accuracy.add(truth, truth, found)
    figures = accuracy.figures()
    assert figures.decibels["face"][0] == MAX_DB
    assert "person" in figures_table([("a row", figures)])
