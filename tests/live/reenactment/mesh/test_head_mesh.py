"""The whole head's mesh: a turned face hides the ear at its far side, and nothing pops."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.base.rotations import rotation_from_angles
from relit_camera.face.head_pose import project
from relit_camera.live.reenactment.control_points import control_points, head_and_shoulder_anchors
from relit_camera.live.reenactment.dense_motion import DenseMotion
from relit_camera.live.reenactment.first_order_reenactor import face_and_head_flow, whole_flow
from relit_camera.live.reenactment.mesh.face_mesh import SurfacePatch, _soften
from relit_camera.live.reenactment.mesh.head_mesh import HeadMesh, triangulate_head
from relit_camera.live.reenactment.mesh.head_sides import ear_in_sight
from relit_camera.live.reenactment.motion_transfer import TransferredPose, transfer_motion
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.live.reenactment.warp import Nodes, Patch, Warp, patch_cover
from tests.live.people import face_of, motion, person

CHIN = 152
"""The landmark at its tip."""
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


def looks(face: SourceFace, mesh: HeadMesh, yaw: float, hiding: bool = True, pitch: float = 0.0) -> NDArray[np.float32]:
    """Where places 1/`FINE` pixel apart look (rows, columns, 2), with the far side hidden or without."""
    points = control_points(face, head_and_shoulder_anchors(face.pose, face.size))
    target = turned(face, yaw, pitch)
    goes = (target.points, target.landmarks, target.pose)
    graph = DenseMotion(SessionOptions())
    _, closing = mesh.with_lids_that_meet(target.landmarks, target.pose)
    patches: tuple[Patch, ...] = face_and_head_flow(graph, mesh.face, points, *goes)
    if hiding:
        patches = whole_flow(graph, mesh, points, *goes, closing)
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


def surface_of(
    mesh: HeadMesh, target: TransferredPose, anchors: int = 48, closing: tuple[float, float] = (0.0, 0.0)
) -> SurfacePatch:
    return mesh.surface(target.landmarks, target.points[len(target.points) - anchors :], target.pose, closing)


def test_a_face_that_looks_ahead_has_no_sides(face: SourceFace, mesh: HeadMesh) -> None:
    count = len(mesh.face.triangles)
    assert len(surface_of(mesh, turned(face, 5)).corners) <= count
    assert len(surface_of(mesh, turned(face, 20)).corners) > count + 40


def test_a_head_that_is_cut_off_has_no_sides(face: SourceFace) -> None:
    mesh = triangulate_head(face, np.zeros((0, 2)))
    assert mesh.sides is None
    assert len(surface_of(mesh, turned(face, 20), anchors=0).corners) <= len(mesh.face.triangles)


def test_the_mesh_counts_fully_at_a_cheek_that_turns_away_and_not_at_the_chin(face: SourceFace, mesh: HeadMesh) -> None:
    cheeks, chin = np.isin(mesh.face.members, (234, 454)), np.isin(mesh.face.members, (152,))  # of the canonical face
    assert (mesh.turned_trust[cheeks] == 1).all()
    assert (mesh.turned_trust[chin] == 0).all()
    assert mesh.face.trust[cheeks | chin].max() < 0.2


def test_beside_the_neck_the_mesh_does_not_count(face: SourceFace, mesh: HeadMesh) -> None:
    """Neck and collar do not turn with the head; where a mesh of it ended over them, its rim would be seen."""
    assert mesh.sides is not None
    trust, height = mesh.sides.trust[: len(mesh.sides.ears)], mesh.sides.ears[:, 1]
    assert (trust[height < -8] == 0).all()
    assert (trust[height > -5] == 1).all()
    jaw = face.head_points[mesh.face.members, 1] < -8
    np.testing.assert_array_equal(mesh.turned_trust[jaw], mesh.face.trust[jaw])


@pytest.mark.parametrize("yaw", [30, -30])
def test_the_patch_of_a_turned_head_does_not_fade_out_over_the_far_ear(
    face: SourceFace, mesh: HeadMesh, yaw: float
) -> None:
    assert mesh.sides is not None
    target = turned(face, yaw)
    surface = surface_of(mesh, target)
    ears = project(mesh.sides.ears[np.sign(mesh.sides.ears[:, 0]) == np.sign(yaw)], target.pose, face.size)
    columns, rows = face.size
    nodes = Nodes(np.eye(2, 3), np.zeros((2, 2 * rows, 2 * columns), np.float32))
    cover = patch_cover(nodes, surface.box)
    for x, y in ears.astype(int):
        if 0 < x < columns and 0 < y < 0.7 * rows:  # the chin is beside the lower ones
            assert cover[y, x] > 0.9


@pytest.mark.parametrize("yaw", [0, 30, -30])
def test_a_closing_eye_has_its_eyeball_behind_the_skin_round_it_and_before_the_cheek(
    face: SourceFace, mesh: HeadMesh, yaw: float
) -> None:
    target = turned(face, yaw)
    for index, eye in enumerate(mesh.eyes):
        closing = (1.0, 0.0) if index == 0 else (0.0, 1.0)
        surface = surface_of(mesh, target, closing=closing)
        middle = target.landmarks[eye.lids].mean(axis=0)
        fan = np.flatnonzero(np.isclose(surface.corners[:, 0], middle, atol=1e-9).all(axis=1))
        assert len(fan) == len(eye.lids)
        assert (np.diff(fan) == 1).all()
        lids = target.landmarks[eye.lids]
        on_lids = (surface.corners[:, :, None] == lids).all(axis=3).any(axis=(1, 2))
        skin = np.setdiff1d(np.flatnonzero(on_lids), fan)
        assert fan.max() < skin.min()
        seen = mesh.face.nearest_last(target.landmarks[mesh.face.members][mesh.face.triangles], target.pose)
        beside = len(surface_of(mesh, target).corners) - len(seen)
        assert surface.beside == beside
        assert fan.min() > beside + (10 if yaw else 0)


@pytest.mark.parametrize("pitch", [0, 15, -15])
@pytest.mark.parametrize("side", [1, -1])
def test_a_head_that_turns_slowly_shows_no_jump(face: SourceFace, mesh: HeadMesh, pitch: float, side: int) -> None:
    """Where the sides come in, a ten-thousandth of a degree changes nothing that is seen."""
    assert mesh.sides is not None

    def has_sides(yaw: float) -> bool:
        return len(surface_of(mesh, turned(face, side * yaw, pitch)).corners) > len(mesh.face.triangles)

    low, high = 2.0, 12.0
    assert not has_sides(low)
    assert has_sides(high)
    while high - low > 1e-4:
        middle = (low + high) / 2
        low, high = (low, middle) if has_sides(middle) else (middle, high)
    before, after = (looks(face, mesh, side * yaw, pitch=pitch) for yaw in (low, high))
    assert np.abs(after - before).max() < 0.02


def test_edges_are_averaged_where_a_mesh_jumps_and_nowhere_else() -> None:
    drawn = np.zeros((3, 9, 12), np.float32)
    drawn[0, :, 2:] = np.arange(1, 11)
    drawn[0, :, 7:] += 50
    drawn[2, :, 2:] = 1
    for share in (0.0, 0.5, 1.0):
        softened = drawn.copy()
        soften(softened, softened[0] > 0, 20.0, share)
        changed = np.flatnonzero(np.abs(softened - drawn).max(axis=(0, 1)) > 0)
        assert set(changed) <= {5, 6, 7, 8}
        assert set(changed) >= ({6, 7} if share else set())
        step = 50 * share / 3
        np.testing.assert_allclose(softened[0, 4, 6] - drawn[0, 4, 6], step, atol=1.5)


def test_edges_beside_the_face_are_averaged_too() -> None:
    drawn = np.ones((3, 9, 12), np.float32)
    drawn[0, :, 7:] += 50
    face = np.zeros((9, 12), np.bool_)
    face[:, :4] = True
    soften(drawn, face, 20.0, 1.0)
    np.testing.assert_allclose(drawn[0, 4, 6:8], [1 + 50 / 3, 1 + 100 / 3], rtol=1e-5)


@pytest.mark.parametrize("ends", [7, 6, 8])
def test_the_outline_of_the_face_is_left_sharp(ends: int) -> None:
    """It is drawn pixel by pixel: see `far_outline`."""
    drawn = np.zeros((3, 9, 12), np.float32)
    drawn[0] = 1 + np.arange(12)
    drawn[0, :, 7:] += 50
    face = np.zeros((9, 12), np.bool_)
    face[:, :ends] = True
    softened = drawn.copy()
    soften(softened, face, 20.0, 1.0)
    np.testing.assert_array_equal(softened[:, :, ends - 1 : ends + 1], drawn[:, :, ends - 1 : ends + 1])


def test_a_patch_of_one_column_is_drawn() -> None:
    drawn = np.ones((3, 9, 1), np.float32)
    soften(drawn, drawn[0] > 0, 1.0, 1.0)
    assert (drawn == 1).all()


def soften(drawn: NDArray[np.float32], face: NDArray[np.bool_], jump: float, share: float) -> None:
    _soften((drawn[0], drawn[1], drawn[2]), face, jump, share)


TO_PICTURE = np.array([[2.0, 0, 0], [0, 2, 0]])


@pytest.mark.parametrize("side", [1, -1])
def test_the_silhouette_is_that_of_the_side_that_turns_away(face: SourceFace, mesh: HeadMesh, side: int) -> None:
    target = turned(face, side * 30)
    silhouette = mesh.silhouette(target.landmarks, target.pose, TO_PICTURE)
    assert silhouette is not None
    points = target.landmarks[mesh.face.members] @ TO_PICTURE[:, :2].T
    outward, ends = side * points[:, 0], side * silhouette.edges[..., 0]
    assert ends.max() == pytest.approx(outward.max())
    assert ends.min() > outward.min() + 0.2 * np.ptp(outward)
    assert side * silhouette.edges[silhouette.hiding > 0.99][..., 0].mean() > outward.max() - 0.15 * np.ptp(outward)
    assert np.ptp(silhouette.edges[silhouette.shares > 0.9][..., 1]) > 0.6 * np.ptp(points[:, 1])
    chin = points[mesh.face.members == CHIN][0]
    near_chin = np.linalg.norm(silhouette.edges.mean(axis=1) - chin, axis=1) < 0.1 * np.ptp(points[:, 1])
    assert not near_chin.any()


def test_what_is_behind_a_far_cheek_is_left_out_once_no_ear_is_in_sight(face: SourceFace, mesh: HeadMesh) -> None:
    """Nothing at the forehead or below the jaw, at any turn."""
    hidden = {}
    for yaw in (10, 20, 30):
        target = turned(face, yaw)
        silhouette = mesh.silhouette(target.landmarks, target.pose, TO_PICTURE)
        assert silhouette is not None
        hidden[yaw] = silhouette.hiding.max()
        heights = silhouette.edges[..., 1].mean(axis=1)
        eyes = TO_PICTURE[1, 1] * face.scheme.eye_centers(target.landmarks.astype(np.float32))[:, 1].mean()
        chin = heights.max()
        assert (silhouette.hiding[heights < eyes - 0.6 * (chin - eyes)] == 0).all()
        assert (silhouette.hiding[heights > eyes + 0.8 * (chin - eyes)] == 0).all()
    assert hidden[10] == 0
    assert 0 < hidden[20] < 1
    assert hidden[30] == 1


@pytest.mark.parametrize("yaw", [0, 4])
def test_a_face_that_hardly_turns_has_no_silhouette_to_draw(face: SourceFace, mesh: HeadMesh, yaw: float) -> None:
    target = turned(face, yaw)
    assert mesh.silhouette(target.landmarks, target.pose, TO_PICTURE) is None
    alone = triangulate_head(face, np.zeros((0, 2)))
    target = turned(face, 30)
    assert alone.silhouette(target.landmarks, target.pose, TO_PICTURE) is None


def test_an_ear_is_in_sight_by_how_far_its_side_has_turned_away(face: SourceFace) -> None:
    def seen(turn: float, roll: float = 0.0, away: float = 1.0) -> float:
        return ear_in_sight(replace(face.pose, rotation=rotation_from_angles(turn, 0, roll)), away)

    assert seen(0) == pytest.approx(2)
    assert seen(np.degrees(np.arctan(0.5))) == pytest.approx(0, abs=1e-9)
    assert seen(-20, away=-1) == pytest.approx(seen(20))
    assert seen(15, away=-5) > 2.5
    assert seen(15, roll=30) == pytest.approx(seen(15))
