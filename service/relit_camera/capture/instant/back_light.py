"""Light from behind, softened: a generic head knows too little to show it as hard as it is."""

from __future__ import annotations

import numpy as np

from relit_camera.base.array_types import Float32Array
from relit_camera.light.directions import texel_solid_angles
from relit_camera.subject.reflectance_field import texel_vectors
from relit_camera.subject.rungs import SOFT_FROM_DEG

SOFTEST_DEG, SOFTEST_FROM_DEG = 20.0, 120.0
"""The widest light's standard deviation, and the angle from the camera from which on lights have it.

On a rendered man whose field is known (`python -m tests.lone_lamps`; docs/desk.md) this takes away dark blotches on the
cheeks that no face has, and is better by half a decibel in places most of whose light comes from behind. Under one lamp
more than 120° from the camera it costs up to 0.5 dB of linear light, and 3 to 4 of what is displayed: the face glows
where it should be black."""
SHARPEST_DEG = 1.5
"""Width of a light that is not widened: less than a texel."""


def soften_back_light(coefficients: Float32Array) -> Float32Array:
    """Coefficients (components, 2048) of a field that sees each light as wide as a generic head can be trusted with.

    A light beyond `SOFT_FROM_DEG` is seen as if its energy came from a wider disc about its direction. Nothing is to be
    done while the camera runs: relighting is linear, so the widening is in the field.
    """
    toward = texel_vectors()
    angles = np.degrees(np.arccos(np.clip(toward[:, 2], -1, 1)))
    share = np.clip((angles - SOFT_FROM_DEG) / (SOFTEST_FROM_DEG - SOFT_FROM_DEG), 0, 1)
    width = np.radians(np.maximum(share * SOFTEST_DEG, SHARPEST_DEG))
    spread = np.exp((toward @ toward.T - 1) / np.square(width)[:, None]) * texel_solid_angles().reshape(-1)
    spread /= spread.sum(axis=1, keepdims=True)
    spread[share == 0] = np.eye(len(toward))[share == 0]
    return np.asarray(coefficients @ spread.T, np.float32)
