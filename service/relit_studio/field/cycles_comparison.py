"""Renders the transport solver's scene with Cycles, with the same surfaces, camera and lights, for comparison."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from relit_camera.base.storage.atomic_files import write_atomic
from relit_camera.light.directions import texel_directions
from relit_studio.base.progress import Progress, no_progress
from relit_studio.base.resume import keep_settings
from relit_studio.cameras.studio_camera import Camera
from relit_studio.cycles.job import DistantLight, Mesh, Picture, Quality, Scene
from relit_studio.cycles.runner import render
from relit_studio.field.solver_scene import Surfaces, mannequin_surfaces
from relit_studio.field.transport_solver import BELOW_AXIS_CM, DISTANCE_CM, HEIGHT_CM, SolverSettings
from relit_studio.mannequin.outputs.olat import light_names, lights_text


def solver_scene_for_cycles(surfaces: Surfaces) -> Scene:
    """Scene for Cycles of surfaces in room axes. Cycles uses its own smooth normals."""
    triangles = np.asarray(surfaces.triangles)
    names = ("red", "green", "blue")
    colors = {name: surfaces.albedo[:, channel] for channel, name in enumerate(names)}
    mesh = Mesh(
        name="surfaces",
        vertices=surfaces.vertices,
        faces=np.column_stack([triangles, np.full(len(triangles), -1)]),
        slots=np.zeros(len(triangles)),
        materials=("painted",),
        attributes={**colors, "f0": surfaces.f0, "alpha": surfaces.alpha},
    )
    return Scene((mesh,), {"painted": {"kind": "painted"}})


def twin_camera(settings: SolverSettings) -> Camera:
    """The solver's camera, in room axes."""
    return Camera(settings.height, settings.width, DISTANCE_CM, HEIGHT_CM, BELOW_AXIS_CM)


def render_solver_scene(
    folder: Path, settings: SolverSettings, quality: Quality, progress: Progress = no_progress
) -> dict[str, float]:
    """Render the field that `write_solver_field` solves, except existing pictures; returns the seconds of each.

    Raises:
        InputError: the folder holds a field of other settings.
        DeviceError: Cycles is not set up, or fails.
        StorageError: the folder cannot be written.
    """
    # As the solver averages its samples.
    quality = replace(quality, pixel_filter="BOX")
    described = {"width": settings.width, "height": settings.height, "map_rows": settings.map_rows}
    keep_settings(folder, "field.json", {"person": "mannequin", **described, "quality": quality.settings()})
    directions = texel_directions(settings.map_rows, 2 * settings.map_rows).reshape(-1, 3)
    names = light_names(len(directions))
    write_atomic(folder / "lights.lp", lights_text(names, directions))
    pictures = [
        Picture(folder / name, DistantLight((x, y, z), size_deg=0.0))
        for name, (x, y, z) in zip(names, directions.tolist(), strict=True)
    ]
    return render(
        solver_scene_for_cycles(mannequin_surfaces(np.zeros(3))), twin_camera(settings), quality, pictures, progress
    )
