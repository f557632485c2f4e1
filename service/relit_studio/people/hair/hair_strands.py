"""Hair strands as polylines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from relit_camera.base.array_types import Float64Array


class Hairs(NamedTuple):
    """`points` (hairs, points, 3) from root to tip and `radius` (hairs, points), centimeters.

    `shade` (hairs,) is how much darker or lighter than the rest a hair is, about -1 to 1.
    """

    points: Float64Array
    radius: Float64Array
    shade: Float64Array


def concatenate_hairs(several: Sequence[Hairs]) -> Hairs:
    """All hairs of several sets in one; every hair must have equally many points."""
    return Hairs(*(np.concatenate(parts) for parts in zip(*several, strict=True)))
