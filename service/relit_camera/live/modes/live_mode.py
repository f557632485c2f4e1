"""Mode live: the live picture itself, with its light exchanged, before its own or another background."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.base.rotations import Rotation
from relit_camera.face.face_state import FaceStatus
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.face.motion.motion_blending import EasedPresence
from relit_camera.live.modes.frame_fitting import fit_frame, fit_motion
from relit_camera.live.modes.mode import ModeContext, RenderedFrame, RenderTask
from relit_camera.live.modes.ratio_relighting import FaceLight, RatioPlan, RatioRelighting
from relit_camera.live.modes.room_light_estimator import RoomLightEstimate
from relit_camera.live.modes.scene_relighting import SceneRelighting
from relit_camera.live.modes.skin_tint import SkinTint
from relit_camera.live.publishing.what_is_shown import FacePresence, Situation, what_is_shown
from relit_camera.live.render_quality import RenderQuality
from relit_camera.live.scene.scene import Scene

MOST_TURN_DEG, RETURN_TURN_DEG = 60.0, 54.0
"""Angle between nose and camera from which landmarks are a guess, and below which they are believed again."""
EASE_S = 0.5
"""Seconds over which the light of a face that comes or goes is eased to that of a person whose face is not seen."""
REST_S = 0.3
"""Time constant with which the factor of a person whose face is not seen follows what is known."""


class LiveMode:
    """See `RenderMode`.

    Where the light of the face cannot be told, because it is lost, in profile or not yet seen, the person goes on in
    the mean factor that they had, and before one is known in the mean tint of the place, which in a neutral place is
    hardly any.
    """

    def __init__(self, context: ModeContext, relighting: RatioRelighting, compared: SceneRelighting) -> None:
        """Set up.

        Args:
            context: what the mode works with.
            relighting: of the live picture.
            compared: relights the source image that `relighting` was made for.
        """
        self._context = context
        self._relighting = relighting
        self._compared = compared
        self._presence = EasedPresence(EASE_S)
        self._followed = False
        self._last: tuple[RoomLightEstimate, Rotation] | None = None
        self._skin = SkinTint(context.subject, context.face) if context.subject.is_anyone else None
        self._tint = np.ones(3, np.float32)
        self._rest: NDArray[np.float32] | None = None
        self._rest_s = 0.0

    def begin(self, frame: Frame, motion: FaceMotion, scene: Scene, quality: RenderQuality) -> RenderTask:
        """See `RenderMode.begin`: relights the source image in both lights, and finds where it lies on the live face.

        The task multiplies and composes.
        """
        live = fit_frame(frame, self._context.size)
        fitted = fit_motion(motion, frame.size, self._context.size)  # what is given on is that of the frame
        plan = self._plan(fitted, live, scene, quality)
        return partial(self._render, plan, self._seen(plan), live, motion, scene, quality.matte_every)

    def _render(
        self, plan: RatioPlan, seen: FacePresence, live: Frame, motion: FaceMotion, scene: Scene, matte_every: int
    ) -> RenderedFrame:
        """The relit live picture, and where `split` says so the live one."""
        context, lighting = self._context, scene.look.lighting
        with context.timer.stage("move"):
            relit = self._relighting.apply(plan, lighting.blend)
        with context.timer.stage("compose"):
            person = None if motion.status is FaceStatus.LOST else relit.person  # who is lost is there no more
            image = context.compositor.composite_live(relit.image, live, scene, person, matte_every)
        shown = what_is_shown(Situation(scene.look.mode, seen))
        image = split_view(image, live.image, lighting.split)
        return RenderedFrame(image, motion, scene, shown, unlit=scene.look.shows_filmed)

    def _plan(self, motion: FaceMotion, frame: Frame, scene: Scene, quality: RenderQuality) -> RatioPlan:
        """What must be known to relight the frame."""
        context, relighting = self._context, self._relighting
        followed = self._is_followed(motion)
        presence = self._presence.update(followed, frame.time_s)
        if followed and motion.pose is not None:
            rotation = context.face.turn_to(motion.pose)
            with context.timer.stage("room"):
                room = relighting.room_light.update(frame.image, motion.landmarks, rotation, frame.time_s)
                if self._skin is not None:
                    self._tint = self._skin.update(frame.image, room.skin, frame.time_s)
            if room.light_map.any():  # else nothing of the face could be used
                self._last = room, rotation
        if self._last is None:
            return RatioPlan(frame, self._eased_rest(self._compared.place_tint(scene, frame.time_s), frame.time_s))
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
        rest = self._eased_rest(relighting.mean_factor(pictures, room.gain), frame.time_s)
        if presence <= 0 or motion.pose is None:
            return RatioPlan(frame, rest)
        with context.timer.stage("follow"):
            positions = relighting.positions(motion, motion.pose, frame.size)
            eye_distance = context.face.scheme.eye_span(motion.landmarks)
            face = FaceLight(room.gain, pictures, positions, eye_distance)
            return relighting.aligned(RatioPlan(frame, rest, presence, face))

    def _seen(self, plan: RatioPlan) -> FacePresence:
        if plan.presence > 0:
            return FacePresence.FOLLOWED
        return FacePresence.NOT_YET if self._last is None else FacePresence.LOST

    def _is_followed(self, motion: FaceMotion) -> bool:
        """Whether the face tells its light: it is seen, and not in profile."""
        limit = MOST_TURN_DEG if self._followed else RETURN_TURN_DEG
        pose = None if motion.status is FaceStatus.LOST else motion.pose
        self._followed = pose is not None and pose.turn_deg <= limit
        return self._followed

    def _eased_rest(self, factor: NDArray[np.float32], time_s: float) -> NDArray[np.float32]:
        """The factor, eased toward it from that of the last frame."""
        passed, self._rest_s = max(time_s - self._rest_s, 0.0), time_s
        if self._rest is None:
            self._rest = factor
        self._rest = self._rest + (factor - self._rest) * np.float32(1 - np.exp(-passed / REST_S))
        return self._rest


def split_view(relit: DisplayImage, live: DisplayImage, share: float) -> DisplayImage:
    """The relit picture with a `share` of its width, from the left, as it was filmed, and a white line between them."""
    columns = round(share * relit.shape[1])
    if columns == 0:
        return relit
    shown = relit.copy()
    shown[:, :columns] = live[:, :columns]
    if columns < relit.shape[1]:
        shown[:, columns - 1 : columns + 1] = 255
    return shown
