"""The neutral face, relative to which motion is measured, and how it is found in the first frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.rotations import Rotation, angles_from_rotation
from relit_camera.face.face_state import FaceState, FaceStatus
from relit_camera.face.head_pose import HeadPose


@dataclass(frozen=True)
class NeutralFaceTunables:
    """Constants of the search for the neutral face (docs/trackers.md).

    Attributes:
        frames: number of frames whose median is the neutral face.
        window_s: duration over which candidates are collected.
        frontal_deg: largest angle about any axis of a near-frontal head.
        frontal_timeout_s: time after which frames count however the head is turned.
        open_eye_fraction: of the median eye opening, below which the eyes blink.
    """

    frames: int = 10
    window_s: float = 1.0
    frontal_deg: float = 20.0
    frontal_timeout_s: float = 3.0
    open_eye_fraction: float = 0.75


TUNABLES = NeutralFaceTunables()


@dataclass(frozen=True, eq=False)
class NeutralFace:
    """A face with neutral expression and pose.

    Attributes:
        points: (count, 3) float64 head-space centimetres of the scheme's points.
        pose: the head's pose relative to the camera.
    """

    points: NDArray[np.float64]
    pose: HeadPose


@dataclass(frozen=True, eq=False)
class NeutralSample:
    """A face that may be neutral.

    Attributes:
        time_s: of the frame.
        neutral: its points and pose.
        eyes: mean opening of the eyes.
        mouth: opening of the mouth.
    """

    time_s: float
    neutral: NeutralFace
    eyes: float
    mouth: float


def is_frontal(pose: HeadPose) -> bool:
    """Whether a head looks roughly into the camera."""
    return max(abs(angle) for angle in angles_from_rotation(pose.rotation)) < TUNABLES.frontal_deg


class NeutralFaceFinder:
    """Finds the neutral face among the first confident, near-frontal frames.

    It collects a second of them, drops blinks, selects the ten least active (mouth shut, head straight) and takes their
    median, so that talking, blinking or moving while the camera starts does no harm. Somebody who never looks into the
    camera is accepted as turned after three seconds.
    """

    def __init__(self, any_pose: bool = False) -> None:
        """`any_pose`: accept the next ten frames however the head is turned, because the user chose this pose."""
        self._any_pose = any_pose
        self._samples: list[NeutralSample] = []
        self._first_seen_s: float | None = None

    def add(self, state: FaceState, points: NDArray[np.float64], time_s: float) -> NeutralFace | None:
        """Add a frame's state and its head-space points; returns the neutral face once it is found.

        Uncertain and lost states are ignored.
        """
        if state.status is not FaceStatus.FOUND or state.pose is None:
            return None
        if self._first_seen_s is None or time_s < self._first_seen_s:
            self._first_seen_s = time_s
        waited = time_s - self._first_seen_s
        if self._any_pose or waited > TUNABLES.frontal_timeout_s or is_frontal(state.pose):
            self._samples.append(
                NeutralSample(time_s, NeutralFace(points, state.pose), sum(state.eyes) / 2, state.mouth)
            )
        if len(self._samples) < TUNABLES.frames:
            return None
        if not self._any_pose and time_s - self._samples[0].time_s < TUNABLES.window_s:
            return None
        return neutral_face_of(self._samples)


def neutral_face_of(samples: Sequence[NeutralSample]) -> NeutralFace:
    """The median of the ten faces that do least, their eyes open."""
    return _median([sample.neutral for sample in _least_active(samples)])


def _least_active(samples: Sequence[NeutralSample]) -> list[NeutralSample]:
    typical = float(np.median([sample.eyes for sample in samples]))
    open_eyed = [sample for sample in samples if sample.eyes >= TUNABLES.open_eye_fraction * typical]
    return sorted(open_eyed, key=_activity)[: TUNABLES.frames]


def _activity(sample: NeutralSample) -> float:
    # Ten degrees weigh as much as a speaking mouth. Pitch does not count: cameras stand above or below the eyes.
    yaw, _, roll = angles_from_rotation(sample.neutral.pose.rotation)
    return sample.mouth + (abs(yaw) + abs(roll)) / 100


def _median(faces: list[NeutralFace]) -> NeutralFace:
    points = np.median([face.points for face in faces], axis=0)
    translation = np.median([face.pose.translation for face in faces], axis=0)
    mean = Rotation.nearest(np.mean([face.pose.rotation.as_matrix() for face in faces], axis=0))
    deviation = np.median([(mean.inv() * face.pose.rotation).as_rotvec() for face in faces], axis=0)
    return NeutralFace(points, HeadPose(mean * Rotation.from_rotvec(deviation), translation, faces[-1].pose.focal_px))
