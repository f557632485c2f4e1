"""The devices, tracker, models and checks of a running camera, as the API asks for them and changes them."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

from relit_camera.app.setup.check_runner import CheckRunner, Checks
from relit_camera.app.setup.model_job import ModelJob, Pull, pull_public_models
from relit_camera.app.setup.needed_models import missing_models
from relit_camera.app.setup.pipeline_choice import PipelineChoice
from relit_camera.app.wiring import make_tracker, session_options
from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.errors import ConflictError, DeviceError, ModelError, NotFoundError, PluginError
from relit_camera.devices.device_discovery import (
    FIRST_WEBCAM,
    SYSTEM_FOLDERS,
    DeviceFolders,
    list_virtual_cameras,
    list_webcams,
)
from relit_camera.devices.device_users import find_device_users
from relit_camera.devices.sinks.sink import Sink
from relit_camera.devices.sources.changeable_source import ChangeableSource
from relit_camera.devices.sources.source import Source, SourceState
from relit_camera.devices.webcam_formats import list_frame_sizes
from relit_camera.face.detection.installed_detector import open_face_detector
from relit_camera.face.framing.framing import Framing
from relit_camera.face.tracking.trackers import TRACKERS
from relit_camera.live.status.camera_status import Degradation, DegradationCode
from relit_camera.live.status.setup_status import (
    Check,
    DeviceList,
    ModelPullStatus,
    SourceStatus,
    TrackerChoice,
    VirtualCameraItem,
    WebcamItem,
)
from relit_camera.live.status.status_board import StatusBoard
from relit_camera.live.supervision.framing_monitor import FramingMonitor

PATTERN = "pattern"
"""The source that is always there."""
MODEL_POLL_S = 1.0
"""Seconds between two looks for models that are missing."""


class CameraSetup:
    """Implements `live.camera_control.SetupControl`."""

    def __init__(
        self,
        settings: RelitSettings,
        source: Source,
        sink: Sink,
        board: StatusBoard,
        pipelines: PipelineChoice,
        checks: Checks,
        wake: Callable[[], None] = lambda: None,
        tree: DeviceFolders = SYSTEM_FOLDERS,
        pull: Pull = pull_public_models,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        """Set up.

        Args:
            settings: of this run.
            source: that is read; only a `ChangeableSource` can be changed.
            sink: that is published to.
            board: where missing models are reported.
            pipelines: makes the camera's pipelines.
            checks: checks what the camera needs of the machine.
            wake: called when somebody wants frames: on demand, the webcam opens then.
            tree: where devices are looked for.
            pull: pulls the public models.
            clock: to wait by.
        """
        self._settings, self._source, self._sink, self._board = settings, source, sink, board
        self._pipelines, self._wake, self._tree, self._clock = pipelines, wake, tree, clock
        self._first_source = settings.source.source
        self._checks = CheckRunner(checks)
        self._models = ModelJob(board.events, self.missing_models, self._models_came, pull)
        self.monitor = FramingMonitor(
            board.events, lambda: open_face_detector(session_options(self._settings.inference))
        )
        self._changing = threading.Lock()
        self._models_coming = threading.Lock()
        self._missing_at_restart: list[str] | None = None
        """The models that were missing when the pipeline began anew because some had come; None where it has not."""
        self._closing = threading.Event()

    @property
    def settings(self) -> RelitSettings:
        """The settings of this run at present: source and tracker may have been changed."""
        return self._settings

    # Checks and devices

    def checks(self) -> tuple[Check, ...]:
        """What the camera needs of the machine, and whether it is there; at most some seconds old."""
        return self._checks.found(self._settings)

    def devices(self) -> DeviceList:
        """The cameras of this machine, now."""
        source, sink = self._source.describe(), self._sink.describe()
        webcams = tuple(
            WebcamItem(
                webcam.id,
                webcam.name,
                list_frame_sizes(webcam.node),
                tuple(dict.fromkeys(user.name for user in find_device_users(webcam.node))),
                is_current=webcam.id == source.id,
            )
            for webcam in list_webcams(self._tree)
        )
        virtual = list_virtual_cameras(self._tree)
        return DeviceList(
            webcams,
            tuple(VirtualCameraItem(found.node, found.label, found.node == sink.id) for found in virtual),
        )

    # The source

    def source(self) -> SourceStatus:
        """Where live frames come from."""
        asked, info = self._settings.source, self._source.describe()
        state = self._source.state
        failed = None if state is SourceState.RUNNING else self._failure(DegradationCode.SOURCE_FAILED)
        return SourceStatus(
            device=info.id or asked.source,
            width=asked.width,
            height=asked.height,
            fps=asked.fps,
            frame_width=info.size[0],
            frame_height=info.size[1],
            state=str(state),
            what=failed.why if failed else "",
            cure=failed.cure if failed else "",
        )

    def change_source(
        self, device: str | None = None, width: int | None = None, height: int | None = None, fps: float | None = None
    ) -> SourceStatus:
        """Take frames from another webcam, or in another size or rate; what is not given stays.

        Raises:
            NotFoundError: there is no such webcam.
            ConflictError: it gives no frames, or another change is under way. The source is as before.
        """
        with self._changing:
            source = None if device is None else self._source_text(device)
            given = {"source": source, "width": width, "height": height, "fps": fps}
            changed = {name: value for name, value in given.items() if value is not None}
            settings = self._settings.source.model_copy(update=changed)
            if settings == self._settings.source:
                return self.source()
            if not isinstance(self._source, ChangeableSource):
                raise ConflictError("this source cannot be changed while it runs", "start the camera with another one")
            self._wake()
            try:
                self._source.change(settings)
            except DeviceError as error:
                raise ConflictError(error.what, error.cure) from error
            self._settings = self._settings.model_copy(update={"source": settings})
            if width is not None or height is not None:
                self._pipelines.use_source_size(settings.width, settings.height)
            self._checks.forget()
            return self.source()

    def _source_text(self, device: str) -> str:
        """What `--source` takes for a device.

        Raises:
            NotFoundError: it is neither a camera of this machine, nor the pattern, nor the source of the start: the
                files of this machine are none of the API's business.
        """
        webcams = {name: webcam.id for webcam in list_webcams(self._tree) for name in (webcam.id, webcam.node)}
        chosen = {PATTERN: PATTERN, FIRST_WEBCAM: FIRST_WEBCAM, self._first_source: self._first_source, **webcams}
        chosen[Path(self._first_source).name] = self._first_source
        if device not in chosen:
            known = ", ".join(webcam.id for webcam in list_webcams(self._tree))
            raise NotFoundError(f"there is no webcam '{device}'", f"there are: {known}" if known else "plug one in")
        return chosen[device]

    # The tracker and its models

    def tracker(self) -> TrackerChoice:
        """Which tracker follows the face."""
        name = self._settings.tracker.name
        names = [each for each in TRACKERS.names() if each not in TRACKERS.with_argument]
        return TrackerChoice(name, tuple(dict.fromkeys([*names, name])))

    def change_tracker(self, name: str) -> TrackerChoice:
        """Let another tracker follow the face, from one of the next frames on.

        Raises:
            NotFoundError: there is none of that name.
            ConflictError: its models are missing. The tracker is as before.
        """
        with self._changing:
            choice = self.tracker()
            if name not in choice.names:
                raise NotFoundError(f"no tracker '{name}'", f"choose one of {', '.join(choice.names)}")
            if name == choice.name:
                return choice
            tracker = self._settings.tracker.model_copy(update={"name": name})
            settings = self._settings.model_copy(update={"tracker": tracker})
            try:
                opened = make_tracker(settings)
            except (ModelError, PluginError) as error:
                raise ConflictError(error.what, error.cure) from error
            self._settings = settings
            self._board.report(DegradationCode.MODELS_MISSING, None)
            self._pipelines.use_tracker(opened, settings)
            return self.tracker()

    def missing_models(self) -> list[str]:
        """The models that tracker and matte need and that are not stored."""
        return missing_models(self._settings.tracker.name, self._settings.matte)

    def models(self) -> ModelPullStatus:
        """Which public models are missing, and how far their pull is."""
        return self._models.status()

    def pull_models(self) -> ModelPullStatus:
        """Begin to pull the public models.

        Raises:
            ConflictError: a pull is under way.
        """
        self._missing_at_restart = None  # its end begins the pipeline anew at least once
        return self._models.start()

    def cancel_models(self) -> ModelPullStatus:
        """End the pull that is under way, if one is."""
        return self._models.cancel()

    def wait_for_models(self, error: ModelError) -> None:
        """Report that the tracker's models are missing, and let the tracker open once they are there, from wherever."""
        self._board.report(DegradationCode.MODELS_MISSING, error)
        threading.Thread(target=self.watch_models, name="models-watch", daemon=True).start()

    def watch_models(self) -> None:
        """Wait in the calling thread until the tracker's models are there; then let the pipeline start."""
        while missing_models(self._settings.tracker.name):
            if self._clock.wait(self._closing, MODEL_POLL_S):
                return
        self._models_came()

    def _models_came(self) -> None:
        """Begin the pipeline anew, unless that was done already with the models that are there now."""
        with self._models_coming:
            self._checks.forget()
            missing = self.missing_models()
            if missing == self._missing_at_restart:
                return
            self._missing_at_restart = missing
            self._board.report(DegradationCode.MODELS_MISSING, None)
            self._pipelines.restart()

    # Framing

    def want_framing(self, wanted: bool) -> None:
        """Judge the framing for some seconds from now on, or no longer."""
        if wanted:
            self._wake()
        self.monitor.want(wanted)

    def framing(self) -> Framing:
        """How well the person sits before the webcam now.

        Raises:
            NotReadyError: no frames come, or the models that find a face are missing.
        """
        self._wake()
        return self.monitor.framing()

    def close(self) -> None:
        """End what runs. Harmless when repeated."""
        self._closing.set()
        self._checks.close()
        self.monitor.close()
        self._models.cancel()

    def _failure(self, code: DegradationCode) -> Degradation | None:
        return next((found for found in self._board.degradations() if found.code is code), None)
