"""Hairs as polylines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from relit_studio.people.geometry import Floats


class Hairs(NamedTuple):
    """`points` (hairs, points, 3) from root to tip and `radius` (hairs, points), centimetres."""

    points: Floats
    radius: Floats


def joined(several: Sequence[Hairs]) -> Hairs:
    """All hairs of several, which have equally many points each."""
    return Hairs(np.concatenate([each.points for each in several]), np.concatenate([each.radius for each in several]))
