"""Hairs as polylines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from relit_studio.people.geometry import Floats


class Hairs(NamedTuple):
    """`points` (hairs, points, 3) from root to tip and `radius` (hairs, points), centimetres.

    `shade` (hairs,) is how much darker or lighter than the rest a hair is, about -1 to 1.
    """

    points: Floats
    radius: Floats
    shade: Floats


def joined(several: Sequence[Hairs]) -> Hairs:
    """All hairs of several, which have equally many points each."""
    return Hairs(*(np.concatenate(parts) for parts in zip(*several, strict=True)))
