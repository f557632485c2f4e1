"""The bench measures what it says, on a small subject."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from relit_camera.bench.live import NoddingTracker, bench_live
from relit_camera.bench.machine import machine
from relit_camera.bench.relighting import bench_relighting
from relit_camera.bench.sample_subject import LIGHTS, sample_subject
from relit_camera.bench.timing import median_ms
from relit_camera.bench.transfer import bench_transfer
from relit_camera.config.look import Look
from relit_camera.config.settings import OutputSettings, RelitSettings, SourceSettings, StorageSettings
from relit_camera.face.schemes import landmark_scheme
from relit_camera.models.session import SessionOptions
from relit_camera.space.images import Frame
from relit_camera.space.rotation import angles_from_rotation
from relit_camera.stream.director import Director
from relit_camera.stream.sources.factory import open_source


def test_relighting_is_compared_in_one_run() -> None:
    subject = sample_subject(30, 40)
    assert subject.metadata.lights == LIGHTS
    maps = {"even": np.ones((32, 64, 3), np.float32)}
    result = bench_relighting(subject, maps, SessionOptions())
    for name in ("naive_ms", "gemm_ms", "numpy_ms", "basis_ms", "onnx_ms"):
        assert result[name] > 0  # type: ignore[operator]
    assert result["psnr_db"]["even"] > 45  # type: ignore[index]
    assert result["onnx_provider"] == "cpu"
    assert result["naive_ms"] > result["basis_ms"]  # type: ignore[operator]


def test_the_sample_subject_is_lit_from_where_the_light_is() -> None:
    from relit_camera.relight.direction import relight_direction
    from relit_camera.space.directions import direction_from_degrees

    picture = relight_direction(sample_subject(30, 40), direction_from_degrees(80, 0))
    assert picture[:, 15:].sum() > 2 * picture[:, :15].sum()


def test_the_nodding_tracker_turns_its_face() -> None:
    tracker = NoddingTracker()
    image = np.zeros((90, 160, 3), np.uint8)
    states = [tracker.track(Frame(image, i, 0.0, t)) for i, t in enumerate((0.75, 2.25))]
    yaws = [angles_from_rotation(state.pose.rotation).yaw for state in states if state.pose]
    assert yaws == [pytest.approx(20, abs=0.5), pytest.approx(-20, abs=0.5)]
    assert len(states[0].landmarks) == landmark_scheme(tracker.scheme).count


def test_median_counts_the_call() -> None:
    calls = []
    assert median_ms(lambda: calls.append(1), repeats=5) >= 0
    assert len(calls) == 7


def test_without_a_gpu_nothing_is_said_of_transfers() -> None:
    assert bench_transfer(SessionOptions(provider="cpu")) is None


def test_the_machine_is_named() -> None:
    assert machine()["cores"]
    # With a GPU the module comes from another package.
    with patch("importlib.metadata.version", side_effect=PackageNotFoundError("onnxruntime")):
        assert machine()["onnxruntime"]


def test_every_live_stage_has_both_figures(tmp_path: Path) -> None:
    settings = RelitSettings(
        source=SourceSettings(source="pattern", width=128, height=96),
        output=OutputSettings(sink="null", width=128, height=96),
        storage=StorageSettings(data_dir=tmp_path),
    )
    director = Director(settings.storage)
    director.show_subject("bench", sample_subject(48, 48))
    director.set_look(Look())
    result = bench_live(settings, director, open_source(settings.source), NoddingTracker(), 0.5)
    assert {"track", "light", "relight", "move", "compose", "capture_to_publish"} <= result["live"].keys()
    for stage in result["live"].values():
        assert 0 < stage["p50_ms"] <= stage["p95_ms"]  # type: ignore[index]
    assert result["live_run"]["degraded"] == []
