"""The running camera: source → pipeline → publisher → sink, under the present scene.

Whatever fails or hangs, pictures keep coming: while the pipeline gives none the fallback renderer does, and while the
camera loop gives none the publisher repeats the last picture or shows the placeholder.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

from relit_camera import __version__
from relit_camera.app.captures.desk.controls_note import ControlsNote
from relit_camera.app.captures.desk.desk_filming import DeskFilming
from relit_camera.app.captures.desk.desk_worker import write_desk_subject
from relit_camera.app.captures.expressions.expression_job import ExpressionJob
from relit_camera.app.captures.expressions.expression_worker import write_filmed_stills, write_video_stills
from relit_camera.app.captures.expressions.guided_filming import GuidedFilming
from relit_camera.app.captures.film.film_processing import FilmProcessing
from relit_camera.app.captures.film.film_worker import write_film_subject
from relit_camera.app.captures.live_capture import LiveCapture
from relit_camera.app.captures.live_capture_worker import write_instant_subject
from relit_camera.app.demo import demo_files
from relit_camera.app.replay.replay_jobs import ReplayJobs
from relit_camera.app.replay.replay_worker import write_replay
from relit_camera.app.setup.camera_setup import CameraSetup
from relit_camera.app.setup.check_runner import Checks, no_checks
from relit_camera.app.setup.pipeline_choice import PipelineChoice
from relit_camera.base.concurrency.clock import SYSTEM_CLOCK
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.errors import ModelError, StorageError
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.base.models.session_with_fallback import session_report
from relit_camera.devices.device_discovery import find_webcam
from relit_camera.devices.on_demand.reader_list import ReaderList, all_readers
from relit_camera.devices.sinks.sink import Sink
from relit_camera.devices.sources.source import Source
from relit_camera.devices.webcam_controls import open_controls
from relit_camera.face.face_state import Tracker
from relit_camera.live.filmed_frames import FilmedFrames
from relit_camera.live.frame_recorder import FrameRecorder
from relit_camera.live.pipeline import RenderedFrame, subject_troubles
from relit_camera.live.publishing.placeholder_image import Placeholder, placeholder
from relit_camera.live.publishing.publisher import Publisher
from relit_camera.live.scene.present_light import PresentLight
from relit_camera.live.scene.scene import Scene
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.camera_status import (
    CameraState,
    CameraStatus,
    Degradation,
    DegradationCode,
    Rates,
    TrackerStatus,
)
from relit_camera.live.status.capture_status import CaptureStage
from relit_camera.live.status.event_hub import EventHub
from relit_camera.live.status.setup_status import SpeedAdvice
from relit_camera.live.status.speed_advice import SpeedState, next_speed, reduced_quality, speed_advice
from relit_camera.live.status.status_board import StatusBoard
from relit_camera.live.supervision.camera_loop import CameraLoop, LoopTimings, Placeholders, publish_if_current
from relit_camera.live.supervision.fallback_renderer import FallbackRenderer
from relit_camera.live.supervision.pipeline_health import HealthLimits
from relit_camera.live.supervision.pipeline_supervisor import PipelineSupervisor

RELEASED_MESSAGE = "the webcam is off until somebody looks"
"""What the placeholder says in on-demand mode."""
CAPTURING_MESSAGE = "no face is measured yet: look at the camera"
"""What the placeholder says while a first subject is captured."""
CAPTURING_STAGES = (CaptureStage.FILMING, CaptureStage.BUILDING, CaptureStage.FAILED)
"""Stages of an instant capture in which the person should look at the camera."""
NO_SUBJECT_MESSAGE = "nobody to show yet: choose or capture yourself in the panel"
"""What the placeholder says while nobody is chosen."""
HANGING_THREAD_PREFIXES = ("source-", "camera", "pipeline", "renderer", "fallback", "publisher")
"""Threads that may be inside a driver or a network."""


@dataclass(frozen=True)
class CameraTimings:
    """Limits and waits of a running camera, in seconds.

    Attributes:
        stale_after_s: the placeholder is shown when no picture came for so long.
        stop_timeout_s: what has not ended so long after `request_stop`, a device or a network that hangs, is abandoned.
        disk_timeout_s: how long a disk that does not answer is waited for at the end of a recording.
        loop: waits of the camera loop.
        pipeline: when the pipeline counts as failing or hanging.
    """

    stale_after_s: float = 3.0
    stop_timeout_s: float = 2.0
    disk_timeout_s: float = 30.0
    loop: LoopTimings = field(default_factory=LoopTimings)
    pipeline: HealthLimits = field(default_factory=HealthLimits)


DEFAULT_TIMINGS = CameraTimings()


class CameraService:
    """Implements `live.camera_control.CameraControl`. Owns source and sink: `stop` closes them."""

    demo_subject = demo_files.SUBJECT

    def __init__(
        self,
        settings: RelitSettings,
        scene_controller: SceneController,
        source: Source,
        sink: Sink,
        tracker: Tracker | None,
        new_tracker: Callable[[], Tracker] | None = None,
        on_viewer: Callable[[], None] = lambda: None,
        timings: CameraTimings = DEFAULT_TIMINGS,
        checks: Checks = no_checks,
    ) -> None:
        """Set up; `start` begins.

        Args:
            settings: of this run.
            scene_controller: holds the scene.
            source: of live frames.
            sink: takes finished pictures.
            tracker: tracks the face; None where its models are missing.
            new_tracker: makes another like it, in place of one that hangs; the same again if not given.
            on_viewer: called whenever somebody asks for a preview or a snapshot.
            timings: limits and waits.
            checks: checks what the camera needs of the machine, in a worker process.

        Raises:
            ImageError: the placeholder picture cannot be read.
        """
        self._threads_before = set(threading.enumerate())
        self.scene_controller = scene_controller
        self.events = EventHub()
        self._source, self._sink, self._output_fps = source, sink, settings.output.fps
        self._pipelines = PipelineChoice(settings, tracker, new_tracker)
        self._on_viewer, self._timings, self._clock = on_viewer, timings, SYSTEM_CLOCK
        self._board = StatusBoard(self.events)
        self._present_light = PresentLight()
        size = (settings.output.width, settings.output.height)
        self._speed = SpeedState()
        self._readers = ReaderList(lambda: sink.describe().id if sink.describe().kind == "camera" else "")
        own_picture = placeholder(size, picture=settings.output.placeholder) if settings.output.placeholder else None

        def make_placeholder(reason: str) -> Placeholder:
            return Placeholder(lambda: placeholder(size, reason) if own_picture is None else own_picture)

        recorder = FrameRecorder()
        self._filmed = FilmedFrames(size)
        webcam = threading.Lock()
        self.instant_capture = LiveCapture(
            recorder, scene_controller, self.events, write_instant_subject, on_viewer, webcam=webcam
        )
        self.desk_capture = DeskFilming(
            recorder,
            scene_controller,
            self.events,
            write_desk_subject,
            lambda: open_controls(find_webcam(source.describe().id).node),
            ControlsNote(settings.storage.data_dir, lambda: find_webcam(source.describe().id).id),
            lambda: 1 / max(source.describe().fps, 1.0),
            on_viewer,
            webcam=webcam,
        )
        storage = settings.storage
        self.expression_capture = ExpressionJob(
            storage.expression_capture,
            GuidedFilming(recorder, on_viewer),
            scene_controller,
            self.events,
            write_filmed_stills,
            write_video_stills,
            webcam=webcam,
        )
        self.film_capture = FilmProcessing(storage.film_capture, scene_controller, self.events, write_film_subject)
        self.replays = ReplayJobs(
            storage.replays, lambda: self.setup.settings, scene_controller, self.events, write_replay
        )
        self._publisher = Publisher(
            sink,
            settings.output.fps,
            make_placeholder("starting").image,
            stale_after_s=timings.stale_after_s,
            on_sink_error=partial(self._board.report, DegradationCode.SINK_FAILED),
            unlit_allowed=lambda: self._scene().unlit_allowed,
        )
        self._supervisor = PipelineSupervisor(
            self._pipelines.first(),
            self._pipelines.make,
            self._scene,
            self._publish,
            self._report_picture,
            timings.pipeline,
        )
        self._pipelines.replace_pipeline = self._supervisor.replace_pipeline
        self.setup = CameraSetup(
            settings,
            source,
            sink,
            self._board,
            self._pipelines,
            checks,
            on_viewer,
        )
        self._loop = CameraLoop(
            source,
            self._supervisor,
            FallbackRenderer(size, settings.output.fallback, make_placeholder("the picture has failed: see the panel")),
            self._publisher,
            Placeholders(
                make_placeholder("waiting for the camera"),
                make_placeholder(RELEASED_MESSAGE),
                make_placeholder(CAPTURING_MESSAGE),
                make_placeholder(NO_SUBJECT_MESSAGE),
            ),
            self._scene,
            self._board,
            recorder,
            self._filmed,
            lambda: self.instant_capture.status().stage in CAPTURING_STAGES,
            timings.loop,
            framing=self.setup.monitor,
        )
        self._started_at = self._clock.now()
        self._stopping = threading.Event()
        self._stop_by = 0.0
        self._ending: list[threading.Thread] = []
        self._thread = threading.Thread(target=self._loop.run, args=(self._stopping,), name="camera", daemon=True)

    def start(self) -> None:
        """Begin to read, relight and publish."""
        self._publisher.start()
        self._thread.start()

    def request_stop(self) -> None:
        """Ask all threads to end, and return at once. Harmless when repeated."""
        if self._stopping.is_set():
            return
        self._stopping.set()
        self._board.set_state(CameraState.STOPPING)
        self._stop_by = self._clock.now() + self._timings.stop_timeout_s
        self._supervisor.close()
        jobs = (
            self.instant_capture.cancel,
            self.desk_capture.cancel,
            self.expression_capture.close,
            self.film_capture.close,
            self.replays.close,
            self.setup.close,
            self._readers.close,
        )
        for end in (self._publisher.stop, self._source.close, *jobs):
            thread = threading.Thread(target=end, daemon=True)
            thread.start()
            self._ending.append(thread)

    def stop(self) -> None:
        """End all threads and free the devices, within `CameraTimings.stop_timeout_s` of `request_stop`.

        Harmless when repeated. What hangs is abandoned (see `hung_threads`), but a disk that is slow to take the end of
        a recording is waited for.

        Raises:
            StorageError: the end of the recording cannot be written, or it was lost before.
        """
        self.request_stop()
        for thread in (self._thread, *self._ending):
            if thread.ident is not None:
                thread.join(max(0.0, self._stop_by - self._clock.now()))
        self._supervisor.ended(self._stop_by)
        recording = self._sink.describe().kind == "file"
        if self._publisher.ended(self._timings.disk_timeout_s if recording else 0.0):
            self._sink.close()
        elif recording:
            raise StorageError("the recording is lost: the disk does not answer", "write it to another disk")
        # else the driver hangs, and closing would wait for it too

    @property
    def hung_threads(self) -> list[str]:
        """Names of the threads that have not ended.

        One that is inside OpenCV or a driver when the interpreter ends would abort or hold up the process.
        """
        threads = set(threading.enumerate()) - self._threads_before
        return [thread.name for thread in threads if thread.name.startswith(HANGING_THREAD_PREFIXES)]

    def stopping(self) -> bool:
        """Whether the camera is shutting down."""
        return self._stopping.is_set()

    def status(self) -> CameraStatus:
        """The camera's present state."""
        scene, source, sink = self._scene(), self._source.describe(), self._sink.describe()
        pipeline, counts, sessions = self._supervisor.pipeline, self._publisher.counts, session_report()
        slower = [
            Degradation(
                code=DegradationCode.PROVIDER_FALLBACK,
                what=f"model {session.name} runs on {session.provider}",
                why=session.why,
                cure=session.cure,
            )
            for session in sessions
            if session.why
        ]
        unused = []
        if sink.trouble is not None:
            unused = [
                Degradation(
                    code=DegradationCode.ONE_CAMERA_FAILED,
                    what="one of the virtual cameras is not used",
                    why=sink.trouble.what,
                    cure=sink.trouble.cure,
                )
            ]
        load = self._supervisor.load
        state = CameraState.FROZEN if scene.frozen else self._board.state
        reduced = [reduced_quality(load.latency_s or 0.0, self._pipelines.size)] if load.level else []
        fps = Rates(
            self._loop.camera_rate.rate(),
            self._loop.pipeline_rate.rate(),
            self._publisher.fps,
            self._publisher.new_fps,
        )
        return CameraStatus(
            state=state,
            source=f"{source.kind} {source.id}".strip(),
            sink=sink.name,
            subject=scene.subject_name,
            mode=str(scene.look.mode),
            tracker=TrackerStatus(self._pipelines.tracker_name, str(self._board.face)),
            fps=fps,
            latency_ms=self._publisher.latency_ms,
            stage_ms=pipeline.timer.percentiles() if pipeline else {},
            stage_processor_s=pipeline.timer.processor_s() if pipeline else {},
            frames=replace(counts, dropped=counts.dropped + self._loop.skipped + self._supervisor.dropped),
            providers={session.name: session.provider for session in sessions}
            | (pipeline.providers if pipeline else {}),
            quality_level=load.level,
            unlit=self._publisher.unlit,
            degraded=[
                *self._board.degradations(),
                *unused,
                *subject_troubles(scene),
                *(pipeline.troubles if pipeline and not scene.shows_nobody else ()),
                *slower,
                *reduced,
            ],
            readers=all_readers(self._readers.readers(), sink),
            advice=self._advice(fps, state),
            light=self._present_light.trust(scene),
            version=__version__,
            uptime_s=self._clock.now() - self._started_at,
        )

    def picture(self, after: int, timeout_s: float) -> tuple[int, DisplayImage] | None:
        """The newest published picture and its count; see `CameraControl.picture`."""
        self._on_viewer()
        found = self._publisher.shown.newer(after, timeout_s)
        return None if found is None or self.stopping() else (found[0], found[1])

    def filmed_picture(self, after: int, timeout_s: float) -> tuple[int, DisplayImage] | None:
        """The newest frame as filmed and its count; see `CameraControl.filmed_picture`."""
        self._on_viewer()
        return None if self.stopping() else self._filmed.newer(after, timeout_s)

    def reset_neutral_pose(self) -> None:
        """Take the present head pose as neutral."""
        if self._supervisor.pipeline is not None:
            self._supervisor.pipeline.reset_neutral()
        self.events.publish("neutral-pose")

    def report_degradation(self, code: DegradationCode, error: Exception | None) -> None:
        """Let the status and the events say that something fails, or with None that it works again."""
        self._board.report(code, error)

    def _publish(self, frame: Frame, rendered: RenderedFrame) -> bool:
        return publish_if_current(self._publisher, self._scene, frame, self._pipelines.fit(rendered))

    def _report_picture(self, error: Exception | None) -> None:
        """Report that pictures fail, unless it is known already that the tracker's models are missing."""
        known = isinstance(error, ModelError) and self._board.is_degraded(DegradationCode.MODELS_MISSING)
        if not known:
            self._board.report(DegradationCode.PICTURE_FAILED, error)

    def _advice(self, fps: Rates, state: CameraState) -> SpeedAdvice | None:
        """What to do where the computer does not keep up; judged anew with each status."""
        live = state in (CameraState.LIVE, CameraState.SEARCHING)
        expected = min(fps.camera, self._output_fps) if live else 0.0
        self._speed = next_speed(self._speed, self._clock.now(), expected, fps.new)
        return speed_advice(self._pipelines.size, expected, fps.new) if self._speed.behind and expected else None

    def _scene(self) -> Scene:
        return self.scene_controller.scene
