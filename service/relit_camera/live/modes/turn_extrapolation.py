"""A picture that changes as the head turns: computed in every n-th frame, extrapolated in the others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.rotations import Rotation

MAX_STEP = np.radians(3.5)
"""Radians: shadow edges do not move evenly over such angles, and what is computed would stand out from the rest."""
MAX_BASE = np.radians(8.0)
"""Two computed pictures further apart than this say nothing about what lies beyond them."""
_UNMOVED = 1e-6
"""Radians that no light map of 64 texels in 32 bits can tell from 0."""


@dataclass(frozen=True)
class _Computed:
    rotation: Rotation
    part: object
    picture: NDArray[np.float32]


@dataclass(frozen=True)
class _Slope:
    """How the picture changed over a turn (3,), a rotation vector in the frame of the head."""

    turn: NDArray[np.float64]
    change: NDArray[np.float32]


class TurnExtrapolation:
    """Gives a picture of non-negative values for each frame; not thread-safe.

    It goes by how far the head has turned, not by time: with a head that stops, the picture stops, and a still head has
    the same picture again. It is extrapolated by no more than the turn between the last two that were computed.
    """

    def __init__(self, max_step: float = MAX_STEP) -> None:
        """Set up.

        Args:
            max_step: radians. The picture is computed at once where the head has turned further than this since the
                last one, or than half of it aside from how it turned before.
        """
        self._max_step = max_step
        self._whole: object = None
        self._latest: _Computed | None = None
        self._slope: _Slope | None = None
        self._age = 0

    def picture(
        self, rotation: Rotation, whole: object, part: object, every: int, compute: Callable[[], NDArray[np.float32]]
    ) -> NDArray[np.float32]:
        """The picture (height, width, channels) with the head under `rotation`; it must not be written to.

        Args:
            rotation: of the head.
            whole: what else the picture depends on; with another object it is computed at once.
            part: the same of what makes so little difference that the picture goes on changing as before.
            every: it is computed in every so many frames, 1 for all.
            compute: makes it.
        """
        latest = self._latest
        if latest is None or whole is not self._whole:
            computed = _Computed(rotation, part, compute())
            self._whole, self._slope = whole, None  # only now: after a failure it is tried again
            return self._keep(computed)
        step = _turn(latest.rotation, rotation)
        self._age += 1
        same = part is latest.part
        if same and np.linalg.norm(step) < _UNMOVED:
            return latest.picture
        share = self._share(step)
        lag = step if self._slope is None else step - share * self._slope.turn
        jumped = np.linalg.norm(step) > self._max_step or np.linalg.norm(lag) > self._max_step / 2
        if self._age >= every or not same or jumped:
            computed = _Computed(rotation, part, compute())
            if same:  # else the difference is not the turn's alone: the last slope still holds
                self._slope = _slope(latest, computed)
            return self._keep(computed)
        if self._slope is None or share == 0:
            return latest.picture
        beyond = cv2.scaleAdd(self._slope.change, share, latest.picture)
        return np.asarray(np.maximum(beyond, 0, out=beyond), np.float32)

    def _keep(self, computed: _Computed) -> NDArray[np.float32]:
        self._latest, self._age = computed, 0
        return computed.picture

    def _share(self, step: NDArray[np.float64]) -> float:
        """How far `step` goes along the slope's turn: -1 to 1."""
        if self._slope is None:
            return 0.0
        turn = self._slope.turn
        return float(np.clip(step @ turn / (turn @ turn), -1, 1))


def _turn(before: Rotation, after: Rotation) -> NDArray[np.float64]:
    return np.asarray((before.inv() * after).as_rotvec())


def _slope(before: _Computed, after: _Computed) -> _Slope | None:
    turn = _turn(before.rotation, after.rotation)
    if not _UNMOVED < np.linalg.norm(turn) < MAX_BASE:
        return None
    return _Slope(turn, after.picture - before.picture)
