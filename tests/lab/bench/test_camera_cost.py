"""The benchmark of the running camera measures what it says, on a small one."""

from __future__ import annotations

import json
from collections import Counter
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from relit_camera.base.config.look import BlurBackground, Mode, NoBackground
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.errors import RelitError
from relit_camera.base.models.model_store import installed_model
from relit_camera.base.video.video_readers import VideoReader, probe_video
from relit_camera.base.video.video_writer import VideoWriter
from relit_camera.face.tracking.mediapipe_mesh_tracker import MESHES
from relit_camera.lab.bench.bench_source import MAX_FRAMES, prepare_video
from relit_camera.lab.bench.camera_cost import CameraCost, StageCost, measure_camera, measure_cameras
from relit_camera.lab.bench.camera_process import CameraProcess
from relit_camera.lab.bench.cost_text import cost_text
from relit_camera.lab.bench.mesh_run import MeshRun, installed_mesh_runs
from tests.cli.relit_command import CLIP_SIZE, Material, call, write_material

SECONDS = 2.0
WARM_UP_S = "relit_camera.lab.bench.camera_cost.WARM_UP_S"


@pytest.fixture(scope="module")
def material(tmp_path_factory: pytest.TempPathFactory) -> Material:
    return write_material(tmp_path_factory.mktemp("bench"))


def settings_of(material: Material, tmp_path: Path) -> RelitSettings:
    return RelitSettings.model_validate(
        {
            "source": {"source": str(material.clip)},
            "subject": str(material.subject),
            "tracker": {"name": material.tracker},
            "storage": {"data_dir": str(tmp_path)},
        }
    )


@pytest.fixture(scope="module")
def cost(material: Material, tmp_path_factory: pytest.TempPathFactory) -> CameraCost:
    settings = settings_of(material, tmp_path_factory.mktemp("data"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(WARM_UP_S, 0.5)
        (only,) = measure_cameras(settings, [CLIP_SIZE], [Mode.PORTRAIT], [NoBackground()], None, SECONDS)
    return only


@pytest.mark.slow
def test_the_process_costs_what_its_threads_cost(cost: CameraCost) -> None:
    assert cost.composed > 0
    assert {"track", "light", "relight", "follow", "move", "compose"} <= cost.stages.keys()
    in_stages = sum(stage.processor_ms for stage in cost.stages.values())
    assert cost.outside_ms == pytest.approx(cost.processor_ms - in_stages)
    assert cost.outside_ms > 0
    # The kernel counts a process and, for a bit longer, each of its threads; the stages are timed within the threads.
    assert 0.8 < sum(cost.threads_ms.values()) / cost.processor_ms < 1.5
    of_first_half = sum(cost.stages[name].processor_ms for name in ("track", "light", "relight"))
    assert cost.threads_ms["pipeline"] > 0.7 * of_first_half
    assert cost.mesh_runs == pytest.approx(cost.processor_ms / cost.mesh_run_ms)
    assert [each for each in cost.degraded if "the computer is busy" not in each] == []


@pytest.mark.slow
def test_every_stage_has_both_times(cost: CameraCost) -> None:
    for stage in cost.stages.values():
        assert 0 < stage.p50_ms <= stage.p95_ms
    assert 0 < cost.latency_p50_ms <= cost.latency_p95_ms
    assert 50 < cost.resident_mb < 2000
    assert cost.first_picture_s > 0.2
    assert json.loads(json.dumps(cost.as_json()))["stages"]["track"]["processor_ms"] > 0


class CountingCamera:
    """Stands in for a camera's process: whoever reads one of its figures finds one more picture made."""

    resident_mb, first_picture_s = 290.0, 2.0

    def __init__(self) -> None:
        self._pictures = 0

    @property
    def processor_s(self) -> float:
        return 0.012 * self._made()

    @property
    def thread_s(self) -> Counter[str]:
        made = self._made()
        return Counter({"pipeline": 0.010 * made, "main": 0.002 * made})

    def status(self) -> dict[str, Any]:
        made = self._made()
        return {
            "mode": "live",
            "frames": {"composed": made, "dropped": 2 * made},
            "stage_processor_s": {"track": 0.010 * made},
            "stage_ms": {"track": {"p50": 1.0, "p95": 2.0}},
            "latency_ms": {"p50": 3.0, "p95": 4.0},
            "degraded": [{"what": "matte", "why": "is slow"}],
        }

    def _made(self) -> int:
        self._pictures += 1
        return self._pictures


def test_no_part_is_measured_over_a_longer_time_than_its_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(WARM_UP_S, 0.0)
    monkeypatch.setattr("relit_camera.lab.bench.camera_cost.CameraProcess", lambda _: nullcontext(CountingCamera()))
    mesh = MeshRun()
    mesh.sample()
    cost = measure_camera(RelitSettings(), 30.0, 0.0, mesh)
    assert (cost.composed, cost.dropped) == (1, 2)
    assert cost.stages["track"].processor_ms == pytest.approx(10)
    assert cost.processor_ms == pytest.approx(36)
    assert cost.outside_ms == pytest.approx(26)
    assert cost.threads_ms == pytest.approx({"pipeline": 50, "main": 10})
    assert cost.mesh_runs == pytest.approx(36 / mesh.ms)
    assert (cost.latency_p50_ms, cost.latency_p95_ms, cost.degraded) == (3.0, 4.0, ["matte: is slow"])


@pytest.mark.slow
def test_a_camera_that_cannot_run_says_why(material: Material, tmp_path: Path) -> None:
    settings = settings_of(material, tmp_path).model_copy(update={"subject": str(tmp_path / "none.relit")})
    with pytest.raises(RelitError, match=r"none\.relit"):
        CameraProcess(settings)


COST = CameraCost(
    mode="live",
    background="blur",
    tracker="mesh",
    size=(1280, 720),
    source_fps=30.0,
    composed=270,
    dropped=30,
    processor_ms=20.0,
    mesh_runs=4.0,
    mesh_run_ms=5.0,
    installed_mesh_runs=0.66,
    stages={"track": StageCost(7.5, 1.5, 8.0, 9.5)},
    outside_ms=12.5,
    threads_ms={"pipeline": 7.5, "camera": 0.001},
    latency_p50_ms=33.0,
    latency_p95_ms=41.0,
    resident_mb=290.0,
    first_picture_s=2.31,
    degraded=["matte: is slow"],
)


def test_the_text_says_the_figures() -> None:
    lines = cost_text(COST).splitlines()
    cells = {line[2:22].strip(): line[22:].split() for line in lines}
    assert lines[0] == "live, background blur, 1280x720, tracker mesh"
    assert cells["track"] == ["7.50", "1.50", "8.0", "9.5"]
    assert cells["outside the stages"] == ["12.50", "2.50"]
    assert cells["whole process"] == ["20.00", "4.00"]
    assert cells["capture to publish"] == ["33.0", "41.0"]
    text = "\n".join(lines)
    assert "threads, in mesh runs: pipeline 1.50\n" in text
    assert "30 dropped (10 %)" in text
    assert "290 MB; first picture 2.3 s" in text
    assert "degraded: matte: is slow" in text
    assert "a mesh run: 5.00 ms; the installed face mesh network takes 0.66\n" in text
    assert "network is missing" in cost_text(replace(COST, installed_mesh_runs=None))
    assert "none dropped" in cost_text(replace(COST, dropped=0))


def test_the_source_has_the_size_and_rate_of_the_camera(tmp_path: Path) -> None:
    video = tmp_path / "film.mp4"
    with VideoWriter(video, (128, 96), 30.0) as writer:
        for index in range(MAX_FRAMES + 5):
            writer.write(np.full((96, 128, 3), index % 200 + 20, np.uint8))
    assert prepare_video(video, tmp_path, (128, 96), None) == (video, 30.0)
    assert prepare_video(video, tmp_path, None, None) == (video, 30.0)
    copy, fps = prepare_video(video, tmp_path, (256, 144), 10.0)
    info = probe_video(copy)
    assert (info.width, info.height, info.fps, fps, info.frames) == (256, 144, 10.0, 10.0, MAX_FRAMES)
    with VideoReader(copy) as reader:
        frames = [frame for frame in reader if frame.index in (0, 100)]
    assert [round(frame.image.mean()) for frame in frames] == pytest.approx([20, 120], abs=3)
    assert frames[1].time_s == pytest.approx(10.0)
    uncut, _ = prepare_video(video, tmp_path, None, 15.0)  # a recorded track belongs to all of it
    assert probe_video(uncut).frames == MAX_FRAMES + 5


def test_a_mesh_run_is_the_median_of_those_that_count() -> None:
    mesh = MeshRun()
    mesh.sample()
    first = mesh.ms
    mesh.sample()
    assert mesh.runs == 12
    assert mesh.ms == pytest.approx(first, rel=1.0)


def test_the_installed_network_is_faster_than_the_published_one() -> None:
    if installed_model(MESHES) is None:
        pytest.skip("no face mesh network is pulled; run `relit models pull`")
    assert 0.3 < installed_mesh_runs() < 0.95


@pytest.mark.slow
def test_bench_measures_each_combination(monkeypatch: pytest.MonkeyPatch, material: Material) -> None:
    asked = []

    def measure(settings: RelitSettings, fps: float, seconds: float, mesh: MeshRun) -> CameraCost:
        asked.append((settings.output.width, settings.look.mode, settings.look.background, fps, seconds))
        return COST

    monkeypatch.setattr("relit_camera.lab.bench.camera_cost.measure_camera", measure)
    answer = call(
        *("bench", "--json", "--no-relighting", "--seconds", "3", "--source-fps", "12", "--size", "128x96"),
        *("--video", material.clip, "--tracker", material.tracker, "--subject", material.subject),
    )
    assert answer.code == 0, answer.err
    assert json.loads(answer.out)["camera"] == [COST.as_json()] * 4
    none, blur = NoBackground(), BlurBackground()
    assert asked == [(128, mode, background, 12.0, 3.0) for mode in Mode for background in (none, blur)]
    assert "4.00" in call("bench", "--no-relighting", "--mode", "live", "--background", "none").out
