"""Refinement of transforms by aligning crops, by their pixels, to the picture predicted for each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float64Array, Indices
from relit_camera.base.images.color import srgb_decode
from relit_camera.capture.alignment.rigid_transform import RigidTransform, transforms_from_array, transforms_to_array
from relit_camera.capture.alignment.template_alignment import align_across_lights, align_to_mean, gaussian_blur
from relit_camera.capture.film.stabilization.face_crops import FaceCrops


@dataclass(frozen=True)
class RefinementTunables:
    """How crops are aligned; `relit evaluate stabilisation` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        feature_radius: fraction of the face's radius within which pixels count: features, and not the background at
            the outline.
        blur_px: standard deviation of the Gaussian that reduces noise.
        min_correlation: correlation with the mean below which a frame does not show the face.
        rounds: of predicting and aligning bright frames.
    """

    feature_radius: float = 0.6
    blur_px: float = 1.0
    min_correlation: float = 0.6
    rounds: int = 2


_TUNABLES = RefinementTunables()


def align_dark(dark: FaceCrops) -> tuple[list[RigidTransform], NDArray[np.bool_]]:
    """Align dark frames to their mean.

    Returns:
        Transforms from each frame to the first dark one, and a mask (count,) of the frames that do not show the face.
    """
    weights = dark.window.disc(dark.circle, _TUNABLES.feature_radius)
    squares = [gaussian_blur(square.astype(np.float32), _TUNABLES.blur_px) for square in dark.codes]
    small, mean = align_to_mean(squares, weights, [RigidTransform()] * len(squares))
    correlation = np.array([mean.correlation(square, each) for square, each in zip(squares, small, strict=True)])
    found = [rough.then(dark.window.in_picture(each)) for rough, each in zip(dark.transforms, small, strict=True)]
    return found, correlation < _TUNABLES.min_correlation


def align_bright(
    bright: FaceCrops, by_time: Sequence[RigidTransform], flash: Indices, unsteady: Float64Array
) -> list[RigidTransform]:
    """Align bright frames to pictures that those of other flashes predict for their light.

    Alignment under changing light has errors of its own, so corrections are scaled by a Wiener filter (Wiener 1949):
    the expected variance, half way between two dark frames a quarter of that at a dark frame, over that of the
    corrections.

    Args:
        bright: crops of the frames.
        by_time: their transforms by interpolation between dark frames.
        flash: (count,) number of each frame's flash.
        unsteady: (3,) root mean square of rotation and shifts by which dark frames differ from such interpolation.

    Returns:
        Transforms like `by_time`.
    """
    window = bright.window
    remaining = [rough.inverse().then(each) for rough, each in zip(bright.transforms, by_time, strict=True)]
    start = [window.in_window(each) for each in remaining]
    light = srgb_decode(bright.codes.astype(np.float32))
    aligned = align_across_lights(
        light, window.disc(bright.circle, _TUNABLES.feature_radius), start, flash, _TUNABLES.rounds
    )
    correction = transforms_to_array(aligned) - transforms_to_array(start)
    gain = np.clip(unsteady**2 / 16 / np.maximum(correction.var(axis=0), 1e-12), 0, 1)
    corrected = transforms_from_array(transforms_to_array(start) + gain * correction)
    return [rough.then(window.in_picture(each)) for rough, each in zip(bright.transforms, corrected, strict=True)]
