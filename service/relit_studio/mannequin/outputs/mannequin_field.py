"""Whole reflectance field of the mannequin: one picture for each texel of a light map."""

from __future__ import annotations

import json
from pathlib import Path

from relit_camera.base.images.image_files import write_display, write_linear
from relit_camera.base.storage.atomic_files import write_atomic
from relit_camera.light.directions import texel_directions
from relit_studio.base.progress import Progress, no_progress
from relit_studio.mannequin.outputs.olat import gray, landmarks_px, lights_text
from relit_studio.mannequin.rendering.mannequin_camera import Camera
from relit_studio.mannequin.rendering.renderer import View
from relit_studio.mannequin.shape.figure import Posture


def write_field(folder: Path, size: int, rows: int, progress: Progress = no_progress) -> None:
    """Write the neutral mannequin under a light from each texel of a map of `rows` x 2 `rows`, into an existing folder.

    `0000.exr` … are size x size, linear, not clipped, in the map's order (row by row, from the top). Beside them
    `lights.lp`, `matte.png` and `landmarks.json`, as `write_olat` has them.

    Raises:
        StorageError: a file cannot be written.
    """
    camera, posture = Camera(size), Posture()
    view = View(posture, camera)
    directions = texel_directions(rows, 2 * rows).reshape(-1, 3)
    names = [f"{index:04d}.exr" for index in range(len(directions))]
    for index, (name, direction) in enumerate(zip(names, directions, strict=True)):
        write_linear(folder / name, view.under_light(direction))
        progress(index + 1, len(directions))
    write_atomic(folder / "lights.lp", lights_text(names, directions))
    write_display(folder / "matte.png", gray(view.matte()))
    points = landmarks_px(camera, posture).astype(float).round(3).tolist()
    write_atomic(folder / "landmarks.json", json.dumps({"mesh478": points}))
