"""The live chain as it runs: source, worker, publisher, null sink, for some seconds."""

from __future__ import annotations

import time
from dataclasses import asdict

import numpy as np

from relit_camera.config.settings import RelitSettings
from relit_camera.face.pose import guess_focal, project
from relit_camera.face.schemes import landmark_scheme
from relit_camera.face.state import FaceState, FaceStatus, HeadPose, Tracker
from relit_camera.space.images import Frame
from relit_camera.space.rotation import rotation_from_angles
from relit_camera.stream.daemon import Daemon
from relit_camera.stream.director import Director
from relit_camera.stream.sinks.null import NullSink
from relit_camera.stream.sources.base import Source

WARM_UP_S = 2.0


class NoddingTracker:
    """Stands in where no video is given: a mean face that turns and nods, with the landmarks a tracker would give."""

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
        """Nothing to forget."""


def bench_live(
    settings: RelitSettings, director: Director, source: Source, tracker: Tracker, seconds: float
) -> dict[str, dict[str, object]]:
    """Run the daemon on a source into nothing.

    Returns:
        `live`: stage → {p50_ms, p95_ms}, `capture_to_publish` among them; `live_run`: how it ran.
    """
    size = (settings.output.width, settings.output.height)
    daemon = Daemon(settings, director, source, NullSink(size), tracker)
    daemon.start()
    try:
        time.sleep(WARM_UP_S + seconds)
        status = daemon.status()
    finally:
        daemon.stop()
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
