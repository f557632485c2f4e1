"""Mode live: the live picture itself, with its light exchanged, before its own or another background."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from relit_camera.base.images.image_types import DisplayImage, Frame, LinearImage
from relit_camera.base.rotations import Rotation
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.compositing.background_renderer import crossfade
from relit_camera.live.modes.frame_fitting import fit_frame, fit_motion
from relit_camera.live.modes.identity_check import IdentityCheck
from relit_camera.live.modes.mode import FaceMismatch, ModeContext, RenderedFrame, RenderTask
from relit_camera.live.modes.portrait_mode import blend_with_source
from relit_camera.live.modes.ratio_relighting import RatioPlan, RatioRelighting
from relit_camera.live.modes.scene_relighting import SceneRelighting
from relit_camera.live.reenactment.reenactor import WarpedLayer
from relit_camera.live.reenactment.rest_layer import RestLayer
from relit_camera.live.render_quality import RenderQuality
from relit_camera.live.scene.scene import Scene


class LiveMode:
    """See `RenderMode`.

    Where no face is followed, or not yet, the live picture would be shown as it is, and a stranger in the light of
    another's face. Unless the scene allows that, the subject's relit picture at rest takes its place, as mode portrait
    shows it while it searches, until the live face has passed for the subject's; between them it is eased.
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
        self._identity = IdentityCheck(context.face)
        self._at_rest = RestLayer(context.subject, context.size)
        self._last_rest: tuple[LinearImage, float, WarpedLayer] | None = None

    def begin(
        self, frame: Frame, motion: FaceMotion, scene: Scene, quality: RenderQuality
    ) -> RenderTask | FaceMismatch:
        """See `RenderMode.begin`: relights the source image in both lights, and finds where it lies on the live face.

        The task multiplies and composes.
        """
        live = fit_frame(frame, self._context.size)
        fitted = fit_motion(motion, frame.size, self._context.size)  # what is given on is that of the frame
        if scene.unlit_allowed:
            plan = self._plan(fitted, live, scene, quality)
            return plan if isinstance(plan, FaceMismatch) else partial(self._render, plan, live, motion, scene)
        followed = None if motion.presence <= 0 else self._plan(fitted, live, scene, quality)
        if isinstance(followed, FaceMismatch):
            return followed
        if followed is None:
            self._identity.forget()
        else:
            followed = replace(followed, presence=min(followed.presence, self._identity.recognized(frame.time_s)))
            if followed.presence >= 1:
                self._last_rest = None  # megabytes that are shown no more
                return partial(self._render, followed, live, motion, scene)
        at_rest = self._context.scene_relighting.relight(
            scene, Rotation.identity(), frame.time_s, quality.relight_every
        )
        return partial(self._render_eased, followed, at_rest, live, motion, scene)

    def _render(self, plan: RatioPlan | None, live: Frame, motion: FaceMotion, scene: Scene) -> RenderedFrame:
        """The relit live picture; as far as no face is followed, and where `split` says so, the live one."""
        lighting = scene.look.lighting
        image = split_view(self._relit_live(plan, live, scene), live.image, lighting.split)
        unlit = plan is None or plan.presence < 1 or scene.look.shows_filmed
        return RenderedFrame(image, motion, scene, unlit)

    def _render_eased(
        self, plan: RatioPlan | None, at_rest: LinearImage, live: Frame, motion: FaceMotion, scene: Scene
    ) -> RenderedFrame:
        """The relit live picture as far as a face is followed; for the rest the subject at rest, relit."""
        context = self._context
        with context.timer.stage("move"):
            layer = self._rest_layer(at_rest, scene.look.lighting.blend)
        with context.timer.stage("compose"):
            image = context.compositor.composite_source(layer, scene, live.time_s)
        if plan is not None and plan.presence > 0:
            image = crossfade(image, self._relit_live(replace(plan, presence=1.0), live, scene), plan.presence)
        return RenderedFrame(image, motion, scene, scene.look.shows_filmed)

    def _rest_layer(self, at_rest: LinearImage, blend: float) -> WarpedLayer:
        """The subject at rest; the previous layer again while neither the relit picture nor the blend has changed."""
        last = self._last_rest
        if last is None or last[0] is not at_rest or last[1] != blend:
            layer = self._at_rest.render(blend_with_source(self._context.subject, at_rest, blend))
            last = self._last_rest = at_rest, blend, layer
        return last[2]

    def _relit_live(self, plan: RatioPlan | None, live: Frame, scene: Scene) -> DisplayImage:
        with self._context.timer.stage("move"):
            picture = live.image if plan is None else self._relighting.apply(plan, scene.look.lighting.blend)
        with self._context.timer.stage("compose"):
            return self._context.compositor.composite_live(picture, live, scene)

    def _plan(
        self, motion: FaceMotion, frame: Frame, scene: Scene, quality: RenderQuality
    ) -> RatioPlan | FaceMismatch | None:
        """What must be known to relight the frame; None without a face."""
        context, relighting, pose = self._context, self._relighting, motion.pose
        if pose is None:
            return None
        with context.timer.stage("room"):
            room = relighting.room_light.update(frame.image, motion.landmarks, motion.rotation, frame.time_s)
            mismatch = self._identity.check(motion, room.residual, frame.time_s)
        if mismatch is not None:
            return mismatch
        pictures = self._compared.compare(
            scene,
            motion.rotation,
            frame.time_s,
            room.light_map,
            room.in_head_frame,
            relighting.raised_lights,
            quality.relight_every,
        )
        with context.timer.stage("follow"):
            positions = relighting.positions(motion, pose, frame.size)
            eye_distance = context.face.scheme.eye_span(motion.landmarks)
            plan = RatioPlan(frame, float(motion.presence), room.gain, pictures, positions, eye_distance)
            return relighting.aligned(plan)


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
