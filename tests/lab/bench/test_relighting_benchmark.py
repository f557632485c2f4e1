"""The bench measures what it says, on a small subject."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError
from unittest.mock import patch

import numpy as np
import pytest

from relit_camera.base.images.image_types import Frame
from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.base.rotations import angles_from_rotation
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.lab.bench.machine_info import machine_info
from relit_camera.lab.bench.relighting_benchmark import benchmark_gpu_transfer, benchmark_relighting, median_ms
from relit_camera.lab.bench.synthetic_subject import LIGHT_COUNT, synthetic_subject
from relit_camera.lab.bench.synthetic_tracker import SyntheticTracker


@pytest.mark.slow
def test_relighting_is_compared_in_one_run() -> None:
    subject = synthetic_subject(30, 40)
    assert subject.metadata.lights == LIGHT_COUNT
    maps = {"even": np.ones((32, 64, 3), np.float32)}
    result = benchmark_relighting(subject, maps, SessionOptions())
    for name in ("naive_ms", "gemm_ms", "numpy_ms", "basis_ms", "onnx_ms"):
        assert result[name] > 0  # type: ignore[operator]
    assert result["psnr_db"]["even"] > 45  # type: ignore[index]
    assert all(speed > 0 for speed in result["gb_per_s"].values())  # type: ignore[attr-defined]
    assert result["onnx_provider"] == "cpu"
    assert result["naive_ms"] > result["basis_ms"]  # type: ignore[operator]


@pytest.mark.slow
def test_the_sample_subject_is_lit_from_where_the_light_is() -> None:
    from relit_camera.capture.reflectance.directional_light import relight_from_direction
    from relit_camera.light.directions import direction_from_degrees

    picture = relight_from_direction(synthetic_subject(30, 40), direction_from_degrees(80, 0))
    assert picture[:, 15:].sum() > 2 * picture[:, :15].sum()


def test_the_nodding_tracker_turns_its_face() -> None:
    tracker = SyntheticTracker()
    image = np.zeros((90, 160, 3), np.uint8)
    states = [tracker.track(Frame(image, i, 0.0, t)) for i, t in enumerate((0.75, 2.25))]
    yaws = [angles_from_rotation(state.pose.rotation).yaw for state in states if state.pose]
    assert yaws == [pytest.approx(20, abs=0.5), pytest.approx(-20, abs=0.5)]
    assert len(states[0].landmarks) == landmark_scheme(tracker.scheme).count


def test_the_median_is_of_the_calls_after_two(monkeypatch: pytest.MonkeyPatch) -> None:
    now, durations_s = [0.0], iter([9.0, 0.001, 0.005, 0.003, 0.004, 0.002, 0.030])

    def call() -> None:
        now[0] += next(durations_s)

    monkeypatch.setattr("relit_camera.lab.bench.relighting_benchmark.time.perf_counter", lambda: now[0])
    assert median_ms(call, repeats=5) == pytest.approx(4)
    assert list(durations_s) == []


def test_without_a_gpu_nothing_is_said_of_transfers() -> None:
    assert benchmark_gpu_transfer(SessionOptions(provider="cpu")) is None


def test_the_machine_is_named() -> None:
    assert machine_info()["cores"]
    # With a GPU the module comes from another package.
    with patch("importlib.metadata.version", side_effect=PackageNotFoundError("onnxruntime")):
        assert machine_info()["onnxruntime"]
