"""The whole head's mesh: a turned face hides the ear at its far side, and nothing pops."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.base.rotations import rotation_from_angles
from relit_camera.live.reenactment.control_points import control_points, head_and_shoulder_anchors
from relit_camera.live.reenactment.dense_motion import DenseMotion
from relit_camera.live.reenactment.first_order_reenactor import face_and_head_flow, whole_flow
from relit_camera.live.reenactment.mesh.head_mesh import HeadMesh, triangulate_head
from relit_camera.live.reenactment.motion_transfer import TransferredPose, transfer_motion
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.live.reenactment.warp import Warp
from tests.live.people import face_of, motion, person

FINE = 4
"""Places in a source pixel, side by side."""


@pytest.fixture(scope="module")
def face() -> SourceFace:
    return face_of(person())


@pytest.fixture(scope="module")
def mesh(face: SourceFace) -> HeadMesh:
    return triangulate_head(face, head_and_shoulder_anchors(face.pose, face.size))


def turned(face: SourceFace, yaw: float, pitch: float = 0.0) -> TransferredPose:
    points = control_points(face, head_and_shoulder_anchors(face.pose, face.size))
    return transfer_motion(face, points, motion(rotation_from_angles(yaw, pitch)))


def looks(face: SourceFace, mesh: HeadMesh, yaw: float, hiding: bool = True) -> NDArray[np.float32]:
    """Where places 1/`FINE` pixel apart look (rows, columns, 2), with the far side hidden or without."""
    points = control_points(face, head_and_shoulder_anchors(face.pose, face.size))
    target = turned(face, yaw)
    arguments = (points, target.points, target.landmarks, target.pose)
    graph = DenseMotion(SessionOptions())
    patches = whole_flow(graph, mesh, *arguments) if hiding else face_and_head_flow(graph, mesh.face, *arguments)
    close = np.array([[1 / FINE, 0, 0], [0, 1 / FINE, 0]])
    return Warp(close, patches).grid((0, 0, FINE * face.size[0], FINE * face.size[1]), 1).nodes()


def shown_of_ear(face: SourceFace, seen: NDArray[np.float32], side: int) -> int:
    """How many places look at the ear on one side (1 the picture's right): beside the face, just below the eyes."""
    outline = face.landmarks[list(face.scheme.oval)]
    (low_x, top), (high_x, bottom) = outline.min(axis=0), outline.max(axis=0)
    eyes = float(face.scheme.eye_centers(face.landmarks)[:, 1].mean())
    beside = (seen[..., 0] - high_x if side > 0 else low_x - seen[..., 0]) / (high_x - low_x)
    below = (seen[..., 1] - eyes) / (bottom - top)
    return int(((beside > 0.02) & (beside < 0.1) & (below > 0) & (below < 0.12)).sum())


@pytest.mark.parametrize(("yaw", "side"), [(30, 1), (-30, -1)])
def test_a_turned_face_hides_the_ear_at_its_far_side(face: SourceFace, mesh: HeadMesh, yaw: float, side: int) -> None:
    plain, hidden = (shown_of_ear(face, looks(face, mesh, yaw, hiding), side) for hiding in (False, True))
    assert plain > 100
    assert hidden < 0.25 * plain


@pytest.mark.parametrize(("yaw", "side"), [(30, -1), (-30, 1)])
def test_the_ear_at_the_near_side_is_the_smooth_flows(face: SourceFace, mesh: HeadMesh, yaw: float, side: int) -> None:
    plain, hidden = (looks(face, mesh, yaw, hiding) for hiding in (False, True))
    columns = face.landmarks[:, 0].mean() + side * 0.3 * np.ptp(face.landmarks[:, 0])
    near = np.s_[:, : int(FINE * columns)] if side < 0 else np.s_[:, int(FINE * columns) :]
    assert shown_of_ear(face, plain[near], side) > 100
    difference = np.abs(plain[near] - hidden[near]).max(axis=2)
    assert np.percentile(difference, 95) < 0.05  # apart from eye and mouth


def test_a_face_that_looks_ahead_has_no_sides(face: SourceFace, mesh: HeadMesh) -> None:
    target = turned(face, 5)
    count = len(mesh.face.triangles)
    surface = mesh.surface(target.landmarks, target.points[-48:], target.pose)
    assert len(surface.corners) < count + 40
    away = turned(face, 20)
    assert len(mesh.surface(away.landmarks, away.points[-48:], away.pose).corners) > count + 40


def test_a_head_that_is_cut_off_has_no_sides(face: SourceFace) -> None:
    mesh, away = triangulate_head(face, np.zeros((0, 2))), turned(face, 20)
    assert mesh.sides is None
    surface = mesh.surface(away.landmarks, np.zeros((0, 2)), away.pose)
    assert len(surface.corners) < len(mesh.face.triangles) + 40


@pytest.mark.parametrize("yaws", [(5.9, 6.1), (10.0, 10.2), (15.9, 16.1)])
def test_a_head_that_turns_slowly_shows_no_jump(face: SourceFace, mesh: HeadMesh, yaws: tuple[float, float]) -> None:
    first, second = (looks(face, mesh, yaw) for yaw in yaws)
    by_flow = [looks(face, mesh, yaw, hiding=False) for yaw in yaws]
    moved, least = (np.linalg.norm(b - a, axis=2) for a, b in ((first, second), by_flow))
    assert np.percentile(moved, 99.5) < 3 * np.percentile(least, 99.5) + 0.1
