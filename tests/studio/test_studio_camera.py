"""The studio's camera says the same as the service's head pose."""

from __future__ import annotations

import numpy as np

from relit_camera.base.rotations import Rotation
from relit_camera.face.head_pose import HeadPose, project
from relit_studio.cameras.studio_camera import Camera


def test_points_fall_where_the_service_projects_them() -> None:
    camera = Camera(512)
    points = np.random.default_rng(0).uniform(-10, 10, (30, 3))
    pose = HeadPose(Rotation.identity(), -camera.position_cm, camera.focal_px)
    np.testing.assert_allclose(camera.project(points), project(points, pose, (512, 512)), atol=1e-3)


def test_the_view_spans_what_it_says() -> None:
    camera = Camera(256)
    edges = [[-camera.view_cm / 2, camera.middle_cm, 0], [0, camera.middle_cm + camera.view_cm / 2, 0]]
    np.testing.assert_allclose(camera.project(np.array(edges)), [[0, 128], [128, 0]], atol=1e-4)
