"""The neutral face: what a live face is measured against."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from relit_camera.base.rotations import angles_from_rotation
from relit_camera.face.face_state import FaceState, FaceStatus
from relit_camera.face.head_pose import HeadPose

_MIN_FRAMES = 10
_WINDOW_S = 1.0
_FRONTAL_DEG = 20.0
_FRONTAL_TIMEOUT_S = 3.0
_OPEN_EYE_FRACTION = 0.75


@dataclass(frozen=True, eq=False)
class NeutralFace:
    """A face at rest.

    Attributes:
        points: (count, 3) float64 head-space centimetres of the scheme's points.
        pose: the head's pose relative to the camera.
    """

    points: NDArray[np.float64]
    pose: HeadPose


@dataclass(frozen=True, eq=False)
class _Sample:
    time_s: float
    neutral: NeutralFace
    eyes: float
    mouth: float


def is_frontal(pose: HeadPose) -> bool:
    """Whether a head looks roughly into the camera."""
    return max(abs(angle) for angle in angles_from_rotation(pose.rotation)) < _FRONTAL_DEG


class NeutralFaceFinder:
    """Finds the neutral face among the first confident, near-frontal frames.

    It looks at a second of them, leaves out blinks, takes the ten calmest (mouth shut, head straight) and their median:
    who talks, blinks or moves while the camera starts is still measured against a face at rest. Who sits aside and
    never looks into the camera is taken as he is after three seconds.
    """

    def __init__(self, any_pose: bool = False) -> None:
        """Begin. `any_pose` takes the next ten frames however the head is turned: the person asked for this pose."""
        self._any_pose = any_pose
        self._samples: list[_Sample] = []
        self._first_seen_s: float | None = None

    def add(self, state: FaceState, points: NDArray[np.float64], time_s: float) -> NeutralFace | None:
        """Look at a frame's state and its head-space points; give the neutral face once it is found.

        Uncertain and lost states are passed over.
        """
        if state.status is not FaceStatus.FOUND or state.pose is None:
            return None
        if self._first_seen_s is None or time_s < self._first_seen_s:
            self._first_seen_s = time_s
        waited = time_s - self._first_seen_s
        if self._any_pose or waited > _FRONTAL_TIMEOUT_S or is_frontal(state.pose):
            self._samples.append(_Sample(time_s, NeutralFace(points, state.pose), sum(state.eyes) / 2, state.mouth))
        if len(self._samples) < _MIN_FRAMES:
            return None
        if not self._any_pose and time_s - self._samples[0].time_s < _WINDOW_S:
            return None
        return _median([sample.neutral for sample in _least_active(self._samples)])


def _least_active(samples: list[_Sample]) -> list[_Sample]:
    usual = float(np.median([sample.eyes for sample in samples]))
    awake = [sample for sample in samples if sample.eyes >= _OPEN_EYE_FRACTION * usual]
    return sorted(awake, key=_activity)[:_MIN_FRAMES]


def _activity(sample: _Sample) -> float:
    # Ten degrees weigh as much as a mouth that speaks. Pitch says nothing: cameras stand above or below the eyes.
    yaw, _, roll = angles_from_rotation(sample.neutral.pose.rotation)
    return sample.mouth + (abs(yaw) + abs(roll)) / 100


def _median(faces: list[NeutralFace]) -> NeutralFace:
    points = np.median([face.points for face in faces], axis=0)
    translation = np.median([face.pose.translation for face in faces], axis=0)
    mean = Rotation.concatenate([face.pose.rotation for face in faces]).mean()
    aside = np.median([(mean.inv() * face.pose.rotation).as_rotvec() for face in faces], axis=0)
    return NeutralFace(points, HeadPose(mean * Rotation.from_rotvec(aside), translation, faces[-1].pose.focal_px))
