"""A camera that the API can drive without any device: a moving picture at 30 frames a second."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from relit_camera.app.demo import demo_files
from relit_camera.base.config.look import Look
from relit_camera.base.config.settings import StorageSettings
from relit_camera.base.errors import ConflictError, NotFoundError, NotReadyError, RelitError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.storage.upload import Upload
from relit_camera.devices.webcam_formats import FrameSize
from relit_camera.face.framing.framing import FaceCount, Framing, FramingItem, FramingState
from relit_camera.live.scene.present_light import PresentLight
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.camera_status import (
    CameraState,
    CameraStatus,
    Degradation,
    FrameCounts,
    Percentiles,
    Rates,
    TrackerStatus,
)
from relit_camera.live.status.capture_status import CaptureStage, CaptureStatus
from relit_camera.live.status.desk_status import DeskCaptureStatus, DeskPlace, DeskStage
from relit_camera.live.status.event_hub import EventHub
from relit_camera.live.status.expression_status import ExpressionCaptureStatus, ExpressionStage
from relit_camera.live.status.film_status import FilmCaptureStatus, FilmOptions, FilmStage, FilmStep
from relit_camera.live.status.replay_status import ReplayStage, ReplayStatus
from relit_camera.live.status.setup_status import (
    Check,
    CheckState,
    DeviceList,
    ModelPullStatus,
    ModelStage,
    SourceStatus,
    TrackerChoice,
    VirtualCameraItem,
    WebcamItem,
)

FPS = 30
STATUS = CameraStatus(
    state=CameraState.LIVE,
    source="pattern",
    sink="null",
    subject=None,
    mode="live",
    tracker=TrackerStatus("mesh", "found"),
    fps=Rates(29.9, 29.8, 30.0, 29.7),
    latency_ms=Percentiles(31.0, 44.0, 60.0),
    stage_ms={"track": Percentiles(5.0, 7.5, 9.0)},
    frames=FrameCounts(900, 3, 4, 899),
    stage_processor_s={"track": 7.5},
    providers={"face_mesh": "CPUExecutionProvider"},
    version="0.1.0",
    uptime_s=30.0,
)


class FakeCapture:
    """Implements `live.camera_control.CaptureControl`; it is filming until it is canceled."""

    def __init__(self) -> None:
        self.current = CaptureStatus()
        self.error: RelitError | None = None

    def status(self) -> CaptureStatus:
        return self.current

    def start(self, name: str) -> CaptureStatus:
        if self.error is not None:
            raise self.error
        self.current = CaptureStatus(CaptureStage.FILMING, name)
        return self.current

    def cancel(self) -> CaptureStatus:
        self.current = CaptureStatus(CaptureStage.CANCELED, self.current.subject)
        return self.current


class FakeDeskCapture:
    """Implements `live.camera_control.DeskCaptureControl`: each step that is shown leads to the next."""

    def __init__(self) -> None:
        self.current = DeskCaptureStatus()
        self.place: DeskPlace | None = None

    def status(self) -> DeskCaptureStatus:
        return self.current

    def start(self, name: str, place: DeskPlace) -> DeskCaptureStatus:
        if self.current.stage.is_running:
            raise ConflictError("a desk capture runs already", "wait for its end, or cancel it")
        self.place = place
        self.current = DeskCaptureStatus(DeskStage.EXPOSING, name, 0, 1, (1.0,) * 15, 5, 3)
        return self.current

    def page_shows(self, step: int) -> DeskCaptureStatus:
        if step == self.current.step:
            self.current = replace(self.current, stage=DeskStage.FILMING, step=step + 1)
        return self.current

    def cancel(self) -> DeskCaptureStatus:
        self.current = replace(self.current, stage=DeskStage.CANCELED, patches=())
        return self.current


ITEMS = ("neutral", "wide mouth", "eyes shut", "turned right")
"""Some of what stills may show."""

GOOD = FramingItem(FramingState.GOOD)
WEBCAM = WebcamItem("usb-cam", "A webcam", (FrameSize(1280, 720, (30.0, 15.0)),), ("firefox",), is_current=True)


class FakeSetup:
    """Implements `live.camera_control.SetupControl` for one webcam; models are missing until they are pulled."""

    def __init__(self) -> None:
        self.current = SourceStatus(WEBCAM.device, 1280, 720, 30.0, 1280, 720, "running")
        self.tracker_name = "mesh"
        self.pull = ModelPullStatus(missing=("face_landmarks",))
        self.framing_wanted = False
        self.seen: Framing | None = Framing(FaceCount.ONE, "", GOOD, GOOD, GOOD, GOOD, GOOD, (0.4, 0.3, 0.2, 0.4))

    def checks(self) -> tuple[Check, ...]:
        cure = "run: sudo modprobe v4l2loopback"
        failed = Check(
            "kernel-module",
            "Kernel module",
            CheckState.FAILED,
            "it is not loaded",
            cure,
            ("sudo modprobe v4l2loopback",),
        )
        return failed, Check("webcam", "Webcam", CheckState.OK, "A webcam at /dev/video0")

    def devices(self) -> DeviceList:
        return DeviceList((WEBCAM,), (VirtualCameraItem("/dev/video10", "Relit Camera", is_current=True),))

    def source(self) -> SourceStatus:
        return self.current

    def change_source(
        self, device: str | None = None, width: int | None = None, height: int | None = None, fps: float | None = None
    ) -> SourceStatus:
        if device not in (None, WEBCAM.device, "busy"):
            raise NotFoundError(f"there is no webcam '{device}'", f"there are: {WEBCAM.device}")
        if device == "busy":
            raise ConflictError("busy gives no frames", "close the program that uses it")
        now = self.current
        self.current = replace(now, width=width or now.width, height=height or now.height, fps=fps or now.fps)
        return self.current

    def tracker(self) -> TrackerChoice:
        return TrackerChoice(self.tracker_name, ("mesh", "openseeface"))

    def change_tracker(self, name: str) -> TrackerChoice:
        if name not in self.tracker().names:
            raise NotFoundError(f"no tracker '{name}'", "choose mesh or openseeface")
        if self.pull.missing:
            raise ConflictError("model face_landmarks is not pulled", "pull the models")
        self.tracker_name = name
        return self.tracker()

    def models(self) -> ModelPullStatus:
        return self.pull

    def pull_models(self) -> ModelPullStatus:
        if self.pull.stage.is_running:
            raise ConflictError("the models are being pulled already", "wait for its end, or cancel it")
        self.pull = replace(self.pull, stage=ModelStage.PULLING, progress=0.25, doing="getting face_landmarks")
        return self.pull

    def cancel_models(self) -> ModelPullStatus:
        self.pull = replace(self.pull, stage=ModelStage.CANCELED)
        return self.pull

    def want_framing(self, wanted: bool) -> None:
        self.framing_wanted = wanted

    def framing(self) -> Framing:
        if self.seen is None:
            raise NotReadyError("no frames come from the webcam", "plug one in")
        return self.seen


class FakeFilmCapture:
    """Implements `live.camera_control.FilmCaptureControl`: a film that was sent is being read until it is canceled."""

    def __init__(self, folder: Path) -> None:
        self.current = FilmCaptureStatus()
        self.film = folder / "film"
        self.options: FilmOptions | None = None
        self.canceled = threading.Event()
        self.written = 0
        self.noted: list[tuple[str, ...]] = []
        self.pictures = {"studio": b"a JPEG file"}

    def status(self) -> FilmCaptureStatus:
        return self.current

    @contextmanager
    def receive(self, name: str, file_name: str, options: FilmOptions) -> Iterator[Upload]:
        if self.current.stage.is_running:
            raise ConflictError("a capture from a film runs already", "wait for its end, or cancel it")
        before, self.current = self.current, FilmCaptureStatus(FilmStage.RECEIVING, name, file_name)
        self.film.parent.mkdir(parents=True, exist_ok=True)
        try:
            yield Upload(self.film, self.canceled)
        except BaseException:
            self.current = before
            self.written = self.film.stat().st_size if self.film.exists() else 0
            self.film.unlink(missing_ok=True)
            raise
        self._read(options)

    def resume(self, options: FilmOptions | None = None) -> FilmCaptureStatus:
        if not self.current.can_resume:
            raise ConflictError("there is no film to go on with", "send one")
        self._read(options or self.options or FilmOptions())
        return self.current

    def cancel(self, forget: bool = False) -> FilmCaptureStatus:
        if forget:
            self.current = FilmCaptureStatus()
        elif self.current.stage.is_running:
            self.current = replace(self.current, stage=FilmStage.CANCELED, can_resume=True)
        return self.current

    def subject_renamed(self, name: str, new_name: str) -> None:
        self.noted.append((name, new_name))

    def subject_removed(self, name: str) -> None:
        self.noted.append((name,))

    def picture(self, name: str) -> bytes:
        if name not in self.pictures:
            raise NotFoundError(f"no picture '{name}'", "see the report")
        return self.pictures[name]

    def _read(self, options: FilmOptions) -> None:
        self.options = options
        steps = (FilmStep("Looking for flashes", "running", 1.5), FilmStep("Building the field"))
        self.current = replace(self.current, stage=FilmStage.READING, stages=steps, progress=0.1, can_resume=False)


class FakeExpressionCapture:
    """Implements `live.camera_control.ExpressionCaptureControl`; it films, or builds, until it is canceled."""

    def __init__(self, folder: Path) -> None:
        self.current = ExpressionCaptureStatus()
        self.video = folder / "video"
        self.error: RelitError | None = None

    def status(self) -> ExpressionCaptureStatus:
        return self.current

    def start(self, subject: str | None = None) -> ExpressionCaptureStatus:
        if self.error is not None:
            raise self.error
        self.current = ExpressionCaptureStatus(
            ExpressionStage.FILMING, subject or "ada", None, "neutral", "look into the camera", items=ITEMS
        )
        return self.current

    @contextmanager
    def receive(self, subject: str | None, file_name: str) -> Iterator[Upload]:
        if self.error is not None:
            raise self.error
        self.video.parent.mkdir(parents=True, exist_ok=True)
        yield Upload(self.video)
        self.current = ExpressionCaptureStatus(ExpressionStage.BUILDING, subject or "ada", file_name, items=ITEMS)

    def cancel(self) -> ExpressionCaptureStatus:
        self.current = replace(self.current, stage=ExpressionStage.CANCELED)
        return self.current


class FakeReplays:
    """Implements `live.camera_control.ReplayControl`: a video that was sent is done when `finish` is called."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.found: dict[str, ReplayStatus] = {}

    def all(self) -> list[ReplayStatus]:
        return list(self.found.values())

    def status(self, name: str) -> ReplayStatus:
        if name not in self.found:
            raise NotFoundError(f"no replay '{name}'", "see the list")
        return self.found[name]

    @contextmanager
    def receive(self, name: str, file_name: str) -> Iterator[Upload]:
        if any(each.stage.is_running for each in self.found.values()):
            raise ConflictError("a video is being relit already", "wait for its end, or delete it")
        if name in self.found:
            raise ConflictError(f"there is a replay '{name}' already", "choose another name")
        self.folder.mkdir(parents=True, exist_ok=True)
        yield Upload(self.folder / f"{name}.mp4")
        self.found[name] = ReplayStatus(name, ReplayStage.WORKING)

    def video(self, name: str) -> Path:
        if self.status(name).stage is not ReplayStage.DONE:
            raise ConflictError(f"the replay '{name}' has no video yet", "wait for its end")
        return self.folder / f"{name}.mp4"

    def remove(self, name: str) -> None:
        self.status(name)
        del self.found[name]

    def finish(self, name: str) -> None:
        path = f"/api/v1/replays/{name}/video"
        self.found[name] = ReplayStatus(name, ReplayStage.DONE, 1.0, 30, path)


class FakeCamera:
    """Implements `live.camera_control.CameraControl` around a real director."""

    demo_subject = demo_files.SUBJECT

    def __init__(self, data_dir: Path, image: DisplayImage | None = None) -> None:
        self.scene_controller = SceneController(StorageSettings(data_dir=data_dir))
        self.scene_controller.set_look(Look())
        self.events = EventHub()
        self.instant_capture = FakeCapture()
        self.desk_capture = FakeDeskCapture()
        self.setup = FakeSetup()
        self.film_capture = FakeFilmCapture(data_dir / "captures" / "film")
        self.expression_capture = FakeExpressionCapture(data_dir / "captures" / "expressions")
        self.replays = FakeReplays(data_dir / "replays")
        self.image = picture() if image is None else image
        self.publishing = True
        self.degraded: list[Degradation] = []
        self.neutral_resets = 0
        self.base = STATUS
        self._present_light = PresentLight()
        self._started = time.monotonic()
        self._stop = threading.Event()

    def status(self) -> CameraStatus:
        scene = self.scene_controller.scene
        state = CameraState.FROZEN if scene.frozen else self.base.state
        return replace(
            self.base,
            state=state,
            subject=scene.subject_name,
            mode=scene.look.mode.value,
            degraded=self.degraded,
            light=self._present_light.trust(scene),
            fps=self.base.fps if self.publishing else replace(self.base.fps, published=0.0),
        )

    def picture(self, after: int, timeout_s: float) -> tuple[int, DisplayImage] | None:
        deadline = time.monotonic() + timeout_s
        while not self._stop.is_set():
            count = int((time.monotonic() - self._started) * FPS)
            if self.publishing and count > after:
                return count, self.image
            if time.monotonic() >= deadline:
                return None
            time.sleep(0.004)
        return None

    def filmed_picture(self, after: int, timeout_s: float) -> tuple[int, DisplayImage] | None:
        found = self.picture(after, timeout_s)
        return None if found is None else (found[0], 255 - found[1])

    def reset_neutral_pose(self) -> None:
        self.neutral_resets += 1

    def stopping(self) -> bool:
        return self._stop.is_set()

    def stop(self) -> None:
        self._stop.set()


def picture(width: int = 320, height: int = 180) -> DisplayImage:
    """Red grows to the right, green downward; the left edge is dark, so that mirroring shows."""
    image = np.zeros((height, width, 3), np.uint8)
    image[..., 0] = np.linspace(0, 255, width, dtype=np.uint8)
    image[..., 1] = np.linspace(0, 255, height, dtype=np.uint8)[:, None]
    return image
