"""Hands: round cones around the bones, blended smoothly."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from relit_camera.base.array_types import Float64Array
from relit_studio.people.props.mug import RADIUS_CM
from relit_studio.people.props.solids import Blob, Solid, union_surface

_STEP_CM = 0.26
_FINGER_CREASE, _PALM_CREASE, _JOIN = 0.1, 0.45, 0.3
"""Softness of the creases between fingers, in the palm, and where they meet, in centimeters."""

GRIP_WRIST = np.array([-9.4, -1.2, -4.6])
"""Wrist of the hand that holds the mug, in the mug's axes; its arm continues along `_GRIP_ARM`."""
_GRIP_ARM = np.array([-0.5, -0.8, -0.33])
_OPEN_ARM = np.array([0.0, -1.0, 0.0])
_STUB_CM = 5.0
"""Length of a hand inside its sleeve."""


@cache
def gripping_hand() -> Solid:
    """The subject's right hand about the mug, from the picture's left, in the mug's axes."""
    # Height and fraction of length of index, middle, ring and little finger.
    fingers = [
        _wrapped(height, length, thickness)
        for height, length, thickness in ((7.35, 0.95, 1.02), (5.5, 1.03, 1.05), (3.7, 0.97, 1), (2.05, 0.8, 0.88))
    ]
    knuckles = [finger[0] for finger in fingers]
    palm = [
        _metacarpal(GRIP_WRIST, knuckle, across) for knuckle, across in zip(knuckles, (2, 0.8, -0.6, -2), strict=True)
    ]
    thumb = _chain((-8.2, 2.2, -4.4, 1.3), (-6.7, 5.0, -4.0, 1.15), (-5.4, 6.9, -3.1, 0.95), (-3.6, 8.1, -3.3, 0.8))
    return union_surface(
        [Blob(tuple(fingers), _FINGER_CREASE), Blob((*palm, thumb, _stub(GRIP_WRIST, _GRIP_ARM)), _PALM_CREASE)],
        _JOIN,
        _STEP_CM,
    )


@cache
def open_hand() -> Solid:
    """The subject's left hand, its back to the camera, fingers up, the wrist at the origin."""
    fingers = [
        _straight(x, y, lean, length, thickness)
        for x, y, lean, length, thickness in (
            (2.75, 8.7, 0.10, 0.93, 1.08), (0.95, 9.1, 0.03, 1.03, 1.1), (-0.85, 8.8, -0.05, 0.96, 1.05),
            (-2.5, 8.0, -0.16, 0.77, 0.93),
        )
    ]  # fmt: skip
    palm = [
        _chain((across, 0.6, 0, 1.35), (*finger[0, :3], 1.0))
        for across, finger in zip((1.1, 0.4, -0.4, -1.1), fingers, strict=True)
    ]
    thumb = _chain((1.3, 1.5, -0.4, 1.35), (3.4, 4.0, -1.0, 1.2), (5.0, 6.2, -1.4, 0.95), (6.0, 8.4, -1.7, 0.78))
    return union_surface(
        [Blob(tuple(fingers), _FINGER_CREASE), Blob((*palm, thumb, _stub(np.zeros(3), _OPEN_ARM)), _PALM_CREASE)],
        _JOIN,
        _STEP_CM,
    )


def _wrapped(height_cm: float, length: float, thickness: float) -> Float64Array:
    """A finger round the mug, from the knuckle at its left over its front."""
    angles = np.radians(-8) + np.radians([0, 50, 82, 106]) * [1, length, length, length]
    distance = RADIUS_CM + np.array([1.75, 1.1, 0.78, 0.66])
    heights = height_cm + np.array([-0.5, 0.05, 0.1, 0.1])
    radii = thickness * np.array([0.95, 0.86, 0.78, 0.66])
    return np.stack([-distance * np.cos(angles), heights, distance * np.sin(angles), radii], axis=1)


def _straight(x: float, y: float, lean: float, length: float, thickness: float) -> Float64Array:
    """A finger that points up and bends a little toward the palm."""
    along = length * np.array([0, 4.3, 6.8, 8.6])
    bend = length * np.array([0, -0.35, -1.0, -1.9])
    radii = thickness * np.array([0.95, 0.84, 0.76, 0.64])
    return np.stack([x + lean * along, y + along, bend, radii], axis=1)


def _metacarpal(wrist: Float64Array, knuckle: Float64Array, across: float) -> Float64Array:
    """From the wrist, `across` of its middle toward the thumb, to a knuckle."""
    side = np.array([-0.25, 0.85, -0.45]) * across * 0.55
    return _chain((*(wrist + side), 1.3), (*knuckle[:3], 1.0))


def _stub(wrist: Float64Array, arm: Float64Array) -> Float64Array:
    end = wrist + _STUB_CM * arm / np.linalg.norm(arm)
    return _chain((*(wrist - 0.6 * arm), 2.0), (*wrist, 2.1), (*end, 2.5))


def _chain(*spheres: ArrayLike) -> Float64Array:
    return np.array(spheres, np.float64)
