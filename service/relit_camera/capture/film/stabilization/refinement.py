"""What corners and time leave, removed by aligning pictures to what they are predicted to look like."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import srgb_decode
from relit_camera.capture.alignment.rigid_transform import RigidTransform, transforms_from_array, transforms_to_array
from relit_camera.capture.alignment.template_alignment import align_across_lights, align_to_mean, gaussian_blur
from relit_camera.capture.film.stabilization.face_crops import FaceCrops

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

_COUNTED = 0.6
"""Share of the face's radius that counts: features, not the outline, where the background does not move along."""
_NOISE_PX = 1.0
_LEAST_LIKENESS = 0.6
"""Correlation with the mean below which a frame shows no face there."""
_ROUNDS = 2


def align_dark(dark: FaceCrops) -> tuple[list[RigidTransform], NDArray[np.bool_]]:
    """Dark frames aligned to their mean, which is what each is predicted to look like.

    Returns:
        Transforms from each frame to the first one that was followed, and (count,) which frames are unlike the mean.
    """
    weights = dark.window.disc(dark.circle, _COUNTED)
    squares = [gaussian_blur(square.astype(np.float32), _NOISE_PX) for square in dark.codes]
    small, mean = align_to_mean(squares, weights, [RigidTransform()] * len(squares))
    correlation = np.array([mean.correlation(square, each) for square, each in zip(squares, small, strict=True)])
    found = [rough.then(dark.window.in_picture(each)) for rough, each in zip(dark.transforms, small, strict=True)]
    return found, correlation < _LEAST_LIKENESS


def align_bright(
    bright: FaceCrops, by_time: Sequence[RigidTransform], flash: Indices, unsteady: Floats
) -> list[RigidTransform]:
    """Bright frames aligned to what those of other flashes predict for their light.

    Alignment under changing light has errors of its own. Of the corrections' variance as much is believed as the dark
    frames leave room for: half way between two of them a quarter of theirs (Wiener 1949).

    Args:
        bright: the frames.
        by_time: their transforms by interpolation between dark frames.
        flash: (count,) number of each one's flash.
        unsteady: (3,) RMS by which dark frames differ from interpolation between others.

    Returns:
        Transforms like `by_time`.
    """
    window = bright.window
    left = [rough.inverse().then(each) for rough, each in zip(bright.transforms, by_time, strict=True)]
    start = [window.in_window(each) for each in left]
    light = srgb_decode(bright.codes.astype(np.float32))
    aligned = align_across_lights(light, window.disc(bright.circle, _COUNTED), start, flash, _ROUNDS)
    correction = transforms_to_array(aligned) - transforms_to_array(start)
    believed = np.clip(unsteady**2 / 16 / np.maximum(correction.var(axis=0), 1e-12), 0, 1)
    corrected = transforms_from_array(transforms_to_array(start) + believed * correction)
    return [rough.then(window.in_picture(each)) for rough, each in zip(bright.transforms, corrected, strict=True)]
