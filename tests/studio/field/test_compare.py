"""Two renderings of one field: what the comparison says of known differences, and the scene that both render."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.errors import InputError
from relit_camera.base.images.image_files import write_linear
from relit_camera.light.directions import fibonacci_directions
from relit_studio.cycles.job import Mesh
from relit_studio.field.cycles_comparison import solver_scene_for_cycles, twin_camera
from relit_studio.field.field_comparison import compare_fields
from relit_studio.field.solver_scene import mannequin_surfaces
from relit_studio.field.transport_solver import BELOW_AXIS_CM, DISTANCE_CM, SolverSettings, solver_camera
from relit_studio.mannequin.outputs.olat import lights_text

LIGHTS, SIDE = 12, 16


def write_field(folder: Path, gain: float = 1.0, error: float = 0.0, lights: int = LIGHTS, side: int = SIDE) -> Path:
    """A field of random pictures within 0..1, the same each time, but for a gain, and an error of that RMS."""
    folder.mkdir()
    rng = np.random.default_rng(3)
    names = [f"{index:02d}.exr" for index in range(lights)]
    for name in names:
        picture = rng.uniform(0.2, 0.8, (side, side, 3))
        noise = rng.choice([-1.0, 1.0], picture.shape) * error
        write_linear(folder / name, (gain * picture + noise).astype(np.float32))
    (folder / "lights.lp").write_text(lights_text(names, fibonacci_directions(lights)))
    return folder


def test_known_errors_are_told(tmp_path: Path) -> None:
    plain = write_field(tmp_path / "plain")
    off = compare_fields(plain, write_field(tmp_path / "off", error=0.01))
    # The peak is the 99.5th percentile of 0.2 .. 0.8.
    assert off.median_db == pytest.approx(20 * np.log10(0.797 / 0.01), abs=0.3)
    assert off.worst_db <= off.median_db
    assert compare_fields(plain, write_field(tmp_path / "double", gain=2)).energy_ratio == pytest.approx(2, rel=1e-3)
    assert compare_fields(plain, plain).worst_db == np.inf


@pytest.mark.parametrize("other", [{"lights": 10}, {"side": 20}])
def test_fields_of_other_lights_or_sizes_are_not_compared(tmp_path: Path, other: dict[str, int]) -> None:
    plain, different = write_field(tmp_path / "plain"), write_field(tmp_path / "other", **other)
    with pytest.raises(InputError, match="render both alike"):
        compare_fields(plain, different)


def test_cycles_gets_the_solvers_surfaces() -> None:
    surfaces = mannequin_surfaces(np.zeros(3))
    (mesh,) = solver_scene_for_cycles(surfaces).objects
    assert isinstance(mesh, Mesh)
    np.testing.assert_array_equal(mesh.faces[:, :3], surfaces.triangles)
    assert (mesh.faces[:, 3] == -1).all()
    np.testing.assert_array_equal(mesh.attributes["green"], surfaces.albedo[:, 1])


def test_both_cameras_see_alike() -> None:
    settings = SolverSettings()
    camera, solver = twin_camera(settings), solver_camera(settings)
    points = mannequin_surfaces(np.zeros(3)).vertices
    placed = points + np.array([0, -BELOW_AXIS_CM, -DISTANCE_CM], np.float32)
    np.testing.assert_allclose(camera.project(points), solver.project(placed)[:, :2], atol=1e-3)


def test_no_light_from_below_shines_through_the_body() -> None:
    """What is lowest faces down and is as large as the body's cross-section: the body is closed below."""
    surfaces = mannequin_surfaces(np.zeros(3))
    corners = surfaces.vertices[surfaces.triangles]
    lowest = corners[corners[..., 1].max(axis=1) < -27.9]
    normals = np.cross(lowest[:, 1] - lowest[:, 0], lowest[:, 2] - lowest[:, 0])
    area = np.linalg.norm(normals, axis=1).sum() / 2
    assert (normals[:, 1] < 0).all()
    assert area == pytest.approx(np.pi * 20.9 * 11.1, rel=0.02)
