"""Mode portrait: the subject's source image, relit, moved as the live face moves. No live pixel is in the picture."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from relit_camera.base.images.color import linear_from_uint8
from relit_camera.base.images.image_types import Frame, LinearImage
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.modes.mode import ModeContext, RenderedFrame, RenderTask
from relit_camera.live.publishing.what_is_shown import FacePresence, Situation, what_is_shown
from relit_camera.live.reenactment.reenactor import Reenactor
from relit_camera.live.render_quality import RenderQuality
from relit_camera.live.scene.scene import Scene
from relit_camera.subject.subject import Subject


class PortraitMode:
    """See `RenderMode`."""

    def __init__(self, context: ModeContext, reenactor: Reenactor) -> None:
        self._context = context
        self._reenactor = reenactor

    def begin(
        self,
        frame: Frame,
        motion: FaceMotion,
        scene: Scene,
        quality: RenderQuality,
        others: Mapping[int, FaceMotion],
    ) -> RenderTask:
        """See `RenderMode.begin`: relights the source image and plans its warp; the task warps and composes."""
        context, timer = self._context, self._context.timer
        relit = context.scene_relighting.relight(scene, motion.rotation, frame.time_s, quality.relight_every)
        with timer.stage("follow"):
            warp = self._reenactor.plan_warp(motion, frame, quality)

        def render() -> RenderedFrame:
            with timer.stage("move"):
                layer = warp(blend_with_source(context.subject, relit, scene.look.lighting.blend))
            with timer.stage("compose"):
                image = context.compositor.composite_source(layer, scene, frame.time_s)
            face = FacePresence.FOLLOWED if motion.presence > 0 else FacePresence.LOST
            return RenderedFrame(image, motion, scene, what_is_shown(Situation(scene.look.mode, face)))

        return render


def blend_with_source(subject: Subject, relit: LinearImage, share: float) -> LinearImage:
    """A `share` of the relit source image, and for the rest the source image as it was captured, lit from the front.

    The live picture, which mode live blends with, stays private in mode portrait.
    """
    if share >= 1:
        return relit
    return np.asarray(linear_from_uint8(subject.neutral) * (1 - share) + relit * share, dtype=np.float32)
