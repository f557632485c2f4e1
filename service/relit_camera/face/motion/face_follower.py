"""Face follower: the raw face states of a tracker → smooth motion relative to a neutral face.

A reenactor and the rotation of the light are driven by this motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from relit_camera.base.easing import smoothstep
from relit_camera.base.errors import TrackError
from relit_camera.base.images.image_types import Points
from relit_camera.base.rotations import Angles, angles_from_rotation
from relit_camera.face.face_state import FaceState, FaceStatus
from relit_camera.face.head_pose import HeadPose, project, unproject
from relit_camera.face.landmarks.landmark_schemes import LandmarkScheme, landmark_scheme
from relit_camera.face.motion.motion_blending import Crossfade, Inertialization, RelativeMotion, zero_motion
from relit_camera.face.motion.neutral_face import NeutralFace, NeutralFaceFinder, is_frontal
from relit_camera.face.motion.one_euro_filter import OneEuroFilter, OneEuroParameters, RotationOneEuroFilter

_REENTRY_FRACTION = 0.9
_LOW_NOISE_EYE_SPAN_PX = 120.0
_LOW_NOISE_DEPTH_CM = 8.0
ROTATION_SMOOTHING = OneEuroParameters(min_cutoff_hz=1.5, beta=0.8, dead_band=0.25, speed_cutoff_hz=2.5)
TRANSLATION_SMOOTHING = OneEuroParameters(min_cutoff_hz=1.5, beta=4.0, dead_band=0.02, speed_cutoff_hz=2.5)
EXPRESSION_SMOOTHING = OneEuroParameters(min_cutoff_hz=1.5, beta=5.0, dead_band=0.02, speed_cutoff_hz=2.5)
FAST_EXPRESSION_SMOOTHING = OneEuroParameters(min_cutoff_hz=4.0, beta=12.0, dead_band=0.02, speed_cutoff_hz=2.5)


@dataclass(frozen=True)
class FaceFollowerSettings:
    """How a face is followed.

    Attributes:
        reach_yaw_deg: turning further than this from neutral is out of reach: the motion eases to neutral.
        reach_pitch_deg: the same for nodding.
        ease_s: how long easing to neutral and back takes.
        rotation: smoothing of the head's rotation, in degrees.
        translation: smoothing of the head's position, in centimetres, each axis for itself.
        expression: smoothing of the head-space points, in centimetres.
        quick_expression: the same for eyes and lips, so that blinks and speech keep their speed.
    """

    reach_yaw_deg: float = 40.0
    reach_pitch_deg: float = 30.0
    ease_s: float = 0.5
    rotation: OneEuroParameters = ROTATION_SMOOTHING
    translation: OneEuroParameters = TRANSLATION_SMOOTHING
    expression: OneEuroParameters = EXPRESSION_SMOOTHING
    quick_expression: OneEuroParameters = FAST_EXPRESSION_SMOOTHING


@dataclass(frozen=True, eq=False)
class FaceMotion:
    """A face's motion in one frame, smoothed.

    Relative to neutral and eased, for what is driven by the face: `rotation`, `translation`, `expression` and
    `presence`. With neutral pose (R0, t0) the eased pose is rotation · R0 and t0 + translation. In the live picture,
    for what is laid over it: `landmarks` and `pose`; after a loss they stay where the face was last seen.

    Attributes:
        status: of the frame.
        presence: 1 while the face is followed, 0 at neutral because it is lost or out of reach, eased between.
        rotation: takes head-frame vectors to room-frame vectors, identity at neutral.
        translation: (3,) float64 centimetres relative to neutral, camera axes.
        expression: (count, 3) float64 centimetres: head-space points minus the neutral ones.
        landmarks: (count, 2) float32 pixels; (0, 2) before the first face.
        pose: camera_from_head; None before the first face.
        neutral: what the motion is relative to; None before the first face.
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
    """Follows the states of one tracker. `reset_neutral` may be called from another thread, the rest may not."""

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
        self._presence = 0.0
        self._time_s: float | None = None
        self._jumps_back = 0

    def reset_neutral(self) -> None:
        """Take the neutral face anew from the next ten confident frames; until then the old one holds."""
        self._finder = NeutralFaceFinder(any_pose=True)

    def follow(self, state: FaceState, size: tuple[int, int], time_s: float) -> FaceMotion:
        """Take the next state of a picture of `size` (width, height) at `time_s`.

        The time is in seconds on the source's clock. Where it goes back, as in a file that loops, the motion is eased
        from the end to the beginning.

        Raises:
            TrackError: the state has another landmark scheme.
        """
        if self._time_s is not None and time_s < self._time_s:
            self._jumps_back += 1
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
            presence=self._ease_presence(time_s),
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
        # Landmarks err by a share of a pixel whatever the face's size: on a small face that is more of a head.
        noise = max(1.0, _LOW_NOISE_EYE_SPAN_PX / self._scheme.eye_span(state.landmarks))
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
            found = NeutralFace(points, state.pose)  # makes do until the finder has seen enough
        if found is not None:
            self._neutral = found
            self._neutrals += 1
            if self._finder is finder:  # nobody asked for another one meanwhile
                self._finder = None

    def _is_in_reach(self) -> bool:
        """Whether the head is turned little enough; who left must come a little further back."""
        share = 1.0 if self._followed else _REENTRY_FRACTION
        yaw, pitch, _ = angles_from_rotation(self._target.rotation)
        return abs(yaw) <= share * self._settings.reach_yaw_deg and abs(pitch) <= share * self._settings.reach_pitch_deg

    def _ease_presence(self, time_s: float) -> float:
        passed = 0.0 if self._time_s is None else max(time_s - self._time_s, 0.0)
        self._time_s = time_s
        step = passed / self._settings.ease_s
        self._presence = float(np.clip(self._presence + (step if self._followed else -step), 0, 1))
        return float(smoothstep(self._presence))


class _FaceSmoother:
    """One-Euro filters on the pose and on the head-space points, which keep apart what the head and the face do."""

    def __init__(self, scheme: LandmarkScheme, settings: FaceFollowerSettings) -> None:
        quick = np.zeros((scheme.count, 1), dtype=bool)
        quick[[*scheme.eyes, *scheme.lips]] = True
        calm, lively = settings.expression, settings.quick_expression
        self._rotation = RotationOneEuroFilter(settings.rotation)
        self._translation = OneEuroFilter(settings.translation)
        self._points = OneEuroFilter(
            OneEuroParameters(
                min_cutoff_hz=np.where(quick, lively.min_cutoff_hz, calm.min_cutoff_hz),
                beta=np.where(quick, lively.beta, calm.beta),
                dead_band=np.where(quick, lively.dead_band, calm.dead_band),
                speed_cutoff_hz=calm.speed_cutoff_hz,
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
        rotation = self._rotation(pose.rotation, time_s, noise)
        # Depth comes from the face's size alone: it errs by more than the position across, and the more the further.
        depth_noise = max(1.0, -pose.translation[2] / _LOW_NOISE_DEPTH_CM)
        axes_noise = noise * np.array([[1.0], [1.0], [depth_noise]])
        translation = self._translation(pose.translation[:, None], time_s, axes_noise)[:, 0]
        return self._points(points, time_s, noise), HeadPose(rotation, translation, pose.focal_px)
