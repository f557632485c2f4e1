"""Mode ratio: the live picture itself, with its light exchanged, before its own or another background."""

from __future__ import annotations

import numpy as np

from relit_camera.base.images.image_types import DisplayImage, Frame, LinearImage
from relit_camera.base.images.tone_mapping import display_from_linear, linear_from_display
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.modes.frame_fitting import fit_frame, fit_motion
from relit_camera.live.modes.identity_check import IdentityCheck
from relit_camera.live.modes.mode import FaceMismatch, ModeContext, RenderedFrame, RenderTask
from relit_camera.live.modes.ratio_relighting import RatioPlan, RatioRelighting
from relit_camera.live.scene.scene import Scene


class RatioMode:
    """See `RenderMode`."""

    def __init__(self, context: ModeContext, relighting: RatioRelighting) -> None:
        self._context = context
        self._relighting = relighting
        self._identity = IdentityCheck(context.face)

    def begin(self, frame: Frame, motion: FaceMotion, scene: Scene) -> RenderTask | FaceMismatch:
        """See `RenderMode.begin`: estimates the room's light while the source image is relit; the task does the rest.

        The second relighting, under the room's light, is left to the task although it could be done here: only so do
        both halves take about as long.
        """
        context, timer = self._context, self._context.timer
        live, motion = fit_frame(frame, context.size), fit_motion(motion, frame.size, context.size)
        planned = context.executor.submit(self._plan, motion, live)
        relit = context.scene_relighting.relight(scene, motion.rotation, live.time_s)
        plan = planned.result()
        if isinstance(plan, FaceMismatch):
            return plan

        def render() -> RenderedFrame:
            with timer.stage("move"):
                picture = linear_from_display(live.image) if plan is None else self._relighting.apply(plan, relit)
            with timer.stage("compose"):
                return RenderedFrame(self._compose(picture, live, scene), motion, scene)

        return render

    def _plan(self, motion: FaceMotion, frame: Frame) -> RatioPlan | FaceMismatch | None:
        """What of the frame needs no relit picture; None without a face: then the live picture is shown."""
        with self._context.timer.stage("follow"):
            if motion.pose is None:
                return None
            plan = self._relighting.plan(motion, motion.pose, frame)
            return self._identity.check(motion, plan.room.residual, frame.time_s) or plan

    def _compose(self, relit: LinearImage, frame: Frame, scene: Scene) -> DisplayImage:
        lighting = scene.look.lighting
        if lighting.blend < 1:
            share = np.float32(lighting.blend)
            relit = linear_from_display(frame.image) * (1 - share) + relit * share
        image = self._context.compositor.composite_live(display_from_linear(relit), frame, scene)
        return split_view(image, frame.image, lighting.split)


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
