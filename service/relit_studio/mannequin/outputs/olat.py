"""One-light pictures of the mannequin (OLAT), as `relit capture import` reads them, and their truth."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import uint8_from_linear
from relit_camera.base.images.image_files import write_display
from relit_camera.base.images.image_types import Mask
from relit_camera.base.storage.atomic_files import atomic_path, write_atomic
from relit_camera.light.directions import fibonacci_directions
from relit_studio.base.progress import Progress, no_progress
from relit_studio.mannequin.rendering.mannequin_camera import Camera
from relit_studio.mannequin.rendering.renderer import View
from relit_studio.mannequin.shape.figure import Posture, mannequin


def landmarks_px(camera: Camera, posture: Posture) -> NDArray[np.float32]:
    """The points of scheme mesh478 in the picture, (478, 2) float32 pixels, centers at integers + ½."""
    return camera.project(mannequin().landmarks(posture))[:, :2].astype(np.float32)


def write_olat(folder: Path, size: int = 192, lights: int = 96, progress: Progress = no_progress) -> None:
    """Write the neutral mannequin under each of `lights` lights into an existing folder.

    `000.png` … are size x size, 8-bit sRGB over black, under lights of unit irradiance: a white wall that faces the
    light reads 255. Beside them `lights.lp`, `matte.png` (straight alpha), `landmarks.json` (`{"mesh478": [[x, y], …]}`
    in pixels) and `truth.npz` (normals, linear albedo, depth in centimeters toward the camera; float32).

    Raises:
        StorageError: a file cannot be written.
    """
    camera, posture = Camera(size), Posture()
    view = View(posture, camera)
    directions = fibonacci_directions(lights)
    names = [f"{index:03d}.png" for index in range(lights)]
    for index, (name, direction) in enumerate(zip(names, directions, strict=True)):
        write_display(folder / name, uint8_from_linear(view.under_light(direction)))
        progress(index + 1, lights)
    write_atomic(folder / "lights.lp", lights_text(names, directions))
    write_display(folder / "matte.png", gray(view.matte()))
    points = landmarks_px(camera, posture).astype(np.float64).round(3).tolist()
    write_atomic(folder / "landmarks.json", json.dumps({"mesh478": points}))
    with atomic_path(folder / "truth.npz") as temporary:
        np.savez_compressed(temporary, normals=view.normals(), albedo=view.albedo(), depth=view.depth())


def light_names(count: int) -> list[str]:
    """Names of the linear pictures of `count` lights: 000.exr …, in order by name as well."""
    digits = len(str(count - 1))
    return [f"{index:0{digits}d}.exr" for index in range(count)]


def lights_text(names: Sequence[str], directions: NDArray[np.float64]) -> str:
    """An .lp file: the count, then each picture's name and unit vector (count, 3)."""
    lines = [f"{name} {x:.7f} {y:.7f} {z:.7f}" for name, (x, y, z) in zip(names, directions, strict=True)]
    return "\n".join([str(len(lines)), *lines, ""])


def gray(matte: Mask) -> NDArray[np.uint8]:
    """A matte (height, width) as a picture."""
    return np.repeat(np.round(matte * 255).astype(np.uint8)[..., None], 3, axis=2)
