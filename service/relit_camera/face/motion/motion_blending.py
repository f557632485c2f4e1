"""Changing what is followed without a jump."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from relit_camera.base.easing import smoothstep


@dataclass(frozen=True, eq=False)
class RelativeMotion:
    """A head's motion relative to its neutral pose.

    Attributes:
        rotation: takes head-frame vectors to room-frame vectors.
        translation: (3,) float64 centimetres, camera axes.
        expression: (count, 3) float64 centimetres in head space.
    """

    rotation: Rotation
    translation: NDArray[np.float64]
    expression: NDArray[np.float64]

    def toward(self, other: RelativeMotion, share: float) -> RelativeMotion:
        """Go `share` of the way to `other`, the rotation by the shortest way."""
        way = (other.rotation * self.rotation.inv()).as_rotvec()
        return RelativeMotion(
            Rotation.from_rotvec(share * way) * self.rotation,
            self.translation + share * (other.translation - self.translation),
            self.expression + share * (other.expression - self.expression),
        )

    def relative_to(self, other: RelativeMotion) -> RelativeMotion:
        """Give what takes `other` to this motion."""
        return RelativeMotion(
            self.rotation * other.rotation.inv(),
            self.translation - other.translation,
            self.expression - other.expression,
        )

    def after(self, other: RelativeMotion) -> RelativeMotion:
        """Do this motion on top of `other`: the inverse of `relative_to`."""
        return RelativeMotion(
            self.rotation * other.rotation,
            self.translation + other.translation,
            self.expression + other.expression,
        )


def zero_motion(count: int) -> RelativeMotion:
    """Give the motion of a neutral face of `count` points."""
    return RelativeMotion(Rotation.identity(), np.zeros(3), np.zeros((count, 3)))


class MotionTransition(ABC):
    """Gives its target, except for `duration_s` after the target was exchanged for another (another `key`)."""

    def __init__(self, duration_s: float) -> None:
        self._duration_s = duration_s
        self._key: object = None
        self._output: RelativeMotion | None = None
        self._kept: RelativeMotion | None = None
        self._changed_s = 0.0

    def __call__(self, target: RelativeMotion, key: object, time_s: float) -> RelativeMotion:
        """Give the eased motion at `time_s` seconds."""
        if self._output is not None and key != self._key:
            self._kept, self._changed_s = self._keep(self._output, target), time_s
        self._key = key
        passed = (time_s - self._changed_s) / self._duration_s
        if self._kept is not None and 0 <= passed < 1:
            target = self._blend(self._kept, target, float(smoothstep(passed)))
        self._output = target
        return target

    @abstractmethod
    def _keep(self, output: RelativeMotion, target: RelativeMotion) -> RelativeMotion:
        """Choose what to keep of the old output when the target is exchanged."""

    @abstractmethod
    def _blend(self, kept: RelativeMotion, target: RelativeMotion, share: float) -> RelativeMotion:
        """Blend what was kept with the target, all target at `share` 1."""


class Crossfade(MotionTransition):
    """From where the old output stood: for a face that is lost, comes back or turns out of reach.

    It never leaves the way between the two, however fast the target moves.
    """

    def _keep(self, output: RelativeMotion, target: RelativeMotion) -> RelativeMotion:
        return output

    def _blend(self, kept: RelativeMotion, target: RelativeMotion, share: float) -> RelativeMotion:
        return kept.toward(target, share)


class Inertialization(MotionTransition):
    """Fades the distance to the old output: for a new neutral face, under which the head moves on as before.

    It is the "inertialization" of games (Bollo, GDC 2018).
    """

    def _keep(self, output: RelativeMotion, target: RelativeMotion) -> RelativeMotion:
        return output.relative_to(target)

    def _blend(self, kept: RelativeMotion, target: RelativeMotion, share: float) -> RelativeMotion:
        rest = zero_motion(len(target.expression))
        return kept.toward(rest, share).after(target)
