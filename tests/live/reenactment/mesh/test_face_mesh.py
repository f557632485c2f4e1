"""The face's mesh: its landmarks go exactly where they must, and a turned nose hides what lies behind it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator
from scipy.spatial import Delaunay

from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.base.rotations import Rotation, rotation_from_angles
from relit_camera.live.reenactment.control_points import control_points, head_and_shoulder_anchors
from relit_camera.live.reenactment.dense_motion import DenseMotion, box_around
from relit_camera.live.reenactment.first_order_reenactor import face_and_head_flow
from relit_camera.live.reenactment.mesh.face_mesh import triangulate_face
from relit_camera.live.reenactment.mesh.triangle_drawing import draw_triangles
from relit_camera.live.reenactment.motion_transfer import transfer_motion
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.live.reenactment.warp import Warp
from tests.live.people import SCHEME, face_of, motion, person

NOSE_TIP, NOSE_LEFT_WING, NOSE_RIGHT_WING = 1, 358, 129
"""By the numbering of the canonical face; the right wing is the person's own, at the picture's left."""


@pytest.fixture(scope="module")
def face():
    return face_of(person())


def warps_of(face: SourceFace, turn: Rotation):
    """The target, and how the picture is warped without the mesh and with it."""
    points = control_points(face, head_and_shoulder_anchors(face.pose, face.size))
    target = transfer_motion(face, points, motion(turn))
    motion_graph = DenseMotion(SessionOptions())
    head, mesh = face_and_head_flow(
        motion_graph, triangulate_face(face), points, target.points, target.landmarks, target.pose
    )
    return target, Warp(np.eye(2, 3), (head,)), Warp(np.eye(2, 3), (head, mesh))


def looks_at(warp: Warp, points: np.ndarray, fine: int = 4):
    """Where in the still it looks at points (count, 2) of the moved picture, from places 1/`fine` pixel apart."""
    low, high = np.floor(points.min(axis=0)) - 1, np.ceil(points.max(axis=0)) + 1
    close = warp.affine @ np.array([[1 / fine, 0, low[0]], [0, 1 / fine, low[1]], [0, 0, 1]])
    right, bottom = (int(n) for n in fine * (high - low))
    seen = Warp(close, warp.patches).grid((0, 0, right, bottom), 1).nodes()
    x, y = ((np.arange(n) + 0.5) / fine for n in (right, bottom))
    return RegularGridInterpolator((y, x), seen)((points - low)[:, ::-1])


def firm(face: SourceFace):
    """Landmarks in the middle of the face: none of the irises, and none at the outline, where the mesh hands over."""
    middle = face.landmarks[list(SCHEME.oval)].mean(axis=0)
    reach = np.linalg.norm(face.landmarks[list(SCHEME.oval)] - middle, axis=1).min()
    near = np.linalg.norm(face.landmarks - middle, axis=1) < 0.6 * reach
    near[[*SCHEME.right_eye.iris, *SCHEME.left_eye.iris]] = False
    return np.flatnonzero(near)


@pytest.mark.parametrize("yaw", [-12, 0, 12])
def test_every_landmark_of_a_face_that_hides_nothing_is_met(face: SourceFace, yaw: float) -> None:
    target, head, mesh = warps_of(face, rotation_from_angles(yaw))
    rows = firm(face)
    error, before = (
        np.median(np.linalg.norm(looks_at(warp, target.landmarks[rows]) - face.landmarks[rows], axis=1))
        for warp in (mesh, head)
    )
    assert error < 0.1
    assert error <= 0.5 * before + 0.02  # a grid point on a border is drawn with the neighbour's triangle


@pytest.mark.parametrize(
    ("yaw", "hidden", "seen"), [(35, NOSE_LEFT_WING, NOSE_RIGHT_WING), (-35, NOSE_RIGHT_WING, NOSE_LEFT_WING)]
)
def test_a_turned_nose_covers_its_far_side(face: SourceFace, yaw: float, hidden: np.ndarray, seen: np.ndarray) -> None:
    target, _, mesh = warps_of(face, rotation_from_angles(yaw))
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
    target, _, mesh = warps_of(face, rotation_from_angles(*angles))
    left, top, right, bottom = box_around(target.landmarks, 0.0)
    x, y = np.meshgrid(np.linspace(left, right, 80)[20:-20], np.linspace(top, bottom, 80)[20:-20])
    inner = looks_at(mesh, np.stack([x, y], axis=2).reshape(-1, 2))
    low, high = face.landmarks.min(axis=0), face.landmarks.max(axis=0)
    assert (inner > low - 0.1 * (high - low)).all()
    assert (inner < high + 0.1 * (high - low)).all()


def test_outside_the_face_the_flow_is_the_heads(face: SourceFace) -> None:
    target, head, mesh = warps_of(face, rotation_from_angles(15))
    left, top, right, bottom = box_around(target.landmarks, 0.0)
    corners = np.array([(left, top), (right, top), (left, bottom), (right, bottom)])
    np.testing.assert_allclose(
        looks_at(mesh, corners), looks_at(head, corners), atol=0.03
    )  # warpAffine counts in 32nds


def triangle_by_triangle(corners: np.ndarray, values: np.ndarray, shape: tuple[int, int]):
    """The same picture, drawn one triangle after another with SciPy's barycentric coordinates."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    points = np.stack([x, y], axis=2).reshape(-1, 2).astype(float)
    drawn = np.zeros((len(points), values.shape[2]))
    for corner, value in zip(corners, values, strict=True):
        inside = Delaunay(corner).find_simplex(points, tol=1e-9) >= 0
        edges = np.column_stack([corner[1] - corner[0], corner[2] - corner[0]])
        weights = np.linalg.solve(edges, (points[inside] - corner[0]).T).T
        drawn[inside] = value[0] + weights @ (value[1:] - value[0])
    return drawn.T.reshape(-1, *shape)


def test_triangles_are_drawn_in_their_order_and_cut_off_at_the_border() -> None:
    rng = np.random.default_rng(4)
    corners = rng.uniform(-8, 40, (40, 3, 2))
    values = rng.random((40, 3, 3))
    drawn = draw_triangles(corners, values, (30, 36))
    assert drawn.dtype == np.float32
    np.testing.assert_allclose(drawn, triangle_by_triangle(corners, values, (30, 36)), atol=1e-4)


def test_no_seam_opens_between_neighbours_nor_where_a_triangle_has_no_area() -> None:
    """A fan whose borders run through the pixels' own points, with a triangle between that is a mere line."""
    rim = np.array([(0.0, 0), (10, 0), (20, 0), (20, 10), (20, 20), (10, 20), (0, 20), (0, 10), (0, 0)])
    middle = np.array([10.0, 10])
    fan = [np.array([middle, a, b]) for a, b in pairwise(rim)]
    line = np.array([(0.0, 0), (10, 10), (20, 20)])
    corners = np.array([*fan, line])
    x, y = draw_triangles(corners, corners, (21, 21))
    np.testing.assert_allclose(x, np.tile(np.arange(21), (21, 1)), atol=1e-4)
    np.testing.assert_allclose(y.T, np.tile(np.arange(21), (21, 1)), atol=1e-4)


def test_a_still_face_does_not_flicker(face: SourceFace) -> None:
    """Where the head trembles by a hundredth of a degree no place jumps: it moves about as the landmarks do."""
    rng = np.random.default_rng(6)
    landmarks, looks = [], []
    for _ in range(4):
        turn = rotation_from_angles(*rng.normal(0, 0.01, 3) + [10, 4, 2])
        target, _, mesh = warps_of(face, turn)
        landmarks.append(target.landmarks)
        looks.append(mesh.grid((0, 0, *face.size), 1).nodes())
    trembling = np.ptp(landmarks, axis=0).max()
    assert 0.02 < trembling < 0.1
    assert np.ptp(looks, axis=0).max() < 2.5 * trembling
