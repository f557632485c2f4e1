"""Benchmark of the live pipeline: source, worker, publisher and null sink, for some seconds."""

from __future__ import annotations

import time
from dataclasses import asdict

import numpy as np

from relit_camera.app.camera_service import CameraService
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.images.image_types import Frame
from relit_camera.base.rotations import rotation_from_angles
from relit_camera.devices.sinks.sink import NullSink
from relit_camera.devices.sources.source import Source
from relit_camera.face.face_state import FaceState, FaceStatus, Tracker
from relit_camera.face.head_pose import HeadPose, guess_focal, project
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.live.scene.scene_controller import SceneController

WARM_UP_S = 2.0


class SyntheticTracker:
    """Tracker for benchmarks without a video: gives a mean face that turns and nods, with its landmarks."""

    name = "nodding"
    scheme = "mesh478"

    def track(self, frame: Frame) -> FaceState:
        """A face 60 cm before the camera, its pose by the frame's time."""
        scheme, phase = landmark_scheme(self.scheme), 2 * np.pi * frame.time_s / 3
        rotation = rotation_from_angles(20 * np.sin(phase), 6 * np.sin(2 * phase), 4 * np.cos(phase))
        pose = HeadPose(rotation, np.array([0.0, 0.0, -60.0]), guess_focal(frame.size))
        landmarks = project(scheme.canonical.copy(), pose, frame.size)
        eyes, mouth = scheme.eyes_opening(landmarks), scheme.mouth_opening(landmarks)
        return FaceState(FaceStatus.FOUND, 1.0, self.scheme, landmarks, pose, eyes, mouth)

    def reset(self) -> None:
        """Do nothing: the tracker has no state."""


def benchmark_live(
    settings: RelitSettings, scene_controller: SceneController, source: Source, tracker: Tracker, seconds: float
) -> dict[str, dict[str, object]]:
    """Run the camera service on a source, with a sink that discards the frames.

    Returns:
        `live`: stage → {p50_ms, p95_ms}, `capture_to_publish` among them; `live_run`: how it ran.
    """
    size = (settings.output.width, settings.output.height)
    camera_service = CameraService(settings, scene_controller, source, NullSink(size), tracker)
    camera_service.start()
    try:
        time.sleep(WARM_UP_S + seconds)
        status = camera_service.status()
    finally:
        camera_service.stop()
    stages = {**status.stage_ms, "capture_to_publish": status.latency_ms}
    return {
        "live": {name: {"p50_ms": round(s.p50, 2), "p95_ms": round(s.p95, 2)} for name, s in stages.items()},
        "live_run": {
            "fps": {name: round(value, 1) for name, value in asdict(status.fps).items()},
            "size": list(size),
            "mode": status.mode,
            "tracker": status.tracker.name,
            "tracker_state": status.tracker.state,
            "degraded": [asdict(trouble) for trouble in status.degraded],
        },
    }
