from __future__ import annotations

import numpy as np

from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.tracking.mesh_refinement import REFINEMENTS, mesh_points

SCHEME = landmark_scheme("mesh478")


def test_a_network_of_478_points_is_taken_as_it_is() -> None:
    points = np.random.default_rng(0).normal(size=(478, 3)).astype(np.float32)
    np.testing.assert_array_equal(mesh_points({"landmarks": points.reshape(1, 1, 1, -1)}), points[:, :2])


def test_lips_eyes_and_irises_are_those_of_the_closer_look() -> None:
    outputs = {name: np.full((1, 1, 1, 2 * len(indices)), 1 + number, np.float32)
               for number, (name, indices) in enumerate(REFINEMENTS.items())}  # fmt: skip
    points = mesh_points({"landmarks": np.zeros((1, 1, 1, 468 * 3), np.float32), **outputs})
    assert points.shape == (478, 2)
    parts = {"lips": SCHEME.lips, "right_eye": SCHEME.right_eye.lids, "left_eye": SCHEME.left_eye.lids,
             "right_iris": SCHEME.right_eye.iris, "left_iris": SCHEME.left_eye.iris}  # fmt: skip
    for number, name in enumerate(REFINEMENTS):
        assert (points[list(parts[name])] == 1 + number).all(), name
    assert (points[list(SCHEME.oval)] == 0).all()


def test_the_closer_look_sees_each_point_of_a_part_once_and_both_eyes_alike() -> None:
    assert {name: len(indices) for name, indices in REFINEMENTS.items()} == {
        "lips": 80, "right_eye": 71, "left_eye": 71, "right_iris": 5, "left_iris": 5,
    }  # fmt: skip
    for indices in REFINEMENTS.values():
        assert len(set(indices.tolist())) == len(indices) or len(indices) == 80
    right, left = (SCHEME.canonical[REFINEMENTS[name]] for name in ("right_eye", "left_eye"))
    np.testing.assert_allclose(right * [-1, 1, 1], left, atol=0.05)
