"""The running camera: source → worker → line → publisher → sink, under the director's scene.

Whatever fails or hangs, pictures keep coming: while the line gives none the worker makes stand-ins, and while the
worker gives none the publisher shows the last picture or the placeholder.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from relit_camera import __version__
from relit_camera.app.wiring import make_pipeline
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.errors import DeviceError, RelitError, StorageError
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.base.models.session_with_fallback import session_report
from relit_camera.devices.sinks.sink import Sink
from relit_camera.devices.sources.source import Source, SourceState
from relit_camera.face.face_state import FaceStatus, Tracker
from relit_camera.live.pipeline import RenderedFrame
from relit_camera.live.publishing.placeholder_image import placeholder
from relit_camera.live.publishing.publisher import PublishedPicture, Publisher
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.camera_status import CameraState, CameraStatus, Degradation, Rates, TrackerStatus
from relit_camera.live.status.event_hub import EventHub
from relit_camera.live.status.stage_timing import RateMeter
from relit_camera.live.supervision.fallback_renderer import FallbackRenderer
from relit_camera.live.supervision.pipeline_supervisor import PipelineSupervisor

log = logging.getLogger(__name__)

READ_TIMEOUT_S = 0.2
STALE_AFTER_S = 3.0
"""Without a new picture for this long the placeholder is shown."""
RELEASED_MESSAGE = "the webcam is off until somebody looks"
"""What the placeholder says in on-demand mode."""
RETRY_S = 1.0
"""Pause after a failure of the source."""
STOP_TIMEOUT_S = 2.0
"""What has not ended by then, a device or a network that hangs, is left behind."""
DISK_TIMEOUT_S = 30.0
"""For so long a disk that does not answer is waited for at the end of a recording."""
HANGING_THREAD_PREFIXES = ("source-", "worker", "line", "finisher", "publisher")
"""Threads that may be inside a driver or a network."""


class CameraService:
    """Implements `live.camera_control.CameraControl`. Owns source and sink: `stop` closes them."""

    def __init__(
        self,
        settings: RelitSettings,
        scene_controller: SceneController,
        source: Source,
        sink: Sink,
        tracker: Tracker,
        new_tracker: Callable[[], Tracker] | None = None,
        on_viewer: Callable[[], None] = lambda: None,
    ) -> None:
        """Set up; `start` begins.

        Args:
            settings: of this run.
            scene_controller: holds the scene.
            source: of live pictures.
            sink: takes finished ones.
            tracker: follows the face.
            new_tracker: makes another like it, in place of one that hangs; the same again if not given.
            on_viewer: called whenever somebody asks for a preview or a snapshot.

        Raises:
            ImageError: the placeholder picture cannot be read.
        """
        self._foreign_threads = set(threading.enumerate())
        self.scene_controller = scene_controller
        self.events = EventHub()
        self._source, self._sink, self._tracker = source, sink, tracker
        size = (settings.output.width, settings.output.height)
        self._supervisor = PipelineSupervisor(
            make_pipeline(settings, tracker, size),
            lambda: make_pipeline(settings, new_tracker() if new_tracker else tracker, size),
            lambda: self.scene_controller.scene,
            self._done,
            partial(self.report_trouble, "picture"),
        )
        self._publisher = Publisher(
            sink,
            settings.output.fps,
            placeholder(size, "starting", settings.output.placeholder),
            stale_after_s=STALE_AFTER_S,
            on_sink_error=partial(self.report_trouble, "sink"),
        )
        self._waiting_picture = placeholder(size, "waiting for the camera", settings.output.placeholder)
        trouble = placeholder(size, "the picture has failed: see the panel", settings.output.placeholder)
        self._fallback = FallbackRenderer(size, settings.output.fallback, trouble)
        self._released_picture = placeholder(size, RELEASED_MESSAGE, settings.output.placeholder)
        self._on_viewer = on_viewer
        self._troubles: dict[str, Degradation] = {}
        self._face = FaceStatus.LOST
        self._camera_rate, self._pipeline_rate = RateMeter(), RateMeter()
        self._index, self._skipped = -1, 0
        self._state = CameraState.STARTING
        self._showing = threading.Lock()
        self._started_at = time.monotonic()
        self._stopping = threading.Event()
        self._stop_by = 0.0
        self._ending: list[threading.Thread] = []
        self._worker = threading.Thread(target=self._run, name="worker", daemon=True)

    def start(self) -> None:
        """Begin to read, relight and publish."""
        self._publisher.start()
        self._worker.start()

    def request_stop(self) -> None:
        """Tell all threads to end, and return at once. Harmless when repeated."""
        if self._stopping.is_set():
            return
        self._stopping.set()
        self._set_state(CameraState.STOPPING)
        self._stop_by = time.monotonic() + STOP_TIMEOUT_S
        self._supervisor.close()
        for end in (self._publisher.stop, self._source.close):
            thread = threading.Thread(target=end, daemon=True)
            thread.start()
            self._ending.append(thread)

    def stop(self) -> None:
        """End all threads and free the devices, within `STOP_TIMEOUT_S` of `request_stop`. Harmless when repeated.

        What hangs is left behind (see `hung_threads`), but for a disk that is slow to take the end of a recording.

        Raises:
            StorageError: the end of the recording cannot be written, or it was lost before.
        """
        self.request_stop()
        for thread in (self._worker, *self._ending):
            if thread.ident is not None:
                thread.join(max(0.0, self._stop_by - time.monotonic()))
        self._supervisor.ended(self._stop_by)
        recording = self._sink.describe().kind == "file"
        if self._publisher.ended(DISK_TIMEOUT_S if recording else 0.0):
            self._sink.close()
        elif recording:
            raise StorageError("the recording is lost: the disk does not answer", "write it to another disk")
        # else closing would wait for the driver that writing waits for

    @property
    def hung_threads(self) -> list[str]:
        """Threads that have not ended, by name.

        One that is inside OpenCV or a driver when the interpreter ends would abort or hold up the process.
        """
        threads = set(threading.enumerate()) - self._foreign_threads
        return [thread.name for thread in threads if thread.name.startswith(HANGING_THREAD_PREFIXES)]

    def stopping(self) -> bool:
        """Whether the camera is shutting down."""
        return self._stopping.is_set()

    def status(self) -> CameraStatus:
        """What is going on."""
        scene, source, sink = self.scene_controller.scene, self._source.describe(), self._sink.describe()
        pipeline = self._supervisor.pipeline
        troubles = [*self._troubles.values(), *pipeline.troubles]
        counts, sessions = self._publisher.counts, session_report()
        troubles += [Degradation(f"model {s.name} runs on {s.provider}", s.why, s.cure) for s in sessions if s.why]
        return CameraStatus(
            state=CameraState.FROZEN if scene.frozen else self._state,
            source=f"{source.kind} {source.id}".strip(),
            sink=f"{sink.kind} {sink.id}".strip(),
            subject=scene.subject_name,
            mode=str(scene.look.mode),
            tracker=TrackerStatus(self._tracker.name, str(self._face)),
            fps=Rates(self._camera_rate.rate(), self._pipeline_rate.rate(), self._publisher.fps),
            latency_ms=self._publisher.latency_ms,
            stage_ms=pipeline.timer.percentiles(),
            frames=replace(counts, dropped=counts.dropped + self._skipped + self._supervisor.dropped),
            providers={s.name: s.provider for s in sessions} | pipeline.providers,
            degraded=troubles,
            version=__version__,
            uptime_s=time.monotonic() - self._started_at,
        )

    def picture(self, after: int, timeout_s: float) -> tuple[int, DisplayImage] | None:
        """The newest published picture and its count; see `CameraControl.picture`."""
        self._on_viewer()
        found = self._publisher.shown.newer(after, timeout_s)
        return None if found is None or self.stopping() else (found[0], found[1])

    def reset_neutral_pose(self) -> None:
        """Take the present head pose as neutral."""
        self._supervisor.pipeline.reset_neutral()
        self.events.publish("neutral-pose")

    def report_trouble(self, what: str, error: Exception | None) -> None:
        """Let the status and the events say that something fails, or with None that it works again."""
        if error is None:
            self._recovered(what)
        else:
            self._failed(what, error)

    def _run(self) -> None:
        while not self._stopping.is_set():
            self._publisher.hold = self.scene_controller.scene.frozen
            frame = self._read()
            if frame is None:
                continue
            self._count(frame)
            if self.scene_controller.scene.frozen:
                continue
            if self._supervisor.submit_frame(frame):
                self._fallback.release()
            else:
                self._publish_fallback(frame)

    def _publish_fallback(self, frame: Frame) -> None:
        image = self._fallback.picture(frame, self.scene_controller.scene)
        self._publish(image, frame)
        if "picture" in self._troubles:
            self._set_state(CameraState.STANDING_IN)

    def _done(self, frame: Frame, finished: RenderedFrame) -> None:
        now, then = self.scene_controller.scene, finished.scene
        if now.frozen or now.subject is not then.subject or now.look.mode is not then.look.mode:
            return  # it hung, maybe for long: the live picture must not show once it is private
        self._pipeline_rate.tick()
        self._publish(finished.image, frame)
        self._update_tracking(frame, finished)

    def _publish(self, image: DisplayImage, frame: Frame) -> None:
        self._publisher.pictures.put(PublishedPicture(image, frame.captured_at, frame.index))

    def _read(self) -> Frame | None:
        try:
            frame = self._source.read(READ_TIMEOUT_S)
        except Exception as error:  # nothing that a source does may end the camera
            self._failed("source", error)
            self._show_waiting()
            self._stopping.wait(RETRY_S)
            return None
        if frame is not None:
            self._recovered("source")
        elif self._source.state is SourceState.RELEASED:
            self._recovered("source")
            self._show(self._released_picture, CameraState.RELEASED)
        elif (state := self._source.state) is not SourceState.RUNNING:
            reason = self._source.reason
            if reason:
                self._failed("source", DeviceError(reason, "it is tried again by itself; see `relit devices`"))
            if reason or self._state is not CameraState.STARTING:
                self._show_waiting()
            if state is SourceState.ENDED:
                self._stopping.wait(READ_TIMEOUT_S)  # its `read` no longer waits
        return frame

    def _show_waiting(self) -> None:
        self._show(self._waiting_picture, CameraState.WAITING)

    def _show(self, picture: DisplayImage, state: CameraState) -> None:
        with self._showing:
            self._publisher.show_placeholder(picture, self._index)
            self._set_state(state)

    def _count(self, frame: Frame) -> None:
        """Frames that the source gave, those too that were replaced before the worker came: indices have gaps there."""
        given = frame.index - self._index
        self._index, self._skipped = frame.index, self._skipped + given - 1
        self._camera_rate.tick(frame.captured_at, given)

    def _update_tracking(self, frame: Frame, finished: RenderedFrame) -> None:
        face = finished.motion.status if finished.motion else FaceStatus.LOST
        if face is not self._face:
            self._face = face
            self.events.publish("tracking", state=str(face))
        seen = finished.motion is None or face is not FaceStatus.LOST
        with self._showing:
            if frame.index > self._publisher.superseded_index:
                self._set_state(CameraState.LIVE if seen else CameraState.SEARCHING)

    def _set_state(self, state: CameraState) -> None:
        # A frame that is finished while the camera stops does not make it live again.
        if state is not self._state and self._state is not CameraState.STOPPING:
            self._state = state
            self.events.publish("state", state=str(state))

    def _failed(self, what: str, error: Exception) -> None:
        trouble = (
            Degradation(f"{what} failed", error.what, error.cure)
            if isinstance(error, RelitError)
            else Degradation(f"{what} failed", f"{type(error).__name__}: {error}", "this is a fault of ours: report it")
        )
        if self._troubles.get(what) != trouble:
            self._troubles[what] = trouble
            log.error("%s: %s", trouble.what, trouble.why, exc_info=not isinstance(error, RelitError))
            self.events.publish("degraded", what=trouble.what, why=trouble.why, cure=trouble.cure)

    def _recovered(self, what: str) -> None:
        if self._troubles.pop(what, None) is not None:
            self.events.publish("recovered", what=what)
