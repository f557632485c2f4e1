"""A camera that the API can drive without any device: a moving picture at 30 frames a second."""

from __future__ import annotations

import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from relit_camera.base.config.look import Look
from relit_camera.base.config.settings import StorageSettings
from relit_camera.base.errors import ConflictError, RelitError
from relit_camera.base.images.image_types import DisplayImage
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

FPS = 30
STATUS = CameraStatus(
    state=CameraState.LIVE,
    source="pattern",
    sink="null",
    subject=None,
    mode="reenact",
    tracker=TrackerStatus("mesh", "found"),
    fps=Rates(29.9, 29.8, 30.0),
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


class FakeCamera:
    """Implements `live.camera_control.CameraControl` around a real director."""

    def __init__(self, data_dir: Path, image: DisplayImage | None = None) -> None:
        self.scene_controller = SceneController(StorageSettings(data_dir=data_dir))
        self.scene_controller.set_look(Look())
        self.events = EventHub()
        self.instant_capture = FakeCapture()
        self.desk_capture = FakeDeskCapture()
        self.image = picture() if image is None else image
        self.publishing = True
        self.degraded: list[Degradation] = []
        self.neutral_resets = 0
        self.base = STATUS
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
