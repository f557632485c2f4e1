"""Mode live: the live picture itself, with its light exchanged, before its own or another background."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.base.images.resize import MIDDLE
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.modes.face_lighting import FaceLighting, LitAs
from relit_camera.live.modes.frame_fitting import FaceCut, fit_frame, fit_motion
from relit_camera.live.modes.frame_relighting import FacePlan, FramePlan, FrameRelighting
from relit_camera.live.modes.mode import ModeContext, RenderedFrame, RenderTask
from relit_camera.live.publishing.what_is_shown import FacePresence, Situation, what_is_shown
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.live.render_quality import RenderQuality
from relit_camera.live.scene.scene import Scene
from relit_camera.subject.subject import Subject

REST_S = 0.3
"""Time constant with which the factor of a person whose face is not seen follows what is known."""


@dataclass(frozen=True)
class _LitFurtherFace:
    """What is known of a further face, and of what frame: its motion there, where that was cut, and how it is relit."""

    lighting: FaceLighting
    motion: FaceMotion | None = None
    middle: tuple[float, float] = MIDDLE
    plan: FacePlan | None = None


class LiveMode:
    """See `RenderMode`.

    Where the light of the face cannot be told, because it is lost, in profile or not yet seen, the person goes on in
    the mean factor that they had, and before one is known in the mean tint of the place, which in a neutral place is
    hardly any. Further persons are lit as anyone is, each in the light on their own face.
    """

    def __init__(self, context: ModeContext, prepare: Callable[[Subject, SourceFace], LitAs]) -> None:
        """Set up.

        Args:
            context: what the mode works with.
            prepare: makes what lights a live face as a subject's.
        """
        self._context = context
        self._prepare = prepare
        first = prepare(context.subject, context.face)
        self._compared = context.open_scene_relighting(first.relighting.subject, first.relighting.face)
        self._first = FaceLighting(first, self._compared, context.timer)
        self._as_anyone: LitAs | None = None
        self._others: dict[int, _LitFurtherFace] = {}
        self._frames = FrameRelighting()
        self._cut = FaceCut(context.size)
        self._told = False
        self._rest: NDArray[np.float32] | None = None
        self._rest_s = 0.0

    def begin(
        self,
        frame: Frame,
        motion: FaceMotion,
        scene: Scene,
        quality: RenderQuality,
        others: Mapping[int, FaceMotion],
    ) -> RenderTask:
        """See `RenderMode.begin`: relights the source image in both lights, and finds where it lies on the live face.

        The task multiplies and composes.
        """
        context = self._context
        middle = self._cut.middle(motion, frame)
        live = fit_frame(frame, context.size, middle)
        fitted = fit_motion(motion, frame.size, context.size, middle)  # what is given on is that of the frame
        lit = self._first.update(fitted, live, scene, quality)
        self._told = self._told or lit.mean is not None
        rest = self._compared.place_tint(scene, frame.time_s) if lit.mean is None else lit.mean
        further = self._further(live, frame.size, middle, scene, quality, others)
        plan = FramePlan(live, self._eased_rest(rest, frame.time_s), lit.plan, further)
        return partial(self._render, plan, self._seen(plan), motion, scene, quality.matte_every)

    def _render(
        self, plan: FramePlan, seen: FacePresence, motion: FaceMotion, scene: Scene, matte_every: int
    ) -> RenderedFrame:
        """The relit live picture, and where `split` says so the live one."""
        context, lighting, live = self._context, scene.look.lighting, plan.frame
        with context.timer.stage("move"):
            relit = self._frames.apply(plan, lighting.blend)
            alpha = context.compositor.person_alpha(live, scene, relit.person, matte_every)
            picture = relit.picture(None if alpha is None else context.compositor.needed(alpha, scene))
        with context.timer.stage("compose"):
            image = context.compositor.composite_live(picture, alpha, live, scene)
        shown = what_is_shown(Situation(scene.look.mode, seen))
        image = split_view(image, live.image, lighting.split)
        return RenderedFrame(image, motion, scene, shown, unlit=scene.look.shows_filmed)

    def _further(
        self,
        live: Frame,
        filmed_size: tuple[int, int],
        middle: tuple[float, float],
        scene: Scene,
        quality: RenderQuality,
        motions: Mapping[int, FaceMotion],
    ) -> tuple[FacePlan, ...]:
        """How the further faces are relit; those that are not followed any more are forgotten.

        A face whose motion is that of the last frame is relit as it was there.
        """
        context, kept = self._context, self._others
        self._others = {}
        for number, motion in motions.items():
            known = kept.get(number)
            if known is None:
                if self._as_anyone is None:
                    self._as_anyone = self._prepare(*context.anyone())
                relighting = self._as_anyone.relighting
                compared = context.open_scene_relighting(relighting.subject, relighting.face)
                first_frame = self._rest is None
                known = _LitFurtherFace(FaceLighting(self._as_anyone, compared, context.timer, at_once=first_frame))
            if known.motion is not motion or known.middle != middle:
                fitted = fit_motion(motion, filmed_size, context.size, middle)
                plan = known.lighting.update(fitted, live, scene, quality).plan
                known = _LitFurtherFace(known.lighting, motion, middle, plan)
            self._others[number] = known
        return tuple(each.plan for each in self._others.values() if each.plan is not None)

    def _seen(self, plan: FramePlan) -> FacePresence:
        if plan.first is not None:
            return FacePresence.FOLLOWED
        return FacePresence.LOST if self._told else FacePresence.NOT_YET

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
