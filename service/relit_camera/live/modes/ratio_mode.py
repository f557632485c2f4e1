"""Mode ratio: the live picture itself, with its light exchanged, before its own or another background."""

from __future__ import annotations

from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.modes.frame_fitting import fit_frame, fit_motion
from relit_camera.live.modes.identity_check import IdentityCheck
from relit_camera.live.modes.mode import FaceMismatch, ModeContext, RenderedFrame, RenderTask
from relit_camera.live.modes.ratio_relighting import RatioPlan, RatioRelighting
from relit_camera.live.reenactment.warp import PositionGrid
from relit_camera.live.render_quality import RenderQuality
from relit_camera.live.scene.scene import Scene


class RatioMode:
    """See `RenderMode`."""

    def __init__(self, context: ModeContext, relighting: RatioRelighting) -> None:
        self._context = context
        self._relighting = relighting
        self._identity = IdentityCheck(context.face)

    def begin(
        self, frame: Frame, motion: FaceMotion, scene: Scene, quality: RenderQuality
    ) -> RenderTask | FaceMismatch:
        """See `RenderMode.begin`: relights the source image in both lights, and finds where it lies on the live face.

        Both at the same time; the task multiplies and composes.
        """
        timer = self._context.timer
        live = fit_frame(frame, self._context.size)
        motion = fit_motion(motion, frame.size, self._context.size)
        plan = self._plan(motion, live, scene, quality)
        if isinstance(plan, FaceMismatch):
            return plan

        def render() -> RenderedFrame:
            with timer.stage("move"):
                blend = scene.look.lighting.blend
                picture = live.image if plan is None else self._relighting.apply(plan, blend)
            with timer.stage("compose"):
                image = self._context.compositor.composite_live(picture, live, scene)
                return RenderedFrame(split_view(image, live.image, scene.look.lighting.split), motion, scene)

        return render

    def _plan(
        self, motion: FaceMotion, frame: Frame, scene: Scene, quality: RenderQuality
    ) -> RatioPlan | FaceMismatch | None:
        """What must be known to relight the frame; None without a face: then it is shown as it is."""
        context, relighting, pose = self._context, self._relighting, motion.pose
        if pose is None:
            return None
        with context.timer.stage("room"):
            room = relighting.room_light.update(frame.image, motion.landmarks, motion.rotation, frame.time_s)
            mismatch = self._identity.check(motion, room.residual, frame.time_s)
        if mismatch is not None:
            return mismatch
        followed = context.executor.submit(self._follow, motion, frame)
        roots = context.scene_relighting.compare(
            scene,
            motion.rotation,
            frame.time_s,
            room.light_map,
            room.in_head_frame,
            relighting.ratio_roots,
            quality.relight_every,
        )
        return RatioPlan(frame, float(motion.presence), room.gain, roots, followed.result())

    def _follow(self, motion: FaceMotion, frame: Frame) -> PositionGrid:
        assert motion.pose is not None
        with self._context.timer.stage("follow"):
            return self._relighting.positions(motion, motion.pose, frame.size)


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
