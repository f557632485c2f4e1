"""One frame from left to right: track → light → relight, and beside it follow; then move → compose."""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.config.look import Mode
from relit_camera.base.config.settings import ReenactSettings, TrackerSettings
from relit_camera.base.errors import SubjectError
from relit_camera.base.images.color import linear_from_uint8
from relit_camera.base.images.image_types import DisplayImage, Frame, LinearImage
from relit_camera.base.images.resize import crop_to_fill
from relit_camera.base.images.tone_mapping import linear_from_display
from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.face.face_state import Tracker
from relit_camera.face.motion.face_follower import FaceFollower, FaceFollowerSettings, FaceMotion
from relit_camera.light.light_map import LightMap
from relit_camera.light.light_map_rotation import rotate_light_map
from relit_camera.live.compositing.compositor import Compositor
from relit_camera.live.compositing.matting import Matting
from relit_camera.live.reenactment.reenactor import Reenactor, ReenactorContext, WarpedLayer, WarpTask, open_reenactor
from relit_camera.live.reenactment.source_image import find_source_face
from relit_camera.live.scene.light_transition import LightTransition
from relit_camera.live.scene.scene import Scene
from relit_camera.live.status.camera_status import Degradation, DegradationCode
from relit_camera.live.status.stage_timing import StageTimer
from relit_camera.subject.relighting.basis_relighter import BasisRelighter
from relit_camera.subject.relighting.relighter import Relighter
from relit_camera.subject.subject import Subject

log = logging.getLogger(__name__)

NO_SUBJECT = Degradation(
    code=DegradationCode.NO_SUBJECT,
    what="the live picture is shown as it is",
    why="no subject is chosen",
    cure="choose one in the panel or with --subject",
)
REENACTOR_OF_MODE = {Mode.REENACT: "first-order", Mode.RATIO: "ratio"}


@dataclass(frozen=True)
class RenderedFrame:
    """A frame at the end of the line.

    Attributes:
        image: uint8 sRGB RGB of the output's size.
        motion: what the face did; None while there is no tracker or no subject.
        scene: that it was made for.
    """

    image: DisplayImage
    motion: FaceMotion | None
    scene: Scene


RenderTask = Callable[[], RenderedFrame]
"""Makes the picture of a frame that was begun. Called once, in the order of the frames."""


@dataclass(frozen=True)
class _ActiveSubject:
    """What belongs to one subject in one mode."""

    subject: Subject
    mode: Mode
    relighter: Relighter
    reenactor: Reenactor


class Pipeline:
    """Makes relit pictures of live frames. What may change reaches it as a `Scene` a frame.

    A frame is made in two halves, `begin` and the `RenderTask` that it returns. One thread may begin the next frame
    while
    another finishes this one; finishes keep the order of their frames. Within the first half, how the still must move
    is found out while it is relit. So two cores have a frame each thirtieth of a second that takes one core longer.

    Attributes:
        timer: how long each stage took.
    """

    def __init__(
        self,
        tracker: Tracker,
        size: tuple[int, int],
        tracking: TrackerSettings,
        reenact: ReenactSettings,
        options: SessionOptions,
        open_matte: Callable[[], Matting],
    ) -> None:
        self.timer = StageTimer()
        self._tracker = tracker
        self._size = size
        self._reenact = reenact
        self._options = options
        rotation = FaceFollowerSettings().rotation
        self._follower = FaceFollower(
            tracker.scheme,
            FaceFollowerSettings(
                reach_yaw_deg=tracking.reach_yaw_deg,
                reach_pitch_deg=tracking.reach_pitch_deg,
                rotation=type(rotation)(rotation.min_cutoff_hz, rotation.beta, tracking.dead_band_deg),
            ),
        )
        self._light = LightTransition()
        self._compositor = Compositor(size, open_matte, self.timer)
        self._warp_executor = ThreadPoolExecutor(1, "follow")
        self._active: _ActiveSubject | None = None
        self._last_relit: tuple[_ActiveSubject, LightMap, LinearImage] | None = None
        self._mismatched_subject: Subject | None = None
        self._troubles: dict[str, Degradation] = {}

    @property
    def troubles(self) -> list[Degradation]:
        """What works less well than asked."""
        return list(self._troubles.values())

    def reset_neutral(self) -> None:
        """Take the neutral face anew. May be called from any thread."""
        self._follower.reset_neutral()

    def process(self, frame: Frame, scene: Scene) -> RenderedFrame:
        """Make the picture of one live frame: begin it, and finish it at once.

        Raises:
            SubjectError: no face is found in the subject's still.
            ModelError: a model that the scene needs is missing.
        """
        return self.begin(frame, lambda: scene)()

    def begin(self, frame: Frame, scene_now: Callable[[], Scene]) -> RenderTask:
        """Follow the face, relight the still, and give what makes the picture of both.

        The scene is asked for as late as can be, after the face is tracked: so a change shows that much earlier.

        Raises:
            SubjectError: no face is found in the subject's still.
            ModelError: a model that the scene needs is missing; so does the finish.
        """
        motion = self._track(frame) if scene_now().subject else None
        return self._relight_and_plan_warp(frame, motion, scene_now())

    def _track(self, frame: Frame) -> FaceMotion:
        with self.timer.stage("track"):
            return self._follower.follow(self._tracker.track(frame), frame.size, frame.time_s)

    def _relight_and_plan_warp(self, frame: Frame, motion: FaceMotion | None, scene: Scene) -> RenderTask:
        subject, mode = scene.subject, self._mode(scene)
        if subject is None or motion is None:
            self._troubles["subject"] = NO_SUBJECT
            return lambda: self._render_unrelit(fit_frame(frame, self._size), scene)
        self._troubles.pop("subject", None)
        active, live, tracked = self._prepare(subject, mode), frame, motion
        if mode is Mode.RATIO:
            live, motion = fit_frame(frame, self._size), fit_motion(motion, frame.size, self._size)
        warp_plan = self._warp_executor.submit(self._plan_warp, active, motion, live)
        with self.timer.stage("light"):
            room = self._light.update(scene, frame.time_s)
            light = rotate_light_map(room, motion.rotation)
        with self.timer.stage("relight"):
            relit = self._relight(active, light * np.float32(subject.metadata.display_gain))
            if mode is Mode.REENACT and scene.look.lighting.blend < 1:
                relit = blend_with_source(subject, relit, scene.look.lighting.blend)
        warp_task = warp_plan.result()
        if warp_task is None:
            return self._relight_and_plan_warp(frame, tracked, scene)

        def finish() -> RenderedFrame:
            with self.timer.stage("move"):
                layer = warp_task(relit)
            with self.timer.stage("compose"):
                return RenderedFrame(self._compose(layer, mode, live, scene), motion, scene)

        return finish

    def _render_unrelit(self, live: Frame, scene: Scene) -> RenderedFrame:
        return RenderedFrame(self._compositor.live(linear_from_display(live.image), live, scene), None, scene)

    def _mode(self, scene: Scene) -> Mode:
        """The mode asked for, or reenact where the live face is known not to be the subject's."""
        if scene.subject is not self._mismatched_subject:
            self._mismatched_subject = None
            self._troubles.pop("ratio", None)
        return Mode.REENACT if self._mismatched_subject is not None else scene.look.mode

    def _prepare(self, subject: Subject, mode: Mode) -> _ActiveSubject:
        active = self._active
        if active is not None and active.subject is subject and active.mode is mode:
            return active
        same = active is not None and active.subject is subject
        relighter = active.relighter if active is not None and same else BasisRelighter(subject)
        face = find_source_face(subject, self._tracker)
        stage = ReenactorContext(subject, relighter, face, self._size, self._options)
        name = REENACTOR_OF_MODE[mode]
        if mode is Mode.REENACT and self._reenact.model is not None:
            from relit_camera.live.reenactment.onnx_network.onnx_reenactor import OnnxReenactor

            reenactor: Reenactor = OnnxReenactor(stage, self._reenact.model)
        else:
            reenactor = open_reenactor(name, stage)
        self._active = _ActiveSubject(subject, mode, relighter, reenactor)
        return self._active

    def _relight(self, active: _ActiveSubject, light: LightMap) -> LinearImage:
        """The still under `light`; the last picture again while neither the light nor the head has moved."""
        if (
            self._last_relit is None
            or self._last_relit[0] is not active
            or not np.array_equal(self._last_relit[1], light)
        ):
            self._last_relit = (active, light, active.relighter.relight(light))
        return self._last_relit[2]

    def _plan_warp(self, active: _ActiveSubject, motion: FaceMotion, frame: Frame) -> WarpTask | None:
        """How to move the relit still, or None if the ratio cannot go on with this face: then reenact takes over."""
        try:
            with self.timer.stage("follow"):
                return active.reenactor.plan_warp(motion, frame)
        except SubjectError as error:
            if active.mode is not Mode.RATIO:
                raise
            log.warning("mode ratio falls back to reenact: %s", error)
            self._mismatched_subject = active.subject
            self._troubles["ratio"] = Degradation(
                code=DegradationCode.FACE_MISMATCH,
                what="mode ratio shows the reenacted still",
                why=error.what,
                cure=error.cure,
            )
            return None

    def _compose(self, layer: WarpedLayer, mode: Mode, frame: Frame, scene: Scene) -> DisplayImage:
        if mode is Mode.RATIO:
            blend = np.float32(scene.look.lighting.blend)
            picture = layer.picture
            if blend < 1:
                picture = linear_from_display(frame.image) * (1 - blend) + picture * blend
            return split_view(self._compositor.live(picture, frame, scene), frame.image, scene.look.lighting.split)
        return self._compositor.still(layer, scene, frame.time_s)


def blend_with_source(subject: Subject, relit: LinearImage, share: float) -> LinearImage:
    """A `share` of the relit still, and for the rest the still as it was captured, in soft light from the front.

    Reenact has no live picture to blend with: that stays private.
    """
    return np.asarray(linear_from_uint8(subject.neutral) * (1 - share) + relit * share, dtype=np.float32)


def split_view(after: DisplayImage, before: DisplayImage, share: float) -> DisplayImage:
    """`after` with a `share` of its width, from the left, as it was `before`, and a white line between them."""
    columns = round(share * after.shape[1])
    if columns == 0:
        return after
    shown = after.copy()
    shown[:, :columns] = before[:, :columns]
    if columns < after.shape[1]:
        shown[:, columns - 1 : columns + 1] = 255
    return shown


def _cover_transform(size: tuple[int, int], to: tuple[int, int]) -> tuple[float, NDArray[np.float64]]:
    """Scale and shift (2,) that let a picture of `size` (width, height) cover one of size `to`, middle on middle."""
    scale = max(to[0] / size[0], to[1] / size[1])
    return scale, (np.array(to) - scale * np.array(size)) / 2


def fit_motion(motion: FaceMotion, size: tuple[int, int], to: tuple[int, int]) -> FaceMotion:
    """The motion seen in a frame of `size` (width, height), as it is seen in that frame `fit_frame` to another."""
    scale, shift = _cover_transform(size, to)
    pose = motion.pose and replace(motion.pose, focal_px=motion.pose.focal_px * scale)
    return replace(motion, landmarks=(motion.landmarks * scale + shift).astype(np.float32), pose=pose)


def fit_frame(frame: Frame, size: tuple[int, int]) -> Frame:
    """The frame scaled to cover `size` (width, height) and cut to it about its middle; the frame itself if it fits."""
    return frame if frame.size == size else replace(frame, image=crop_to_fill(frame.image, size))
