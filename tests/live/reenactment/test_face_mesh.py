"""The face's mesh: its landmarks go exactly where they must, and a turned nose hides what lies behind it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator
from scipy.spatial.transform import Rotation

from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.live.reenactment.control_points import control_points, head_and_shoulder_anchors
from relit_camera.live.reenactment.dense_motion import DenseMotion
from relit_camera.live.reenactment.face_mesh import triangulate_face
from relit_camera.live.reenactment.first_order_reenactor import face_and_head_flow
from relit_camera.live.reenactment.motion_transfer import transfer_motion
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.live.reenactment.warp import FlowPatch
from tests.live.people import SCHEME, face_of, motion, person

NOSE_TIP, NOSE_LEFT_WING, NOSE_RIGHT_WING = 1, 358, 129
"""By the numbering of the canonical face; the right wing is the person's own, at the picture's left."""


@pytest.fixture(scope="module")
def face():
    return face_of(person())


def patches_of(face: SourceFace, turn: Rotation):
    """The target, and the flow over the head without the mesh and over the face with it."""
    points = control_points(face, head_and_shoulder_anchors(face.pose, face.size))
    target = transfer_motion(face, points, motion(turn))
    motion_graph = DenseMotion(SessionOptions())
    head, mesh = face_and_head_flow(
        motion_graph, triangulate_face(face), points, target.points, target.landmarks, target.pose, fine=False
    )
    return target, head, mesh


def looks_at(patch: FlowPatch, points: np.ndarray):
    """Where in the still the patch looks at points (count, 2) of the moved picture."""
    rows, columns = patch.flow.shape[:2]
    x, y = (np.linspace(patch.region[i], patch.region[i + 2], n) for i, n in ((0, columns), (1, rows)))
    return points + RegularGridInterpolator((y, x), patch.flow)(points[:, ::-1])


def firm(face: SourceFace):
    """Landmarks in the middle of the face: none of the irises, and none at the outline, where the mesh hands over."""
    middle = face.landmarks[list(SCHEME.oval)].mean(axis=0)
    reach = np.linalg.norm(face.landmarks[list(SCHEME.oval)] - middle, axis=1).min()
    near = np.linalg.norm(face.landmarks - middle, axis=1) < 0.6 * reach
    near[[*SCHEME.right_eye.iris, *SCHEME.left_eye.iris]] = False
    return np.flatnonzero(near)


@pytest.mark.parametrize("yaw", [-12, 0, 12])
def test_every_landmark_of_a_face_that_hides_nothing_is_met(face: SourceFace, yaw: float) -> None:
    target, head, mesh = patches_of(face, Rotation.from_euler("Y", yaw, degrees=True))
    rows = firm(face)
    error, before = (
        np.median(np.linalg.norm(looks_at(patch, target.landmarks[rows]) - face.landmarks[rows], axis=1))
        for patch in (mesh, head)
    )
    assert error < 0.1
    assert error <= 0.5 * before + 0.02  # a grid point on a border is drawn with the neighbour's triangle


@pytest.mark.parametrize(
    ("yaw", "hidden", "seen"), [(35, NOSE_LEFT_WING, NOSE_RIGHT_WING), (-35, NOSE_RIGHT_WING, NOSE_LEFT_WING)]
)
def test_a_turned_nose_covers_its_far_side(face: SourceFace, yaw: float, hidden: np.ndarray, seen: np.ndarray) -> None:
    target, _, mesh = patches_of(face, Rotation.from_euler("Y", yaw, degrees=True))
    near, far = looks_at(mesh, target.landmarks[[seen, hidden]])
    step = np.linalg.norm(face.landmarks[NOSE_LEFT_WING] - face.landmarks[NOSE_RIGHT_WING])
    assert np.linalg.norm(near - face.landmarks[seen]) < 0.1 * step
    # The viewer sees the ridge there, on the hither side of the wing.
    beyond = (far - face.landmarks[hidden])[0] * np.sign(face.landmarks[seen] - face.landmarks[hidden])[0]
    assert beyond > 0.2 * step


@pytest.mark.parametrize("angles", [(35, 25, 10), (-35, -25, 5), (0, 25, 0), (28, -10, -10)])
def test_no_point_looks_far_from_where_its_neighbours_look(
    face: SourceFace, angles: tuple[float, float, float]
) -> None:
    """Thin triangles, seen from the side, throw nothing away: all look inside the face."""
    _, _, mesh = patches_of(face, Rotation.from_euler("YXZ", angles, degrees=True))
    rows, columns = mesh.flow.shape[:2]
    x, y = (np.linspace(mesh.region[i], mesh.region[i + 2], n) for i, n in ((0, columns), (1, rows)))
    seen = mesh.flow + np.dstack(np.meshgrid(x, y))
    inner = seen[rows // 4 : -rows // 4, columns // 4 : -columns // 4].reshape(-1, 2)
    low, high = face.landmarks.min(axis=0), face.landmarks.max(axis=0)
    assert (inner > low - 0.1 * (high - low)).all()
    assert (inner < high + 0.1 * (high - low)).all()


def test_outside_the_face_the_flow_is_the_heads(face: SourceFace) -> None:
    _, head, mesh = patches_of(face, Rotation.from_euler("Y", 15, degrees=True))
    left, top, right, bottom = mesh.region
    corners = np.array([(left, top), (right, top), (left, bottom), (right, bottom)])
    np.testing.assert_allclose(looks_at(mesh, corners), looks_at(head, corners), atol=0.03)  # remap counts in 32nds
