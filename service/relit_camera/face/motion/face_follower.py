"""Face follower: the raw face states of a tracker → smooth motion relative to a neutral face.

A reenactor and the rotation of the light are driven by this motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import TrackError
from relit_camera.base.images.image_types import Points
from relit_camera.base.rotations import Angles, Rotation, angles_from_rotation
from relit_camera.face.face_state import FaceState, FaceStatus
from relit_camera.face.head_pose import HeadPose, project, unproject
from relit_camera.face.landmarks.landmark_schemes import LandmarkScheme, landmark_scheme
from relit_camera.face.motion.motion_blending import (
    Crossfade,
    EasedPresence,
    Inertialization,
    RelativeMotion,
    zero_motion,
)
from relit_camera.face.motion.neutral_face import NeutralFace, NeutralFaceFinder, is_frontal
from relit_camera.face.motion.one_euro_filter import (
    FACE_SMOOTHING,
    OneEuroFilter,
    OneEuroParameters,
    RotationOneEuroFilter,
)

REENTRY_FRACTION = 0.9
"""A head that was out of reach is followed again within this fraction of the reach, so that it does not flicker."""


@dataclass(frozen=True)
class FaceFollowerSettings:
    """Settings of a face follower.

    Attributes:
        reach_yaw_deg: a head turned further than this from neutral is out of reach: the motion eases to neutral.
        reach_pitch_deg: the same for pitch.
        ease_s: how long easing to neutral and back takes.
        rotation: smoothing of the head's rotation, in degrees.
        translation: smoothing of the head's position, in centimetres, each axis for itself.
        expression: smoothing of the head-space points, in centimetres.
        fast_expression: smoothing of the head-space points of eyes and lips, in centimetres.
    """

    reach_yaw_deg: float = 40.0
    reach_pitch_deg: float = 30.0
    ease_s: float = 0.5
    rotation: OneEuroParameters = FACE_SMOOTHING.rotation
    translation: OneEuroParameters = FACE_SMOOTHING.translation
    expression: OneEuroParameters = FACE_SMOOTHING.expression
    fast_expression: OneEuroParameters = FACE_SMOOTHING.fast_expression


@dataclass(frozen=True, eq=False)
class FaceMotion:
    """Smoothed motion of a face in one frame.

    `rotation`, `translation`, `expression` and `presence` are relative to the neutral face and eased; they drive the
    reenactor and the light. With neutral pose (R0, t0) the eased pose is rotation · R0 and t0 + translation.
    `landmarks` and `pose` are those in the live picture; after a loss they keep their last values.

    Attributes:
        status: of the frame.
        presence: 1 while the face is followed, 0 at neutral because it is lost or out of reach, eased between; at once
            1 in the first frame of all.
        rotation: takes head-frame vectors to world-frame vectors, identity at neutral.
        translation: (3,) float64 centimetres relative to neutral, camera axes.
        expression: (count, 3) float64 centimetres: head-space points minus the neutral ones.
        landmarks: (count, 2) float32 pixels; (0, 2) before the first face.
        pose: camera_from_head; None before the first face.
        neutral: the neutral face; None before the first face.
    """

    status: FaceStatus
    presence: float
    rotation: Rotation
    translation: NDArray[np.float64]
    expression: NDArray[np.float64]
    landmarks: Points
    pose: HeadPose | None
    neutral: NeutralFace | None

    @property
    def angles(self) -> Angles:
        """Yaw, pitch and roll of `rotation` in degrees."""
        return angles_from_rotation(self.rotation)


class FaceFollower:
    """Turns the states of one tracker into smooth motion. Only `reset_neutral` may be called from another thread."""

    def __init__(self, scheme: str, settings: FaceFollowerSettings | None = None) -> None:
        """Follow landmarks of this scheme.

        Raises:
            NotFoundError: there is no such scheme.
        """
        self._scheme = landmark_scheme(scheme)
        self._settings = settings or FaceFollowerSettings()
        self._smoother = _FaceSmoother(self._scheme, self._settings)
        self._presence_easing = Crossfade(self._settings.ease_s)
        self._neutral_easing = Inertialization(self._settings.ease_s)
        self._target = zero_motion(self._scheme.count)
        self._finder: NeutralFaceFinder | None = NeutralFaceFinder()
        self._neutral: NeutralFace | None = None
        self._neutrals = 0
        self._landmarks: Points = np.zeros((0, 2), np.float32)
        self._pose: HeadPose | None = None
        self._followed = False
        self._presence = EasedPresence(self._settings.ease_s)
        self._time_s: float | None = None
        self._jumps_back = 0

    def reset_neutral(self) -> None:
        """Measure the neutral face anew from the next ten confident frames; until then the old one remains in use."""
        self._finder = NeutralFaceFinder(any_pose=True)

    def follow(self, state: FaceState, size: tuple[int, int], time_s: float) -> FaceMotion:
        """The motion after the next state, of a picture of `size` (width, height) at `time_s` of the source's clock.

        Where the time goes back, as in a file that loops, the motion is eased from the end to the beginning.

        Raises:
            TrackError: the state has another landmark scheme.
        """
        if self._time_s is not None and time_s < self._time_s:
            self._jumps_back += 1
        self._time_s = time_s
        followed = False
        if state.visible:
            self._measure(state, size, time_s)
            followed = self._neutral is not None and self._is_in_reach()
        else:
            self._smoother.reset()
        target = self._target if followed else zero_motion(self._scheme.count)
        motion = self._presence_easing(target, (followed, self._jumps_back), time_s)
        self._followed = followed
        return FaceMotion(
            status=state.status,
            presence=self._presence.update(followed, time_s),
            rotation=motion.rotation,
            translation=motion.translation,
            expression=motion.expression,
            landmarks=self._landmarks,
            pose=self._pose,
            neutral=self._neutral,
        )

    def _measure(self, state: FaceState, size: tuple[int, int], time_s: float) -> None:
        if state.scheme != self._scheme.name or state.pose is None:
            raise TrackError(f"landmarks are of scheme '{state.scheme}', not '{self._scheme.name}'")
        raw_points = unproject(state.landmarks, state.pose, self._scheme, size)
        self._update_neutral(state, raw_points, time_s)
        # Landmarks err by a fraction of a pixel whatever the face's size: relative to a small face that is more.
        noise = max(1.0, FACE_SMOOTHING.low_noise_eye_span_px / self._scheme.eye_span(state.landmarks))
        points, self._pose = self._smoother(raw_points, state.pose, time_s, noise)
        self._landmarks = project(points, self._pose, size)
        if self._neutral is not None:
            neutral = self._neutral.pose
            target = RelativeMotion(
                self._pose.rotation * neutral.rotation.inv(),
                self._pose.translation - neutral.translation,
                points - self._neutral.points,
            )
            self._target = self._neutral_easing(target, self._neutrals, time_s)

    def _update_neutral(self, state: FaceState, points: NDArray[np.float64], time_s: float) -> None:
        finder = self._finder
        found = finder.add(state, points, time_s) if finder else None
        if found is None and self._neutral is None and state.pose is not None and is_frontal(state.pose):
            found = NeutralFace(points, state.pose)  # provisional, until the finder has enough frames
        if found is not None:
            self._neutral = found
            self._neutrals += 1
            if self._finder is finder:  # no other reset was requested meanwhile
                self._finder = None

    def _is_in_reach(self) -> bool:
        """Whether the head's rotation is within reach, with hysteresis: to re-enter it must be clearly inside."""
        share = 1.0 if self._followed else REENTRY_FRACTION
        yaw, pitch, _ = angles_from_rotation(self._target.rotation)
        return abs(yaw) <= share * self._settings.reach_yaw_deg and abs(pitch) <= share * self._settings.reach_pitch_deg


class _FaceSmoother:
    """One-Euro filters on the pose and on the head-space points, so that head and face are smoothed apart."""

    def __init__(self, scheme: LandmarkScheme, settings: FaceFollowerSettings) -> None:
        fast_points = np.zeros((scheme.count, 1), dtype=bool)
        fast_points[[*scheme.eyes, *scheme.lips]] = True
        slow, fast = settings.expression, settings.fast_expression
        self._rotation = RotationOneEuroFilter(settings.rotation)
        self._translation = OneEuroFilter(settings.translation)
        self._points = OneEuroFilter(
            OneEuroParameters(
                min_cutoff_hz=np.where(fast_points, fast.min_cutoff_hz, slow.min_cutoff_hz),
                beta=np.where(fast_points, fast.beta, slow.beta),
                dead_band=np.where(fast_points, fast.dead_band, slow.dead_band),
                speed_cutoff_hz=slow.speed_cutoff_hz,
            )
        )

    def reset(self) -> None:
        """Forget the face."""
        self._rotation.reset()
        self._translation.reset()
        self._points.reset()

    def __call__(
        self, points: NDArray[np.float64], pose: HeadPose, time_s: float, noise: float
    ) -> tuple[NDArray[np.float64], HeadPose]:
        """Smooth head-space points (count, 3) and the pose, `noise` times as noisy as those of a near face."""
        rotation = Rotation(self._rotation(pose.rotation.as_matrix(), time_s, noise))
        # Depth follows from the face's size alone: its error exceeds that of the position across and grows with depth.
        depth_noise = max(1.0, -pose.translation[2] / FACE_SMOOTHING.low_noise_depth_cm)
        axes_noise = noise * np.array([[1.0], [1.0], [depth_noise]])
        translation = self._translation(pose.translation[:, None], time_s, axes_noise)[:, 0]
        return self._points(points, time_s, noise), HeadPose(rotation, translation, pose.focal_px)
