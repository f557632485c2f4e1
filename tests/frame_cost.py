"""`python -m tests.frame_cost VIDEO`: what a frame of the running camera costs, in runs of the face mesh network.

Processor time of the whole process, of all threads, divided by the frames that it made; and by the processor time of
one run of the face mesh network (float32, one thread) in the same minute. On a shared machine this ratio is steadier
than milliseconds. Run by hand, not in CI; needs the public models.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import mean, median
from unittest.mock import patch

import cv2
import numpy as np

from relit_camera.app.camera_service import CameraService
from relit_camera.app.demo import demo_files
from relit_camera.app.wiring import make_tracker
from relit_camera.base.concurrency.threads import freeze_gc, limit_threads
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.models.model_store import model_path
from relit_camera.base.models.session_with_fallback import SessionOptions, open_session
from relit_camera.devices.sinks.sink import NullSink
from relit_camera.devices.sources.source_factory import open_source
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.stage_timing import StageTimer

WARM_UP_S = 4.0
MESH_RUNS = 60


def mesh_run_ms() -> float:
    """Processor time in ms of one run of the face mesh network: the median of some."""
    session = open_session(model_path("face_mesh"), "face_mesh", SessionOptions("cpu"))
    crop = np.full((1, 256, 256, 3), 0.5, np.float32)
    times = []
    for _ in range(MESH_RUNS):
        began = time.process_time()
        session.run({"image": crop})
        times.append(time.process_time() - began)
    return 1e3 * median(times)


@dataclass(frozen=True)
class FrameCost:
    """What a frame costs.

    Attributes:
        frame_ms: processor time of the process, in ms a frame.
        frames_per_s: frames that the camera made a second.
        stage_ms: median processor time in ms of each stage.
    """

    frame_ms: float
    frames_per_s: float
    stage_ms: dict[str, float]


def camera_frame_cost(video: Path, subject: Path, mode: str, seconds: float) -> FrameCost:
    """Measure the camera without viewers."""
    settings = RelitSettings.model_validate(
        {"source": {"source": str(video)}, "output": {"sink": "null"}, "look": {"mode": mode}}
    )
    scene_controller = SceneController(settings.storage)
    scene_controller.set_look(settings.look)
    scene_controller.load_configured_subject(str(subject))
    source = open_source(settings.source)
    sink = NullSink((settings.output.width, settings.output.height))
    with patch("relit_camera.live.pipeline.StageTimer", partial(StageTimer, now=time.thread_time)):
        camera = CameraService(settings, scene_controller, source, sink, make_tracker(settings))
    camera.start()
    try:
        time.sleep(WARM_UP_S)
        freeze_gc()
        began, clock, rates = time.process_time(), time.monotonic(), []
        while time.monotonic() < clock + seconds:
            time.sleep(1.0)
            rates.append(camera.status().fps.pipeline)
        cost, took = time.process_time() - began, time.monotonic() - clock
        stages = {name: percentiles.p50 for name, percentiles in camera.status().stage_ms.items()}
    finally:
        camera.stop()
    frames_per_s = mean(rates)
    return FrameCost(1e3 * cost / (frames_per_s * took), frames_per_s, stages)


def main() -> None:
    """Print JSON: for each mode the cost of a frame and of its stages in mesh runs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("video", type=Path, help="a film of a face")
    parser.add_argument("--subject", type=Path, default=demo_files.SUBJECT)
    parser.add_argument("--seconds", type=float, default=15.0)
    arguments = parser.parse_args()
    limit_threads()
    cv2.setNumThreads(1)
    found = {}
    for mode in ("reenact", "ratio"):
        mesh_before = mesh_run_ms()
        cost = camera_frame_cost(arguments.video, arguments.subject, mode, arguments.seconds)
        mesh_ms = (mesh_before + mesh_run_ms()) / 2
        found[mode] = {
            "mesh_run_ms": round(mesh_ms, 2),
            "frames_per_s": round(cost.frames_per_s, 1),
            "frame_in_mesh_runs": round(cost.frame_ms / mesh_ms, 1),
            "stages_in_mesh_runs": {name: round(ms / mesh_ms, 2) for name, ms in cost.stage_ms.items()},
        }
    print(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
