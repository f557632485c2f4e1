"""One-light pictures with known directions → samples."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from relit_camera.capture.lights_file import read_lights
from relit_camera.errors import LightsError
from relit_camera.reflectance.samples import Samples
from relit_camera.space.colour import Gamma
from relit_camera.space.images import Mask
from relit_camera.space.picture_files import read_linear, read_mask

MATTE_NAME = "matte.png"


def import_samples(
    lights: Path, gamma: Gamma = "srgb", progress: Callable[[int, int], None] = lambda done, total: None
) -> Samples:
    """Read the pictures that an .lp file names, and the matte.png beside it; without one, all of the picture counts.

    Args:
        lights: the .lp file.
        gamma: the pictures' curve.
        progress: called with the count of pictures read and the total.

    Raises:
        LightsError: the .lp is wrong, two pictures differ in size, or all are black.
        ImageError: a picture cannot be read.
    """
    listed = read_lights(lights)
    first = read_linear(listed[0].path, gamma)
    pictures = np.empty((len(listed), *first.shape), dtype=np.float32)
    for index, light in enumerate(listed):
        picture = first if index == 0 else read_linear(light.path, gamma)
        if picture.shape != first.shape:
            sizes = [f"{p.shape[1]}x{p.shape[0]}" for p in (picture, first)]
            raise LightsError(f"{light.path} is {sizes[0]}, {listed[0].path.name} is {sizes[1]}", "align them first")
        pictures[index] = picture
        progress(index + 1, len(listed))
    if not pictures.any():
        raise LightsError(f"all pictures of {lights} are black", "check the capture")
    directions = np.stack([light.direction for light in listed])
    return Samples(pictures, directions, _matte(lights.parent / MATTE_NAME, first.shape[:2]))


def _matte(path: Path, shape: tuple[int, ...]) -> Mask:
    if not path.is_file():
        return np.ones(shape, dtype=np.float32)
    matte = read_mask(path)
    if matte.shape != shape:
        raise LightsError(
            f"{path} is {matte.shape[1]}x{matte.shape[0]}, the pictures are {shape[1]}x{shape[0]}",
            "scale it to their size, or take it away",
        )
    if not (matte > 0.5).any():
        raise LightsError(f"{path} is empty", "white must mark the person")
    return matte
