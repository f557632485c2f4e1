"""Blending between motions without a jump: when a face is lost, comes back, or gets another neutral face."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.easing import smoothstep
from relit_camera.base.rotations import Rotation


@dataclass(frozen=True, eq=False)
class RelativeMotion:
    """A head's motion relative to its neutral pose.

    Attributes:
        rotation: takes head-frame vectors to world-frame vectors.
        translation: (3,) float64 centimetres, camera axes.
        expression: (count, 3) float64 centimetres in head space.
    """

    rotation: Rotation
    translation: NDArray[np.float64]
    expression: NDArray[np.float64]

    def toward(self, other: RelativeMotion, share: float) -> RelativeMotion:
        """The motion a fraction `share` of the way to `other`, the rotation along the shortest path."""
        way = (other.rotation * self.rotation.inv()).as_rotvec()
        return RelativeMotion(
            Rotation.from_rotvec(share * way) * self.rotation,
            self.translation + share * (other.translation - self.translation),
            self.expression + share * (other.expression - self.expression),
        )

    def relative_to(self, other: RelativeMotion) -> RelativeMotion:
        """The motion that takes `other` to this one."""
        return RelativeMotion(
            self.rotation * other.rotation.inv(),
            self.translation - other.translation,
            self.expression - other.expression,
        )

    def after(self, other: RelativeMotion) -> RelativeMotion:
        """The sum of `other` and this motion: the inverse of `relative_to`."""
        return RelativeMotion(
            self.rotation * other.rotation,
            self.translation + other.translation,
            self.expression + other.expression,
        )


def zero_motion(count: int) -> RelativeMotion:
    """The motion of a neutral face of `count` points: none."""
    return RelativeMotion(Rotation.identity(), np.zeros(3), np.zeros((count, 3)))


class MotionTransition(ABC):
    """Passes its target through, and blends for `duration_s` after the target changes to one with another `key`."""

    def __init__(self, duration_s: float) -> None:
        self._duration_s = duration_s
        self._key: object = None
        self._output: RelativeMotion | None = None
        self._kept: RelativeMotion | None = None
        self._changed_s = 0.0

    def __call__(self, target: RelativeMotion, key: object, time_s: float) -> RelativeMotion:
        """The blended motion at `time_s` seconds."""
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
        """What to keep of the old output when the target changes."""

    @abstractmethod
    def _blend(self, kept: RelativeMotion, target: RelativeMotion, share: float) -> RelativeMotion:
        """The blend of what was kept with the target; the target alone at `share` 1."""


class Crossfade(MotionTransition):
    """Blends from the old output, held constant: for a face that is lost, comes back or turns out of reach.

    The result stays between the two, however fast the target moves.
    """

    def _keep(self, output: RelativeMotion, target: RelativeMotion) -> RelativeMotion:
        return output

    def _blend(self, kept: RelativeMotion, target: RelativeMotion, share: float) -> RelativeMotion:
        return kept.toward(target, share)


class Inertialization(MotionTransition):
    """Fades out the offset from the old output: for a new neutral face, while the head moves on.

    Known as inertialization in games (Bollo, GDC 2018).
    """

    def _keep(self, output: RelativeMotion, target: RelativeMotion) -> RelativeMotion:
        return output.relative_to(target)

    def _blend(self, kept: RelativeMotion, target: RelativeMotion, share: float) -> RelativeMotion:
        rest = zero_motion(len(target.expression))
        return kept.toward(rest, share).after(target)


class EasedPresence:
    """How far a face is there, 0..1, eased over `ease_s` as it comes and goes."""

    def __init__(self, ease_s: float) -> None:
        self._ease_s = ease_s
        self._time_s: float | None = None
        self._share = 0.0

    def update(self, there: bool, time_s: float) -> float:
        """The presence in the next frame; at once 1 in the first of all, before which nothing was shown."""
        step = 1.0 if self._time_s is None else max(time_s - self._time_s, 0.0) / self._ease_s
        self._time_s = time_s
        self._share = min(max(self._share + (step if there else -step), 0.0), 1.0)
        return float(smoothstep(self._share)) if 0 < self._share < 1 else self._share
