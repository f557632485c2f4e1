"""Reads the source and decides what is published: the relit picture, the fallback, or a placeholder that says why."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.errors import DeviceError
from relit_camera.base.images.image_types import Frame
from relit_camera.devices.sources.source import Source, SourceState
from relit_camera.face.face_state import FaceStatus
from relit_camera.live.filmed_frames import FilmedFrames
from relit_camera.live.frame_recorder import FrameRecorder
from relit_camera.live.pipeline import RenderedFrame
from relit_camera.live.publishing.placeholder_image import Placeholder
from relit_camera.live.publishing.publisher import PublishedPicture, Publisher
from relit_camera.live.publishing.what_is_shown import Shown
from relit_camera.live.scene.scene import Scene
from relit_camera.live.status.camera_status import CameraState, DegradationCode
from relit_camera.live.status.stage_timing import RateMeter
from relit_camera.live.status.status_board import StatusBoard
from relit_camera.live.supervision.fallback_renderer import FallbackRenderer
from relit_camera.live.supervision.framing_monitor import FramingMonitor
from relit_camera.live.supervision.pipeline_supervisor import PipelineSupervisor, ShownPicture


@dataclass(frozen=True)
class LoopTimings:
    """Waits of the camera loop, in seconds.

    Attributes:
        read_timeout_s: how long one read of the source may wait for a frame.
        source_retry_s: pause after the source has failed.
    """

    read_timeout_s: float = 0.2
    source_retry_s: float = 1.0


@dataclass(frozen=True)
class Placeholders:
    """Pictures for when no frame may be shown, of the output's size.

    Attributes:
        waiting: the source is looked for.
        released: nobody reads the camera, so the webcam is off.
        capturing: a first subject is captured, and nothing may be shown unlit.
        no_subject: nobody is chosen, and nothing may be shown unlit.
    """

    waiting: Placeholder
    released: Placeholder
    capturing: Placeholder
    no_subject: Placeholder


DEFAULT_TIMINGS = LoopTimings()


class CameraLoop:
    """Takes each frame from the source to the pipeline, and says what is going on. Belongs to the thread that runs it.

    Attributes:
        camera_rate: frames a second that the source gives.
        pipeline_rate: pictures a second that the pipeline renders.
        skipped: frames that the source dropped, because this loop came too late for them.
    """

    def __init__(
        self,
        source: Source,
        supervisor: PipelineSupervisor,
        fallback: FallbackRenderer,
        publisher: Publisher,
        placeholders: Placeholders,
        scene: Callable[[], Scene],
        board: StatusBoard,
        recorder: FrameRecorder,
        filmed: FilmedFrames,
        is_capturing: Callable[[], bool] = lambda: False,
        timings: LoopTimings = DEFAULT_TIMINGS,
        clock: Clock = SYSTEM_CLOCK,
        framing: FramingMonitor | None = None,
    ) -> None:
        self._source, self._supervisor, self._fallback = source, supervisor, fallback
        self._publisher, self._placeholders, self._scene, self._board = publisher, placeholders, scene, board
        self._recorder, self._filmed, self._framing = recorder, filmed, framing
        self._is_capturing, self._timings, self._clock = is_capturing, timings, clock
        self._last_index = -1
        self.skipped = 0
        self.camera_rate, self.pipeline_rate = RateMeter(clock=clock), RateMeter(clock=clock)

    def run(self, stopping: threading.Event) -> None:
        """Go on until `stopping` is set."""
        while not stopping.is_set():
            self.step(stopping)

    def step(self, stopping: threading.Event) -> None:
        """Wait for one frame and handle it, and what the workers did meanwhile."""
        self._publisher.hold = self._scene().frozen
        frame = self._read(stopping)
        for shown in self._supervisor.handle_messages():
            self._note_shown(shown)
        if frame is None:
            return
        self._count(frame)
        self._recorder.offer(frame)
        self._filmed.offer(frame)
        if self._framing is not None:
            self._framing.offer(frame)
        scene = self._scene()
        if scene.frozen:
            return
        if scene.shows_nobody:
            self._fallback.forget()
        if scene.shows_nobody and not scene.unlit_allowed:
            if self._is_capturing():
                self._show(self._placeholders.capturing, CameraState.CAPTURING, at_once=True)
            else:
                self._show(self._placeholders.no_subject, CameraState.NO_SUBJECT, at_once=True)
            return
        if self._supervisor.submit_frame(frame):
            self._fallback.release(frame.captured_at)
        else:
            picture = self._fallback.picture(frame, scene)
            if picture is not None:
                image, unlit = picture.image, picture.unlit
                self._publisher.pictures.put(PublishedPicture(image, frame.captured_at, frame.index, unlit))
            else:
                self._publisher.hold = True  # the last one stays
            if self._failing():
                self._board.set_state(CameraState.FALLBACK)

    def _read(self, stopping: threading.Event) -> Frame | None:
        try:
            frame = self._source.read(self._timings.read_timeout_s)
        except Exception as error:  # nothing that a source does may end the camera
            self._board.report(DegradationCode.SOURCE_FAILED, error)
            self._show(self._placeholders.waiting, CameraState.WAITING)
            self._clock.wait(stopping, self._timings.source_retry_s)
            return None
        if frame is not None:
            self._board.report(DegradationCode.SOURCE_FAILED, None)
            return frame
        state, reason = self._source.state, self._source.reason
        if state is SourceState.RELEASED:
            self._board.report(DegradationCode.SOURCE_FAILED, None)
            self._show(self._placeholders.released, CameraState.RELEASED)
        elif state is not SourceState.RUNNING:
            if reason:
                why = DeviceError(reason, "it is tried again by itself; see `relit devices`")
                self._board.report(DegradationCode.SOURCE_FAILED, why)
            if reason or self._board.state is not CameraState.STARTING:
                self._show(self._placeholders.waiting, CameraState.WAITING)
            if state is SourceState.ENDED:
                self._clock.wait(stopping, self._timings.read_timeout_s)  # its `read` returns at once
        return None

    def _failing(self) -> bool:
        codes = DegradationCode.PICTURE_FAILED, DegradationCode.MODELS_MISSING
        return any(map(self._board.is_degraded, codes))

    def _show(self, placeholder: Placeholder, state: CameraState, at_once: bool = False) -> None:
        self._fallback.forget()
        self._publisher.show_placeholder(placeholder.image, self._last_index, at_once)
        self._board.set_state(state)

    def _count(self, frame: Frame) -> None:
        """Count the frames that the source gave, including dropped ones: indices have gaps there."""
        given = frame.index - self._last_index
        self._last_index, self.skipped = frame.index, self.skipped + given - 1
        self.camera_rate.tick(frame.captured_at, given)

    def _note_shown(self, shown: ShownPicture) -> None:
        self.pipeline_rate.tick(shown.at)
        motion = shown.rendered.motion
        self._fallback.note_live(shown.frame, shown.rendered)
        face = motion.status if motion else FaceStatus.LOST
        self._board.set_face(face)
        # A picture of a frame before the one that failed is no recovery: fallbacks follow.
        if not self._failing() and shown.frame.index > self._publisher.superseded_index:
            tracked = motion is None or face is not FaceStatus.LOST
            state = CameraState.LIVE if tracked else CameraState.SEARCHING
            self._board.set_state(CameraState.OTHER_PERSON if shown.rendered.shown is Shown.PLACEHOLDER else state)


def publish_if_current(publisher: Publisher, scene: Callable[[], Scene], frame: Frame, rendered: RenderedFrame) -> bool:
    """Publish a rendered picture unless the scene forbids it by now. Returns whether it is published.

    The picture may come late, from a pipeline that hung: one of another subject or mode must not show, for the live
    picture may be private by now, nor may a held picture change.
    """
    now, then = scene(), rendered.scene
    if now.frozen or not now.has_same_subject(then) or now.look.mode is not then.look.mode:
        return False
    if rendered.unlit and not now.unlit_allowed:
        return False
    if rendered.other_person and then.avatar_allowed and not now.avatar_allowed:
        return False
    publisher.pictures.put(PublishedPicture(rendered.image, frame.captured_at, frame.index, rendered.unlit))
    return True
