"""The transport solver against what can be worked out by hand, and the reduced field that it makes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from relit_camera.capture.picture_import import import_samples
from relit_camera.light.directions import direction_from_degrees, texel_directions, texel_solid_angles
from relit_studio.cameras.pinhole import Pinhole
from relit_studio.field.solver_gloss import glossy
from relit_studio.field.solver_scene import Surfaces
from relit_studio.field.solver_transport import bounce_light, transport
from relit_studio.field.transport_solver import SolverSettings, solve, write_solver_field
from relit_studio.mannequin.shape.mesh import grid_triangles

pytestmark = pytest.mark.slow

CAMERA = Pinhole(48, 36, 60.0)
SETTINGS = SolverSettings(bounces=1, bundles=24, rays=64, supersampling=2, shadow=240)
AWAY = np.array([0.0, 0.0, -50.0])


def surfaces(vertices: np.ndarray, normals: np.ndarray, triangles: np.ndarray, albedo: float) -> Surfaces:
    count = len(vertices)
    plain = np.zeros(count, np.float32)
    return Surfaces(
        vertices=vertices.astype(np.float32),
        normals=normals.astype(np.float32),
        triangles=triangles,
        casters=triangles,
        albedo=np.full((count, 3), albedo, np.float32),
        f0=plain,
        alpha=plain + 0.3,
    )


def ball(albedo: float, radius: float = 9.0) -> Surfaces:
    polar, around = np.linspace(0, np.pi, 36)[:, None], np.linspace(-np.pi, np.pi, 72, endpoint=False)
    normals = np.stack([np.sin(polar) * np.sin(around), np.cos(polar) + 0 * around, np.sin(polar) * np.cos(around)], -1)
    normals = normals.reshape(-1, 3)
    return surfaces(AWAY + radius * normals, normals, grid_triangles(36, 72, closed=True), albedo)


def bowl() -> tuple[np.ndarray, np.ndarray]:
    """The inside of a hemisphere of radius 1 that opens toward the camera: vertices, triangles."""
    polar, around = np.linspace(0, np.pi / 2, 32)[:, None], np.linspace(-np.pi, np.pi, 64, endpoint=False)
    shape = np.stack([np.sin(polar) * np.sin(around), np.sin(polar) * np.cos(around), -np.cos(polar) + 0 * around], -1)
    triangles = grid_triangles(32, 64, closed=True)
    vertices = shape.reshape(-1, 3).astype(np.float32)
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    inward = (np.cross(b - a, c - a) * -(a + b + c)).sum(axis=1)
    triangles[inward < 0] = triangles[inward < 0][:, ::-1]
    return vertices, triangles


def white_sky(rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Directions over the whole sphere and weights under which a white wall reads 1 everywhere."""
    return texel_directions(rows, 2 * rows).reshape(-1, 3), texel_solid_angles(rows, 2 * rows).ravel() / np.pi


def test_white_convex_body_in_a_white_room_reads_one() -> None:
    directions, weights = white_sky(8)
    solved = solve(ball(1.0), CAMERA, directions, SETTINGS)
    furnace = np.tensordot(weights, solved.pictures, axes=1)[solved.matte == 1]
    assert furnace.mean() == pytest.approx(1, abs=0.015)
    # Near the outline lights graze and the shadow map's texels tell.
    assert np.percentile(np.abs(furnace - 1), 95) < 0.05


def test_hemispherical_bowl_sees_itself_and_the_sky_half_and_half() -> None:
    # Any two points inside a sphere see each other alike, so half the sphere fills half of each view.
    vertices, triangles = bowl()
    between = transport(vertices, triangles, directions=200, size=96)
    inner = vertices[:, 2] < -0.1
    seen = np.asarray(between.form_factors.sum(axis=1)).ravel()
    assert between.sky[inner].mean() == pytest.approx(0.5, abs=0.02)
    assert seen[inner].mean() == pytest.approx(0.5, abs=0.02)
    np.testing.assert_allclose((seen + between.sky)[inner], 1, atol=0.06)


@pytest.mark.parametrize("albedo", [1.0, 0.5])
def test_bowl_in_a_white_room_reads_what_all_its_bounces_add_up_to(albedo: float) -> None:
    # B = ρ (½ + ½ B): a white bowl loses nothing and reads 1, whatever its shape.
    vertices, triangles = bowl()
    between = transport(vertices, triangles, directions=200, size=96)
    every = np.full((len(vertices), 3), albedo, np.float32)
    sky = between.sky[:, None]
    reading = albedo * (sky[..., None] + bounce_light(sky, every, between, bounces=40))[:, 0, 0]
    inner = vertices[:, 2] < -0.1
    assert reading[inner].mean() == pytest.approx(albedo * 0.5 / (1 - albedo * 0.5), rel=0.02)


def test_one_bounce_more_adds_light_and_less_each_time() -> None:
    vertices, triangles = bowl()
    between = transport(vertices, triangles, directions=60, size=64)
    every = np.full((len(vertices), 3), 0.6, np.float32)
    sums = [float(bounce_light(between.sky[:, None], every, between, count).sum()) for count in range(5)]
    steps = np.diff(sums)
    assert sums[0] == 0
    assert (steps > 0).all()
    np.testing.assert_allclose(steps[1:] / steps[:-1], 0.3, atol=0.03)


def test_glossy_surface_over_white_gives_back_what_it_gets_and_no_more() -> None:
    directions, weights = white_sky(32)
    normals = np.tile(np.array([0, 0, 1], np.float32), (3, 1))
    tilt = np.radians([0, 45, 75])
    views = np.stack([np.sin(tilt), 0 * tilt, np.cos(tilt)], axis=1).astype(np.float32)
    for f0, alpha in ((0.04, 0.15), (0.04, 0.5), (0.9, 0.4)):
        kinds = np.full(3, f0, np.float32), np.full(3, alpha, np.float32)
        parts = [glossy(normals, views, direction, *kinds) for direction in directions]
        gloss, base = (np.tensordot(weights, np.array([part[i] for part in parts]), axes=1) for i in range(2))
        assert (gloss + base <= 1.01).all()
        assert (gloss + base >= 0.98).all()
        assert (gloss > 0.6 * f0).all()


def test_lambertian_patch_reads_albedo_times_cosine() -> None:
    x, y = np.meshgrid(np.linspace(-30, 30, 9), -np.linspace(-30, 30, 9))
    vertices = np.stack([x, y, np.full_like(x, -50.0)], axis=-1).reshape(-1, 3)
    wall = surfaces(vertices, np.tile([0, 0, 1.0], (81, 1)), grid_triangles(9, 9), 0.4)
    directions = direction_from_degrees([0, 40, -65, 0, 170], [0, 10, 30, 80, 0])
    solved = solve(wall, CAMERA, directions, SETTINGS)
    for picture, direction in zip(solved.pictures, directions, strict=True):
        np.testing.assert_allclose(picture[4:-4, 4:-4], 0.4 * max(direction[2], 0), atol=1e-4)


def test_shadow_edge_in_the_picture_lies_where_geometry_puts_it() -> None:
    # A square of 8 cm hovers 6 cm before a wall 50 cm away, lit from 45 degrees at the right.
    x, y = np.meshgrid(np.linspace(-30, 30, 21), -np.linspace(-30, 30, 21))
    wall = np.stack([x, y, np.full_like(x, -50.0)], axis=-1).reshape(-1, 3)
    square = np.array([[-4, 4, -44], [4, 4, -44], [-4, -4, -44], [4, -4, -44]], float)
    triangles = np.concatenate([grid_triangles(21, 21), grid_triangles(2, 2) + len(wall)])
    vertices = np.concatenate([wall, square])
    scene = surfaces(vertices, np.tile([0, 0, 1.0], (len(vertices), 1)), triangles, 0.5)
    fine = Pinhole(192, 144, 240.0)
    row = solve(scene, fine, direction_from_degrees([45], [0]), replace(SETTINGS, shadow=1200)).pictures[0][72, :, 0]
    wall_x = (np.arange(192) + 0.5 - 96) / 240.0 * 50
    dark = wall_x[row < 0.5 * row.max()]
    # The shadow's left edge is at -4 - 6; its right one, at 4 - 6, hides behind the square, whose left edge is seen at
    # -4 · 50 / 44.
    assert dark.min() == pytest.approx(-10, abs=0.2)
    assert dark.max() == pytest.approx(-4 * 50 / 44, abs=0.2)


@pytest.fixture(scope="module")
def reduced(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("reduced")
    write_solver_field(folder, SolverSettings(bundles=80, rays=96, supersampling=2, shadow=320))
    return folder


def test_reduced_field_is_imported_as_it_was_solved(reduced: Path) -> None:
    samples = import_samples(reduced / "lights.lp")
    assert samples.pictures.shape == (128, 48, 64, 3)
    np.testing.assert_allclose(samples.directions, texel_directions(8, 16).reshape(-1, 3), atol=1e-6)
    assert samples.pictures.min() >= 0
    assert not samples.pictures[:, samples.matte == 0].any()
    front = samples.pictures[np.argmax(samples.directions @ [0, 0, 1])]
    right, left = (samples.pictures[np.argmax(samples.directions @ [side, 0, 0.2])] for side in (1, -1))
    assert front.sum() > right.sum()
    assert right[:, 32:].sum() > 3 * right[:, :32].sum()
    assert left[:, :32].sum() > 3 * left[:, 32:].sum()


def test_reduced_field_keeps_energy_and_agrees_with_its_truth(reduced: Path) -> None:
    samples = import_samples(reduced / "lights.lp")
    with np.load(reduced / "truth.npz") as truth:
        albedo, normals, depth = truth["albedo"], truth["normals"], truth["depth"]
    inside = samples.matte == 1
    weights = texel_solid_angles(8, 16).ravel() / np.pi
    furnace = np.tensordot(weights, samples.pictures, axes=1)[inside]
    # Gloss of a few percent aside, nothing gives back more than its albedo, and what faces the camera not much less.
    assert (furnace <= albedo[inside] + 0.16).all()
    frontal = normals[inside][:, 2] > 0.9
    assert np.median((furnace / albedo[inside])[frontal]) == pytest.approx(1, abs=0.15)
    assert np.abs(np.linalg.norm(normals[inside], axis=1) - 1).max() < 1e-3
    assert depth.max() == pytest.approx(7.5, abs=0.6)


def test_the_same_settings_give_the_same_field(tmp_path: Path) -> None:
    settings = SolverSettings(width=32, height=24, map_rows=2, bundles=8, rays=32, supersampling=1, shadow=96)
    for name in ("a", "b"):
        write_solver_field(tmp_path / name, settings)
    for path in sorted((tmp_path / "a").iterdir()):
        assert path.suffix == ".npz" or path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()
