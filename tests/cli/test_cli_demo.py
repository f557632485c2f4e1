"""`relit demo` as a process, with nothing but what it is shipped with."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from relit_camera.app.demo import demo_files
from relit_camera.base.video.video_readers import VideoReader, probe_video
from relit_camera.cli.commands.demo import opens_in_browser
from relit_camera.face.tracking.track_recording import read_track
from relit_camera.subject.measured_light import measured_fraction
from relit_camera.subject.subject_file import read_metadata, read_subject
from tests.api.api_client import decoded_picture
from tests.cli.relit_command import call, start
from tests.small_camera import WAIT_S, wait_until

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[list[str], httpx.Client]]:
    """The demo without public models, webcam or virtual camera: what it said, and its API."""
    folder = tmp_path_factory.mktemp("demo")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RELIT_MODELS_DIR", str(folder / "no models"))
        settings = folder / "settings.yaml"
        settings.write_text(
            "output: {label: A camera that nobody has}\n"
            "look: {background: {kind: color, color: '#ff0000'}, lighting: {saturation: 0}}\n"
        )
        process = start("--config", settings, "demo", "--headless", "--port", 0, folder=folder)
    try:
        said = [_line(process) for _ in range(4)]
        address = next(line for line in said if "the panel is at" in line).split()[-1]
        with httpx.Client(base_url=address + "api/v1/", timeout=WAIT_S) as http:
            yield said, http
    finally:
        process.kill()
        process.communicate()


def _line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    line = process.stdout.readline()
    assert line, process.stderr and process.stderr.read()
    return line.strip()


def status(http: httpx.Client) -> dict[str, Any]:
    answer: dict[str, Any] = http.get("status").raise_for_status().json()
    return answer


def let_run(http: httpx.Client, seconds: float) -> None:
    """Wait until the camera has run for some seconds more by its own clock."""
    until_s = status(http)["uptime_s"] + seconds
    wait_until(lambda: bool(status(http)["uptime_s"] >= until_s))


def snapshot(http: httpx.Client) -> np.ndarray:
    answer = http.get("snapshot.jpg").raise_for_status()
    return decoded_picture(answer.content).astype(np.float32)


def test_it_says_what_there_is_not_and_when_the_first_picture_came(demo: tuple[list[str], httpx.Client]) -> None:
    said = "\n".join(demo[0])
    assert "No public models" in said
    assert "No virtual camera" in said
    assert "First picture" in said


def is_live_without_troubles(http: httpx.Client) -> bool:
    """Whether all works, but for pictures of less detail: other tests keep the computer busy."""
    now = status(http)
    return now["state"] == "live" and {each["code"] for each in now["degraded"]} <= {"reduced-quality"}


def test_the_bundled_person_is_live_and_in_mode_live(demo: tuple[list[str], httpx.Client]) -> None:
    wait_until(lambda: is_live_without_troubles(demo[1]))
    now = status(demo[1])
    assert (now["subject"], now["mode"]) == ("adam", "live")
    assert demo[1].get("scene").json()["rung"] == "pictures"


def test_the_light_changes_by_itself_until_somebody_takes_over(demo: tuple[list[str], httpx.Client]) -> None:
    _, http = demo
    seen = set[tuple[str, float]]()

    def four_were_seen() -> bool:
        lighting = http.get("lighting").raise_for_status().json()
        seen.add((lighting["environment"], round(lighting["split"], 1)))
        return len(seen) >= 4

    wait_until(four_were_seen)
    http.patch("lighting", json={"environment": "party", "split": 0, "transition_s": 0}).raise_for_status()
    let_run(http, 3)  # longer than a stranger is on trial, too
    assert http.get("lighting").json()["environment"] == "party"
    assert status(http)["mode"] == "live"
    wait_until(lambda: is_live_without_troubles(http))
    party = snapshot(http)
    http.patch("lighting", json={"environment": "overcast"}).raise_for_status()
    wait_until(lambda: bool(np.abs(snapshot(http) - party).mean() > 10))


def test_it_ends_by_itself_when_told_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RELIT_MODELS_DIR", str(tmp_path / "no models"))
    process = start("demo", "--headless", "--port", 0, "--seconds", 1, folder=tmp_path)
    out, err = process.communicate(timeout=2 * WAIT_S)
    assert process.returncode == 0, err
    assert "the panel is at" in out


def test_the_clip_its_track_and_its_mattes_are_of_one_length_and_large_enough() -> None:
    info = probe_video(demo_files.CLIP)
    track = read_track(demo_files.TRACK)
    assert min(info.width, info.height) >= 512
    assert info.fps >= 24
    assert info.frames == len(track.frames)
    assert track.size == (info.width, info.height)
    with np.load(demo_files.MATTES) as kept:
        assert len(kept["alpha"]) == info.frames
    yaws = [frame.pose.yaw for frame in track.frames if frame.pose]
    assert max(yaws) > 20
    assert min(yaws) < -20
    mouths = [frame.mouth for frame in track.frames]
    assert max(mouths) - min(mouths) > 0.1


def test_the_clip_does_not_flicker() -> None:
    """The wall behind is still: what it changes from frame to frame is what the codec and noise do."""
    with VideoReader(demo_files.CLIP) as video:
        walls = np.stack([frame.image[:80, -200:].astype(np.float32) for frame in video])
    assert np.abs(np.diff(walls, axis=0)).mean() < 0.5


def test_credits_are_with_the_person() -> None:
    text = demo_files.CREDITS.read_text(encoding="utf-8")
    assert "Lee Perry-Smith" in text
    assert "CC-BY 3.0" in text
    assert "ICT-FaceKit" in text


def test_the_panel_is_told_how_the_bundled_person_was_captured(tmp_path: Path) -> None:
    noted = demo_files.noted_subject(tmp_path / "demo")
    told = read_metadata(noted)
    assert (told.rung, told.measured_fraction) == ("pictures", 1.0)
    shipped = read_metadata(demo_files.SUBJECT)
    assert told.model_copy(update={"rung": shipped.rung, "measured_fraction": shipped.measured_fraction}) == shipped
    subject = read_subject(noted)
    assert measured_fraction(subject.light_directions) == pytest.approx(told.measured_fraction)
    np.testing.assert_array_equal(subject.neutral, read_subject(demo_files.SUBJECT).neutral)
    assert noted == demo_files.noted_subject(tmp_path / "demo")
    (tmp_path / "file").touch()
    assert demo_files.noted_subject(tmp_path / "file") == demo_files.SUBJECT


def test_the_bundled_subject_is_as_any_other() -> None:
    subject = read_subject(demo_files.SUBJECT)
    assert "mesh478" in subject.landmarks
    answer = call("subject", "info", demo_files.SUBJECT, "--places")
    assert answer.code == 0
    assert "adam" in answer.out
    assert "measured of the light of studio 100 %, " in answer.out


def test_no_browser_of_the_terminal_is_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []

    def open_browser(url: str) -> bool:
        opened.append(url)
        return True

    monkeypatch.setattr("webbrowser.open", open_browser)
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    assert not opens_in_browser("http://127.0.0.1:1/")
    assert opened == []
    monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-0")
    assert opens_in_browser("http://127.0.0.1:1/")
    assert opened == ["http://127.0.0.1:1/"]
