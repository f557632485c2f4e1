"""Importing one-light pictures with known directions (an .lp file) as samples."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from relit_camera.base.errors import LightsError
from relit_camera.base.images.color import Gamma
from relit_camera.base.images.image_files import read_linear, read_mask
from relit_camera.base.images.image_types import Mask
from relit_camera.capture.lights_file import read_lights
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.subject.subject import MAX_SIDE_PX, MIN_SIDE_PX

MATTE_NAME = "matte.png"


def import_samples(
    lights: Path, gamma: Gamma = "srgb", progress: Callable[[int, int], None] = lambda done, total: None
) -> OlatSamples:
    """Read the pictures that an .lp file names, and matte.png beside it; without a matte all of the picture counts.

    Args:
        lights: the .lp file.
        gamma: the curve that the pictures are encoded with.
        progress: called with the count of pictures read and the total.

    Raises:
        LightsError: the .lp is wrong, two pictures differ in size, they are too small or too large for a
            subject, or all are black where the matte is.
        ImageError: a picture cannot be read.
    """
    listed = read_lights(lights)
    first = read_linear(listed[0].path, gamma)
    height, width = first.shape[:2]
    if min(height, width) < MIN_SIDE_PX or max(height, width) > MAX_SIDE_PX:
        what = f"{listed[0].path} is {width}x{height}, a subject has {MIN_SIDE_PX} to {MAX_SIDE_PX} pixels a side"
        raise LightsError(what, "give pictures, and a matte, of such a size")
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
    matte = _matte(lights.parent / MATTE_NAME, first.shape[:2])
    if not pictures[:, matte > 0.5].any():
        what = f"all pictures of {lights} are black where {MATTE_NAME} is white"
        raise LightsError(what, f"white must mark the person: check {MATTE_NAME}")
    directions = np.stack([light.direction for light in listed])
    return OlatSamples(pictures, directions, matte)


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
