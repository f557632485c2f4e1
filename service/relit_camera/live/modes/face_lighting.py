"""What is known of the light on one live face, from frame to frame.

Of somebody who is lit as the head that is nobody's (`capture.instant.anyone`) the room's light is estimated in their
own color and brightness: what their skin takes from the light counts as the room's. The relit picture is corrected by
what their skin is taken for (`face.skin_prior`), told by live frames.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import linear_from_uint8, luminance
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.base.rotations import Rotation
from relit_camera.face.face_state import FaceStatus
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.face.motion.motion_blending import EasedPresence
from relit_camera.face.skin_prior import estimate_skin
from relit_camera.live.modes.frame_relighting import FacePlan
from relit_camera.live.modes.ratio_relighting import FaceLight, RatioRelighting
from relit_camera.live.modes.room_light_estimator import RoomLightEstimate, RoomLightEstimator
from relit_camera.live.modes.scene_relighting import SceneRelighting
from relit_camera.live.modes.source_masks import inside_face
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.live.render_quality import RenderQuality
from relit_camera.live.scene.scene import Scene
from relit_camera.live.status.stage_timing import StageTimer
from relit_camera.subject.subject import Subject

MOST_TURN_DEG, RETURN_TURN_DEG = 60.0, 54.0
"""Angle between nose and camera from which landmarks are a guess, and below which they are believed again."""
EASE_S = 0.5
"""Seconds over which the light of a face that comes or goes is eased to that of a person whose face is not seen."""

LOOK_S, TINT_S = 0.25, 2.0
"""Time between two looks, and over which they are averaged, in logarithms."""
LEAST_SAMPLES = 50
THUMBNAIL = (32, 18)
"""Size of the picture of which the mean luminance is taken."""


@dataclass(frozen=True)
class LitAs:
    """Of whom a live face has the shape and, if the subject is somebody's, the looks.

    Attributes:
        subject: the person.
        face: the face in the source image, in the scheme of the live landmarks.
        relighting: of live pictures by that subject.
        room_light: of that subject; each face has a fresh one.
    """

    subject: Subject
    face: SourceFace
    relighting: RatioRelighting
    room_light: RoomLightEstimator


@dataclass(frozen=True)
class LitFace:
    """What is known of a live face in one frame.

    Attributes:
        mean: (3,) float32 factor of light of the whole person; None before their light could be told.
        plan: how the face is relit; None while it is not followed.
    """

    mean: NDArray[np.float32] | None = None
    plan: FacePlan | None = None


class FaceLighting:
    """Follows the light on one face. Not thread-safe."""

    def __init__(self, lit_as: LitAs, compared: SceneRelighting, timer: StageTimer, at_once: bool = True) -> None:
        """Set up.

        Args:
            lit_as: of whom the face has the shape.
            compared: relights the source image that `lit_as.relighting` was made for.
            timer: counts the stages `room` and `follow`.
            at_once: whether the first frame shows the face in its own light, else it is eased to it.
        """
        self._lit_as, self._compared, self._timer = lit_as, compared, timer
        self._room_light = lit_as.room_light.fresh()
        self._skin = SkinTint(lit_as.subject, lit_as.face) if lit_as.subject.is_anyone else None
        self._tint = np.ones(3, np.float32)
        self._presence = EasedPresence(EASE_S)
        self._begins_unlit = not at_once
        self._followed = False
        self._last: tuple[RoomLightEstimate, Rotation] | None = None

    def update(self, motion: FaceMotion, frame: Frame, scene: Scene, quality: RenderQuality) -> LitFace:
        """What is known of the face in the next frame.

        Args:
            motion: of the face in it.
            frame: the live frame.
            scene: whose light it gets.
            quality: what the picture may cost.
        """
        face, relighting = self._lit_as.face, self._lit_as.relighting
        followed = self._is_followed(motion)
        if self._begins_unlit:
            self._presence.update(False, frame.time_s)
            self._begins_unlit = False
        presence = self._presence.update(followed, frame.time_s)
        if followed and motion.pose is not None:
            rotation = face.turn_to(motion.pose)
            with self._timer.stage("room"):
                room = self._room_light.update(frame.image, motion.landmarks, rotation, frame.time_s)
                if self._skin is not None:
                    self._tint = self._skin.update(frame.image, room.skin, frame.time_s)
            if room.light_map.any():  # else nothing of the face could be used
                self._last = room, rotation
        if self._last is None:
            return LitFace()
        room, rotation = self._last
        pictures = self._compared.compare(
            scene,
            rotation,
            frame.time_s,
            room.light_map,
            room.in_head_frame,
            relighting.raised_lights,
            quality.relight_every,
        )
        if self._skin is not None:
            pictures = relighting.tinted(pictures, self._tint)
        mean = relighting.mean_factor(pictures, room.gain)
        if presence <= 0 or motion.pose is None:
            return LitFace(mean)
        with self._timer.stage("follow"):
            positions = relighting.positions(motion, motion.pose, frame.size)
            eye_distance = face.scheme.eye_span(motion.landmarks)
            light = FaceLight(room.gain, room.cast(self._tint), pictures, positions, eye_distance)
            aligned = relighting.aligned(frame, light, presence)
            return LitFace(mean, FacePlan(relighting, aligned, presence, motion.status is not FaceStatus.LOST))

    def _is_followed(self, motion: FaceMotion) -> bool:
        """Whether the face tells its light: it is seen, and not in profile."""
        limit = MOST_TURN_DEG if self._followed else RETURN_TURN_DEG
        pose = None if motion.status is FaceStatus.LOST else motion.pose
        self._followed = pose is not None and pose.turn_deg <= limit
        return self._followed


class SkinTint:
    """The factor by which a person's skin is brighter than that of one subject. Not thread-safe."""

    def __init__(self, subject: Subject, face: SourceFace) -> None:
        """`face` is that of the subject, which must keep its albedo."""
        assert subject.albedo is not None
        self._skin = np.median(subject.albedo[inside_face(face) > 0.9].astype(np.float32), axis=0)
        self._logarithm: NDArray[np.float64] | None = None
        self._looked_s = -np.inf

    def update(self, image: DisplayImage, skin: NDArray[np.float32], time_s: float) -> NDArray[np.float32]:
        """The factor (3,) after a live frame.

        Args:
            image: the whole frame, uint8 sRGB.
            skin: (count, 3) linear values of the face in it; few or none where it is hidden or overexposed.
            time_s: of the frame.
        """
        passed = time_s - self._looked_s
        if len(skin) >= LEAST_SAMPLES and not 0 <= passed < LOOK_S:
            small = np.asarray(cv2.resize(image, THUMBNAIL, interpolation=cv2.INTER_AREA), np.uint8)
            seen = estimate_skin(skin, float(luminance(linear_from_uint8(small)).mean()))
            found = np.log(seen / np.maximum(self._skin, 1e-3))
            share = 1.0 if self._logarithm is None or passed < 0 else 1 - np.exp(-passed / TINT_S)
            before = found if self._logarithm is None else self._logarithm
            self._logarithm, self._looked_s = before + share * (found - before), time_s
        return np.ones(3, np.float32) if self._logarithm is None else np.exp(self._logarithm).astype(np.float32)
