"""Whether the light comes from enough directions: films that do not give enough are refused here."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relit_camera.base.array_types import Float64Array
from relit_camera.base.errors import CaptureError
from relit_camera.light.directions import texel_directions, texel_solid_angles

MIN_DIRECTIONS = 40
"""Distinct directions of light that a capture needs."""
DISTINCT_DEG = 1.0
"""Directions less than this apart count as one."""


@dataclass(frozen=True)
class CoverageTunables:
    """Limits of the light's directions; `relit evaluate capture` (docs/evaluate.md) shows what films of less give.

    Attributes:
        one_side_deg: lights within this angle of their mean come from one side only.
        reach_deg: angle about a captured direction within which light is known.
        min_area_sr: least solid angle within which light must be known.
    """

    one_side_deg: float = 20.0
    reach_deg: float = 12.0
    min_area_sr: float = 0.8


_COVERAGE = CoverageTunables()


def covered_solid_angle(vectors: Float64Array) -> float:
    """Solid angle in steradians within reach of directions (count, 3) of any length."""
    directions = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    near = (texel_directions() @ directions.T).max(axis=-1) > np.cos(np.radians(_COVERAGE.reach_deg))
    return float(texel_solid_angles()[near].sum())


def count_distinct_directions(directions: Float64Array) -> int:
    """Number of unit vectors (count, 3), leaving out those within a degree of one that is already counted."""
    kept: list[Float64Array] = []
    for direction in directions:
        if not kept or (np.array(kept) @ direction).max() < np.cos(np.radians(DISTINCT_DEG)):
            kept.append(direction)
    return len(kept)


def require_light_coverage(directions: Float64Array, bright: int) -> None:
    """Check that light comes from enough directions, all round the front.

    Args:
        directions: (count, 3) unit vectors toward the lamp from the head.
        bright: number of the film's bright frames, for the message.

    Raises:
        CaptureError: it does not; the message says what to do.
    """
    if not len(directions):
        raise _too_few(0, bright)
    middle = directions.mean(axis=0)
    middle /= np.linalg.norm(middle)
    angle_deg = np.degrees(np.arccos(np.clip(directions @ middle, -1, 1)))
    if np.percentile(angle_deg, 95) < _COVERAGE.one_side_deg:
        where = "from beside the camera" if middle[2] > np.cos(np.radians(30)) else "from one side"
        within = np.percentile(angle_deg, 90)
        raise CaptureError(
            f"the light comes only {where}: nine in ten flashes are within {within:.0f} degrees",
            "do not use the phone's own lamp: move another around the head, a metre off, left to right and up and down",
        )
    count = count_distinct_directions(directions)
    if count < MIN_DIRECTIONS:
        raise _too_few(count, bright)
    area = covered_solid_angle(directions)
    if area < _COVERAGE.min_area_sr:
        fraction = area / (2 * np.pi)
        raise CaptureError(
            f"the light covers {fraction:.0%} of the space before the face",
            "move it farther: from one ear to the other, from below the chin to above the head",
        )


def _too_few(count: int, bright: int) -> CaptureError:
    return CaptureError(
        f"{count} usable directions of light in {bright} bright frames, {MIN_DIRECTIONS} are needed",
        "film half a minute or more, the lamp moving all the time, the ball unhidden and no bright window in it",
    )
