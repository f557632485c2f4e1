"""`relit run` as a process: it serves, obeys, and ends when it is told to."""

from __future__ import annotations

import signal
import socket
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest

from relit_camera.app.first_scene import FirstScene
from relit_camera.live.publishing.publisher import RETRY_S
from relit_camera.live.scene.scene import Scene
from tests.cli.relit_command import Answer, Material, call, finish, start
from tests.lateness import spinning
from tests.small_camera import WAIT_S, wait_until

END_S = 3.0
"""By the processor time that a busy machine leaves to any process meanwhile."""
CLIP_FRAMES = 40


def arguments(material: Material, *more: object, named: bool = True) -> list[object]:
    subject = ("--subject", material.subject) if named else ()
    return [
        "run", "--source", material.clip, "--sink", "null", "--port", 0, *subject,
        "--tracker", material.tracker, "--size", "128x96", *more,
    ]  # fmt: skip


@contextmanager
def running(
    material: Material,
    folder: Path,
    *more: object,
    full_at: int | None = None,
    config: Path | None = None,
    check_period_s: float | None = None,
    named: bool = True,
) -> Iterator[tuple[subprocess.Popen[str], httpx.Client]]:
    first = ("--config", config) if config else ()
    options = arguments(material, *more, named=named)
    process = start(*first, *options, folder=folder, full_at=full_at, check_period_s=check_period_s)
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert "the panel is at http://127.0.0.1:" in line, (line, process.stderr and process.stderr.read())
        with httpx.Client(base_url=line.split()[-1] + "api/v1/", timeout=WAIT_S) as http:
            yield process, http
    finally:
        process.kill()
        process.communicate()


def wait_for_uptime(http: httpx.Client, uptime_s: float) -> None:
    """Wait until the camera has run for so long by its own clock, however slow the machine is."""
    wait_until(lambda: bool(http.get("status").json()["uptime_s"] >= uptime_s))


def wait_for_state(http: httpx.Client, state: str) -> None:
    wait_until(lambda: bool(http.get("status").json()["state"] == state))


def troubles(http: httpx.Client) -> dict[str, str]:
    """By code, what works less well than asked, but for the detail that a busy machine costs, and without the matte."""
    degraded = http.get("status").json()["degraded"]
    found = {each["code"]: f"{each['what']}: {each['why']}; {each['cure']}" for each in degraded}
    for expected in ("reduced-quality", "room-not-parted"):
        found.pop(expected, None)
    return found


class Viewer(threading.Thread):
    """Reads a motion-JPEG preview until it ends."""

    def __init__(self, http: httpx.Client) -> None:
        super().__init__(daemon=True)
        self._http = http
        self.began = threading.Event()
        self.bytes = 0
        self.error = ""

    def run(self) -> None:
        try:
            with self._http.stream("GET", "preview.mjpg") as answer:
                answer.raise_for_status()
                for chunk in answer.iter_bytes():
                    self.bytes += len(chunk)
                    if self.bytes > 10_000:
                        self.began.set()
        except httpx.HTTPError as error:
            self.error = repr(error)


def check_end(process: subprocess.Popen[str], http: httpx.Client, number: signal.Signals) -> None:
    """The signal ends it within three seconds, with two previews open."""
    viewers = [Viewer(http), Viewer(http)]
    for viewer in viewers:
        viewer.start()
    for viewer in viewers:
        assert viewer.began.wait(WAIT_S), (viewer.bytes, viewer.error)
    with spinning() as spun_s:
        before_s = spun_s()
        process.send_signal(number)
        assert process.wait(WAIT_S) == 0
        took_s = spun_s() - before_s
    assert took_s < END_S, f"it took {took_s:.1f} s"
    assert process.stderr is not None
    assert [line for line in process.stderr if " INFO " not in line and not line.startswith("INFO ")] == []
    for viewer in viewers:
        viewer.join(WAIT_S)
        assert not viewer.is_alive()


@pytest.mark.slow
def test_light_changes_while_it_runs_the_clip_loops_and_sigterm_ends_it(material: Material, tmp_path: Path) -> None:
    with running(material, tmp_path, "--environment", "sunset", "--mode", "live") as (process, http):
        assert http.get("lighting").json()["environment"] == "sunset"
        assert http.get("mode").json() == {"mode": "live"}
        first = http.get("snapshot.jpg").raise_for_status().content
        assert first.startswith(b"\xff\xd8")
        body = {"environment": None, "lamps": [{"azimuth_deg": 90}], "transition_s": 0}
        assert http.put("lighting", json=body).status_code == 200

        def frames_of_the_clip() -> int:
            frames = http.get("status").json()["frames"]
            return int(frames["composed"] + frames["dropped"])

        wait_until(lambda: frames_of_the_clip() > CLIP_FRAMES + 5)
        wait_for_state(http, "live")
        status = http.get("status").json()
        assert status["frames"]["published"] > 20
        assert status["source"].startswith("file ")
        assert troubles(http) == {}
        assert http.get("lighting").json()["lamps"][0]["azimuth_deg"] == 90
        check_end(process, http, signal.SIGTERM)


@pytest.mark.slow
def test_without_a_subject_whoever_comes_is_relit_until_they_hide(material: Material, tmp_path: Path) -> None:
    with running(material, tmp_path, named=False) as (process, http):
        assert http.get("subject").json() == {"name": "anyone"}
        wait_for_state(http, "live")
        status = http.get("status").json()
        assert (status["subject"], status["unlit"]) == ("anyone", False)
        assert troubles(http) == {}
        assert http.put("subject", json={"name": None}).status_code == 200
        process.send_signal(signal.SIGTERM)
        assert process.wait(WAIT_S) == 0
        assert process.stderr is not None
        assert "whoever comes is relit; to hide them" in process.stderr.read()
    with running(material, tmp_path, named=False) as (_, http):
        assert http.get("subject").json() == {"name": None}
        wait_for_state(http, "no-subject")


@pytest.mark.slow
def test_on_demand_the_source_waits_for_a_viewer_and_ctrl_c_ends_it(material: Material, tmp_path: Path) -> None:
    with running(material, tmp_path, "--on-demand") as (process, http):

        def published() -> int:
            return int(http.get("status").json()["frames"]["published"])

        def is_live_when_looked_at() -> bool:
            assert http.get("snapshot.jpg").status_code == 200
            return bool(http.get("status").json()["state"] == "live")

        wait_for_state(http, "released")
        wait_until(is_live_when_looked_at)
        wait_for_state(http, "released")  # five seconds later
        before = published()
        wait_until(lambda: published() > before + 10)
        assert http.get("status").json()["state"] == "released"
        assert troubles(http) == {}
        check_end(process, http, signal.SIGINT)


@pytest.mark.slow
def test_a_disk_that_is_full_loses_the_file_not_the_camera(material: Material, tmp_path: Path) -> None:
    recording = tmp_path / "recording.mp4"
    with running(material, tmp_path, "--sink", recording, full_at=20) as (process, http):
        wait_until(lambda: "sink-failed" in troubles(http))
        assert troubles(http)["sink-failed"].startswith("sink failed: ")
        assert "recording.mp4: File too large" in troubles(http)["sink-failed"]
        assert http.get("snapshot.jpg").status_code == 200
        wait_for_uptime(http, http.get("status").json()["uptime_s"] + RETRY_S + 0.5)  # the publisher has tried again
        wait_for_state(http, "live")
        process.send_signal(signal.SIGTERM)
        assert process.wait(WAIT_S) == 1
        assert process.stderr is not None
        said = process.stderr.read().splitlines()
        assert said[-1].startswith(f"relit: cannot write {recording}: File too large;")
        assert "Traceback" not in "\n".join(said)
    assert not [path.name for path in tmp_path.iterdir() if "recording" in path.name]


@pytest.fixture
def refused(material: Material, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Answer]:
    """Calls `relit run` in this process, whose own signals stay as they are, with options that it refuses."""
    monkeypatch.setenv("RELIT_STORAGE__DATA_DIR", str(tmp_path / "data"))
    monkeypatch.setenv("RELIT_MODELS_DIR", str(tmp_path / "no-models"))
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    return lambda *options: call(*arguments(material, *options))


@pytest.mark.parametrize("options", [(), ("--avatar",), ("--unlit",)])
def test_what_is_allowed_from_the_start(
    options: tuple[str, ...], material: Material, monkeypatch: pytest.MonkeyPatch
) -> None:
    began: list[Scene] = []

    def run_camera(*_: object, first_scene: FirstScene, **more: object) -> None:
        began.append(first_scene.controller().scene)

    monkeypatch.setattr("relit_camera.app.run_camera.run_camera", run_camera)
    assert call("run", "--subject", material.subject, "--tracker", material.tracker, *options).code == 0
    assert began[0].subject_name == material.subject.stem
    assert (began[0].avatar_allowed, began[0].unlit_allowed) == ("--avatar" in options, "--unlit" in options)


def test_port_in_use(refused: Callable[..., Answer]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        refused("--port", port).complains(f"port {port}", "in use", "--port")


def test_missing_camera(refused: Callable[..., Answer]) -> None:
    refused("--strict", "--source", "No Such Camera").complains("No Such Camera")


@pytest.mark.slow
def test_missing_virtual_camera(material: Material, tmp_path: Path) -> None:
    options = arguments(material, "--strict", "--sink", "/dev/video97")
    finish(*options, folder=tmp_path).complains("/dev/video97")  # a process of its own: it holds the camera's lock
    assert not (tmp_path / "data").exists()


@pytest.mark.slow
def test_it_starts_without_devices_and_models_and_says_what_to_do(
    material: Material, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RELIT_MODELS_DIR", str(tmp_path / "no-models"))
    missing = ("--source", "No Such Camera", "--sink", "/dev/video97", "--tracker", "mesh", "--no-pull")
    with running(material, tmp_path, *missing) as (process, http):
        wait_until(lambda: troubles(http).keys() >= {"source-failed", "sink-failed", "models-missing"})
        told = troubles(http)
        assert "there is no webcam 'No Such Camera'" in told["source-failed"]
        assert "/dev/video97" in told["sink-failed"]
        assert "run `relit models pull" in told["models-missing"]
        assert http.get("snapshot.jpg").content.startswith(b"\xff\xd8")  # the placeholder
        assert http.get("source").json()["what"] == "there is no webcam 'No Such Camera'"
        assert "face_detector_yunet" in http.get("models").json()["missing"]
        states = {each["id"]: each["state"] for each in http.get("checks").json()}
        assert states["models"] == states["webcam"] == "failed"
        # The page recovers by itself: another source is chosen, and the tracker needs no models.
        assert http.patch("source", json={"device": "pattern"}).status_code == 200
        wait_until(lambda: "source-failed" not in troubles(http))
        process.send_signal(signal.SIGTERM)
        assert process.wait(WAIT_S) == 0
        assert process.stderr is not None
        said = process.stderr.read()
        assert "Waiting: there is no webcam 'No Such Camera'; " in said
        assert "Traceback" not in said


def test_missing_subject_model_and_track(refused: Callable[..., Answer]) -> None:
    for changed, words in (
        (("--subject", "nobody"), ("nobody", "there are")),
        (("--tracker", "mesh", "--strict"), ("relit models pull",)),
        (("--tracker", "recorded:none.json"), ("none.json",)),
        (("--environment", "stuido"), ("stuido", "studio")),
        (("--source", "none.mp4"), ("none.mp4",)),
        (("--sink", "picture.gif"), ("picture.gif", ".mp4")),
    ):
        refused(*changed).complains(*words)


@pytest.mark.slow
def test_the_configuration_is_edited_while_it_runs(material: Material, tmp_path: Path) -> None:
    config = tmp_path / "mine.yaml"
    config.write_text("look: {lighting: {environment: studio}}\n", encoding="utf-8")

    def told(http: httpx.Client) -> str:
        return " ".join(troubles(http).values())

    with running(material, tmp_path, config=config, check_period_s=0.05) as (process, http):
        assert http.put("mode", json={"mode": "portrait"}).status_code == 200  # else the background needs a matte
        assert http.put("background", json={"kind": "color", "color": "#102030"}).status_code == 200
        for wrong, why in (
            ("look: {lighting: {environment", "line 1"),
            ("look: {lighting: {environment: nowhere}}", "nowhere"),
            ("look: {lighting: {exposure_ev: lots}}", "look.lighting.exposure_ev"),
            ("colour: red", "colour"),
            ("\0\xff", "mine.yaml"),
        ):
            config.write_text(wrong, encoding="latin-1")
            wait_until(lambda why=why: why in told(http))  # type: ignore[misc]
            assert http.get("lighting").json()["environment"] == "studio"  # kept as it was
        config.unlink()
        wait_until(lambda: "no configuration file" in told(http))
        assert http.put("lighting", json={"environment": "studio", "saturation": 0.5}).status_code == 200
        config.write_text("look: {lighting: {environment: sunset}}\noutput: {fps: 25}\n", encoding="utf-8")
        wait_until(lambda: http.get("lighting").json()["environment"] == "sunset")
        assert http.get("lighting").json()["saturation"] == 0.5  # set by the API, not edited
        assert "output counts from the next start" in told(http)
        assert http.get("background").json()["color"] == "#102030"  # what was not edited stays as it was set
        config.write_text("look: {lighting: {environment: party}}\n", encoding="utf-8")
        wait_until(lambda: http.get("lighting").json()["environment"] == "party" and told(http) == "")
        assert process.poll() is None
