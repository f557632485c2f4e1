"""Status, probes, metrics."""

from __future__ import annotations

import math
from dataclasses import replace

from prometheus_client.parser import text_string_to_metric_families

from relit_camera.live.status.camera_status import CameraState, Degradation, DegradationCode, Percentiles
from tests.api.api_client import Client, check_problem
from tests.api.fake_camera import STATUS, FakeCamera
from tests.app.subject_builders import captured


def test_status_tells_everything(client: Client, camera: FakeCamera) -> None:
    camera.degraded = [
        Degradation(
            code=DegradationCode.PROVIDER_FALLBACK,
            what="model face_mesh runs on cpu",
            why="CUDA is not there",
            cure="install the GPU variant",
        )
    ]
    status = client.get("/api/v1/status").json()
    assert status["state"] == "live"
    assert status["tracker"] == {"name": "mesh", "state": "found"}
    assert status["fps"] == {"camera": 29.9, "pipeline": 29.8, "published": 30.0, "new": 29.7}
    assert status["latency_ms"] == {"p50": 31.0, "p95": 44.0, "max": 60.0}
    assert status["stage_ms"] == {"track": {"p50": 5.0, "p95": 7.5, "max": 9.0}}
    assert status["frames"] == {"published": 900, "dropped": 3, "repeated": 4, "composed": 899}
    assert status["stage_processor_s"] == {"track": 7.5}
    assert status["providers"] == {"face_mesh": "CPUExecutionProvider"}
    assert status["degraded"][0]["cure"] == "install the GPU variant"
    assert status["degraded"][0]["code"] == "provider-fallback"


def test_status_tells_how_far_to_trust_the_face_in_the_present_light(client: Client, camera: FakeCamera) -> None:
    """An instant face under one lamp: before it nothing is a guess or softened, behind it everything."""
    assert client.get("/api/v1/status").json()["light"] is None  # nobody is shown
    camera.scene_controller.show_subject("ada", captured("instant"))
    lamp = {"elevation_deg": 0, "size_deg": 5}
    client.patch("/api/v1/lighting", {"environment": None, "lamps": [lamp | {"azimuth_deg": 10}]})
    assert client.get("/api/v1/status").json()["light"] == {"measured": 0, "behind": 0, "softened": 0}
    client.patch("/api/v1/lighting", {"lamps": [lamp | {"azimuth_deg": 170}]})
    assert client.get("/api/v1/status").json()["light"] == {"measured": 0, "behind": 1, "softened": 1}
    client.patch("/api/v1/lighting", {"lamps": []})
    assert client.get("/api/v1/status").json()["light"] is None  # it is dark


def test_figures_that_are_no_numbers_are_null(client: Client, camera: FakeCamera) -> None:
    camera.base = replace(STATUS, latency_ms=Percentiles(math.nan, math.inf, -math.inf))
    assert client.get("/api/v1/status").json()["latency_ms"] == {"p50": None, "p95": None, "max": None}


def test_alive_whatever_the_camera_does(client: Client, camera: FakeCamera) -> None:
    camera.publishing = False
    assert client.get("/healthz").json() == {"status": "alive"}


def test_ready_while_pictures_are_published(client: Client) -> None:
    assert client.get("/readyz").json() == {"status": "ready"}


def test_not_ready_without_pictures(client: Client, camera: FakeCamera) -> None:
    camera.publishing = False
    assert check_problem(client.get("/readyz"), 503)["cure"]


def test_not_ready_while_stopping(client: Client, camera: FakeCamera) -> None:
    camera.stop()
    assert "stopping" in check_problem(client.get("/readyz"), 503)["what"]


def test_metrics_are_what_the_status_says(client: Client, camera: FakeCamera) -> None:
    camera.base = replace(STATUS, state=CameraState.SEARCHING)
    answer = client.get("/metrics")
    assert answer.headers["content-type"].startswith("text/plain")
    samples = {
        (sample.name, *sorted(sample.labels.values())): sample.value
        for family in text_string_to_metric_families(answer.text)
        for sample in family.samples
    }
    assert samples["relit_fps", "published"] == 30.0
    assert samples["relit_latency_seconds", "0.95"] == 0.044
    assert samples["relit_stage_seconds", "0.5", "track"] == 0.005
    assert samples["relit_stage_processor_seconds_total", "track"] == 7.5
    assert samples["relit_frames_total", "dropped"] == 3
    assert samples["relit_frames_total", "composed"] == 899
    assert samples["relit_state", "searching"] == 1
    assert samples["relit_state", "live"] == 0
    assert samples["relit_degraded",] == 0
    assert not any(name.startswith(("python_", "process_")) for name, *_ in samples)
