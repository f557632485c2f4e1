"""Whether the live face is the subject's: mode live would paint the light of one face on another."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.face.motion.neutral_face import NeutralFace
from relit_camera.live.modes.mode import FaceMismatch
from relit_camera.live.reenactment.source_image import SourceFace


@dataclass(frozen=True)
class IdentityTunables:
    """Thresholds of the check, measured on recorded and rendered faces (docs/evaluate.md, "The subject and strangers").

    A person differs from their own subject by 0.03 to 0.17 cm of shape and a residual of 0.08 to 0.34, the most in
    coloured light, other people by 0.10 to 0.40 cm and 0.13 to 1.1. Either alone can mislead (a beard, a cap, a grimace
    of up to 0.5 cm), so the product of both, each divided by its threshold, decides; and it is the least that was seen
    in some moments that tells people apart.

    Attributes:
        shape_cm: RMS distance of the landmarks from the subject's, seen from the front.
        return_shape_cm: the distance at which the face of a stranger is the subject's after all: they came back, or had
            grimaced until then.
        residual: deviation of the live face from the relit one under the best light, relative to its contrast.
        delay_s: how long a face is watched before it is judged.
        interval_s: time between two measurements of its shape.
        gap_s: after so long without a frame whoever comes may be another person.
        ease_s: time over which a face that passes comes to be shown relit.
        at_once: the product up to which a face passes before it was watched for so long.
        kept: the product up to which a face that has passed goes on to pass, while it is followed.
    """

    shape_cm: float = 0.14
    return_shape_cm: float = 0.08
    residual: float = 0.23
    delay_s: float = 1.5
    interval_s: float = 0.25
    gap_s: float = 2.0
    ease_s: float = 0.2
    at_once: float = 0.65
    kept: float = 2.0


class IdentityCheck:
    """Compares the live face with that of one subject, frame by frame."""

    def __init__(self, face: SourceFace, tunables: IdentityTunables | None = None) -> None:
        """`face` is the subject's, in the source image."""
        self._face = face
        self._tunables = tunables or IdentityTunables()
        self._neutral: NeutralFace | None = None
        self._since_s: float | None = None
        self._measured_s, self._shape_cm, self._least = -np.inf, np.inf, np.inf
        self._checked_s = -np.inf
        self._passed_s: float | None = None

    def forget(self) -> None:
        """Nobody is followed: whoever comes next may be another person."""
        self._passed_s = None
        self._watch_anew()

    def recognized(self, time_s: float) -> float:
        """How far a frame may be shown relit: 0 until its face has passed for the subject's, then eased to 1.

        At once 1 where it passed in the first frame that was checked: nothing was shown before.
        """
        if self._passed_s is None:
            return 0.0
        since_s = time_s - self._passed_s
        return 1.0 if since_s < 0 else min(since_s / self._tunables.ease_s, 1.0)  # a film begins anew

    def check(self, motion: FaceMotion, residual: float, time_s: float) -> FaceMismatch | None:
        """Return what speaks against the face; None while it passes for the subject's, or is not judged yet.

        Args:
            motion: of the live face, whose shape is compared.
            residual: how badly any light explains the live face, see `RoomLightEstimate`; NaN where that is not known:
                then nothing is judged.
            time_s: of the frame.
        """
        limits = self._tunables
        first = self._checked_s == -np.inf
        if time_s - self._checked_s > limits.gap_s:
            self.forget()
        self._checked_s = time_s
        if motion.neutral is None or motion.presence < 1 or motion.neutral is not self._neutral:
            self._neutral = motion.neutral
            self._watch_anew()  # whoever comes next may be another person
        if motion.neutral is None or motion.presence <= 0:
            self.forget()
        # Only where presence is 1 is the expression the face's own, and not on its way from the neutral one's.
        if motion.neutral is None or motion.presence < 1 or np.isnan(residual):
            return None
        self._since_s = time_s if self._since_s is None else min(self._since_s, time_s)
        if not 0 <= time_s - self._measured_s < limits.interval_s:
            self._measured_s = time_s
            distance_cm = self._distance_cm(motion.neutral, motion)
            self._shape_cm = min(self._shape_cm, distance_cm)
            self._least = min(self._least, unlikeness(distance_cm, residual, limits))
        watched = time_s - self._since_s >= limits.delay_s
        if self._passed_s is None and self._least <= (1.0 if watched else limits.at_once):
            self._passed_s = -np.inf if first else time_s
        passes = self._passed_s is not None and unlikeness(self._shape_cm, residual, limits) <= limits.kept
        if passes or not watched:
            return None
        self._passed_s = None
        return FaceMismatch(
            f"the live face is not the subject's: {_differences(self._shape_cm, residual)}",
            "choose your own subject, or mode portrait",
            partial(self._has_changed_into_the_subjects, self._shape_cm),
        )

    def _watch_anew(self) -> None:
        self._since_s = None
        self._measured_s, self._shape_cm, self._least = -np.inf, np.inf, np.inf

    def _has_changed_into_the_subjects(self, found_cm: float, motion: FaceMotion) -> bool:
        """Whether a face that was found out at `found_cm` has the subject's shape now, or is gone."""
        if motion.presence <= 0:
            return True  # whoever comes next may be the subject
        limit_cm = self._tunables.return_shape_cm
        if found_cm < limit_cm or motion.neutral is None or motion.presence < 1:
            return False
        return self._distance_cm(motion.neutral, motion) < limit_cm

    def _distance_cm(self, neutral: NeutralFace, motion: FaceMotion) -> float:
        return shape_distance_cm(neutral.points + motion.expression, self._face)


def unlikeness(shape_cm: float, residual: float, limits: IdentityTunables) -> float:
    """How unlike the subject's a face is: above 1 it is another's. Arguments as in `what_differs`."""
    return (shape_cm / limits.shape_cm) * (residual / limits.residual)


def what_differs(shape_cm: float, residual: float, limits: IdentityTunables) -> str | None:
    """What tells a face from the subject's, in words; None where it passes for it.

    Args:
        shape_cm: its distance from the subject's, see `shape_distance_cm`.
        residual: how badly any light explains it, relative to its contrast, see `RoomLightEstimate`.
        limits: the thresholds.
    """
    return None if unlikeness(shape_cm, residual, limits) <= 1 else _differences(shape_cm, residual)


def _differences(shape_cm: float, residual: float) -> str:
    return f"it has another shape ({10 * shape_cm:.1f} mm) and looks so under no light (deviation {residual:.2f})"


def shape_distance_cm(points: NDArray[np.float64], face: SourceFace) -> float:
    """RMS distance in cm, seen from the front, of head-space points (count, 3) from those of the source image's face.

    Size, position and what a wrong focal length does (near parts too large) do not count. Eyes and lips are left out:
    they move.
    """
    moving = {*face.scheme.eyes, *face.scheme.lips}
    firm = [index for index in range(face.scheme.count) if index not in moving]
    live, source = (p[firm] - p[firm].mean(axis=0) for p in (points, face.head_points))
    front = live[:, :2]
    scalings = np.stack([front.ravel(), (front * live[:, 2:]).ravel()], axis=1)
    goal = source[:, :2].ravel()
    factors = np.linalg.lstsq(scalings, goal)[0]
    return float(np.sqrt(((scalings @ factors - goal) ** 2).sum() / len(firm)))
