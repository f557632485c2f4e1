"""Which libraries the running camera does not load: each would cost it memory and a slower start."""

from __future__ import annotations

import subprocess
import sys

import pytest

RENDER_A_FRAME_IN_EACH_MODE = """
import sys
import relit_camera.app.run_camera, relit_camera.api.app, relit_camera.api.server.http_server
from relit_camera.app.demo import demo_files
from relit_camera.app.wiring import make_pipeline, make_tracker
from relit_camera.base.config.look import Look, Mode
from relit_camera.base.config.settings import RelitSettings, TrackerSettings
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.live.scene.scene_controller import SceneController

settings = RelitSettings(tracker=TrackerSettings(name=f"recorded:{demo_files.TRACK}"))
controller = SceneController(settings.storage)
controller.load_configured_subject(str(demo_files.SUBJECT))
pipeline = make_pipeline(settings, make_tracker(settings), (320, 180))
with VideoReader(demo_files.CLIP) as frames:
    for mode in Mode:
        controller.set_look(Look(mode=mode))
        pipeline.process(next(iter(frames)), controller.scene)
pipeline.close()
print(*sorted({name.partition(".")[0] for name in sys.modules}))
"""


@pytest.mark.slow
def test_the_camera_renders_without_scipy_and_onnx() -> None:
    done = subprocess.run(
        [sys.executable, "-c", RENDER_A_FRAME_IN_EACH_MODE], check=True, capture_output=True, text=True
    )
    loaded = done.stdout.split()
    assert "onnxruntime" in loaded
    assert not {"scipy", "onnx", "google"} & set(loaded)


def test_the_first_scene_is_begun_before_most_of_the_program_is_imported() -> None:
    code = "import sys, relit_camera.app.first_scene; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    loaded = set(done.stdout.split())
    assert "relit_camera.live.scene.scene_controller" in loaded
    assert not {"onnxruntime", "fastapi", "av", "relit_camera.live.pipeline", "relit_camera.app.run_camera"} & loaded
