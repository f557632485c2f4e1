"""`relit replay`, `track`, `capture import`, `subject info` and the help: what they write and say when all is well."""

from __future__ import annotations

import json
import logging
from pathlib import Path

import numpy as np
import pytest

from relit_camera.app import wiring
from relit_camera.base.config.look import Mode
from relit_camera.base.images.image_files import read_display
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.cli.arguments import parse_mode
from relit_camera.cli.main import COMMANDS
from tests.cli.relit_command import CLIP_FPS, CLIP_SIZE, Answer, Material, call, files, finish
from tests.small_camera import Embedder
from tests.synthetic import sphere_samples, write_lights

FRAMES = 40


def done(answer: Answer) -> Answer:
    assert answer.code == 0, answer.err
    assert "Traceback" not in answer.err
    return answer


@pytest.mark.slow
@pytest.mark.parametrize(("given", "mode"), [("live", "live"), ("reenact", "portrait")], ids=["live", "former name"])
def test_replay_writes_video_report_and_sheet(given: str, mode: str, material: Material, tmp_path: Path) -> None:
    answer = done(
        call(
            "replay", material.clip, "--subject", material.subject, "--environment", "window", "--mode", given,
            "--tracker", material.tracker, "--out", tmp_path / "out.mp4", "--report", tmp_path / "report.json",
            "--contact-sheet", tmp_path / "sheet.png", "--rotate=40,0,0",
        )
    )  # fmt: skip
    assert f"{FRAMES} frames, face found in {FRAMES}" in answer.out
    assert files(tmp_path) == {"out.mp4", "report.json", "sheet.png"}
    with VideoReader(tmp_path / "out.mp4") as video:
        assert (video.info.width, video.info.height, video.info.fps) == (*CLIP_SIZE, CLIP_FPS)
        assert len(list(video)) == FRAMES
    report = json.loads((tmp_path / "report.json").read_text())
    assert [frame["index"] for frame in report["frames"]] == list(range(FRAMES))
    assert {frame["state"] for frame in report["frames"]} == {"found"}
    yaws = [frame["pose"]["yaw"] for frame in report["frames"]]
    assert max(yaws) - min(yaws) > 20  # the made-up face turns by 20 degrees to either side
    assert report["mode"] == mode
    assert {each["code"] for each in report["degraded"]} <= {"room-not-parted"}  # tests do without the matte's model
    assert all(value > 0 for value in report["frames"][1]["stage_ms"].values())
    assert read_display(tmp_path / "sheet.png").std() > 10


@pytest.mark.parametrize("allowed", [False, True])
def test_somebody_else_moves_the_portrait_of_a_replay_where_that_is_allowed(
    allowed: bool, material: Material, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(wiring, "FaceEmbedder", lambda session: Embedder(0.8))
    answer = done(
        call(
            "replay", material.clip, "--subject", material.subject, "--environment", "window", "--mode", "portrait",
            "--tracker", material.tracker, "--out", tmp_path / "out.mp4", "--report", tmp_path / "report.json",
            *(["--avatar"] if allowed else []),
        )
    )  # fmt: skip
    report = json.loads((tmp_path / "report.json").read_text())
    hidden = [frame["shown"] for frame in report["frames"]].count("placeholder")
    assert (f"a placeholder, for somebody else than the subject, in {hidden}" in answer.out) is not allowed
    assert [each["code"] for each in report["degraded"]] == ["other-person"] * (not allowed)
    assert hidden == 0 if allowed else FRAMES / 2 < hidden < FRAMES


def test_track_plays_back_as_it_was_recorded(material: Material, tmp_path: Path) -> None:
    again = tmp_path / "again.json"
    done(call("track", material.clip, "--tracker", material.tracker, "--out", again))
    first, second = (json.loads(path.read_text()) for path in (material.track, again))
    assert second["tracker"] == "recorded"
    for a, b in zip(first["frames"], second["frames"], strict=True):
        assert b["found"]
        np.testing.assert_allclose(list(b["pose"].values()), list(a["pose"].values()), atol=1e-6)
        np.testing.assert_allclose(b["landmarks"], a["landmarks"], atol=1e-4)
        assert b["mouth"] == pytest.approx(a["mouth"])


@pytest.mark.slow
@pytest.mark.parametrize("method", ["planar", "barycentric", "nearest", "ptm", "gp", "thesis", "default"])
def test_import_and_info(method: str, tmp_path: Path) -> None:
    lights = write_lights(tmp_path / "capture", sphere_samples(40, 24))
    subject = tmp_path / "sphere.relit"
    answer = done(call("capture", "import", lights, "--out", subject, "--method", method))
    assert "40 lights" in answer.out
    told = json.loads(done(call("subject", "info", subject, "--json")).out)
    assert (told["width"], told["height"], told["lights"], told["source"]) == (24, 24, 40, "lights.lp")
    assert told["psnr_db"] > 45
    assert "sphere" in done(call("subject", "info", subject)).out


def test_a_subject_is_packed_and_asking_for_too_much_leaves_nothing(tmp_path: Path) -> None:
    subject, small = tmp_path / "sphere.relit", tmp_path / "small.relit"
    lights = write_lights(tmp_path / "capture", sphere_samples(40, 24))
    done(call("capture", "import", lights, "--out", subject, "--method", "barycentric"))
    call("subject", "pack", subject, "--out", small, "--components", 1000).complains("1000 were asked for")
    assert not small.exists()
    assert "12 of" in done(call("subject", "pack", subject, "--out", small, "--components", 12)).out
    assert small.stat().st_size < subject.stat().st_size
    assert json.loads(done(call("subject", "info", small, "--json")).out)["components"] == 12


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help(command: str) -> None:
    answer = call(command, "--help")
    assert answer.code == 0, answer.err
    assert "Usage: " in answer.out


def test_help_lists_every_command_and_a_process_says_the_same(tmp_path: Path) -> None:
    answer = done(call("--help"))
    assert all(name in answer.out for name in COMMANDS)
    assert done(finish("--help", folder=tmp_path)).out.split()[:3] == ["Usage:", "relit", "[OPTIONS]"]


def test_global_options_come_before_the_command(material: Material, tmp_path: Path) -> None:
    done(call("--log-level", "error", "subject", "info", material.subject))
    config = tmp_path / "config.yaml"
    config.write_text("tracker:\n  dead_band_deg: 0.5\n")
    done(call("--config", config, "relight", material.subject, "--light=0,0", "--out", tmp_path / "x.png"))


def test_the_log_follows_the_option_then_the_settings(
    material: Material, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ours = logging.getLogger("relit_camera")
    monkeypatch.setattr(ours, "level", ours.level)
    config = tmp_path / "config.yaml"
    config.write_text("log_level: debug\n")
    done(call("--config", config, "subject", "info", material.subject))
    assert ours.level == logging.DEBUG
    done(call("--config", config, "--log-level", "error", "subject", "info", material.subject))
    assert ours.level == logging.ERROR
    assert call("--log-level", "loud", "devices").code == 2


def test_former_names_of_modes_are_taken() -> None:
    assert [parse_mode(former) for former in ("ratio", "reenact")] == [Mode.LIVE, Mode.PORTRAIT]


def test_usage_errors_exit_with_two(material: Material) -> None:
    for wrong in (["dance"], ["relight"], ["replay", material.clip, "--subjct", "x"], ["run", "--mode", "dance"]):
        answer = call(*wrong)
        assert answer.code == 2, wrong
        assert "Traceback" not in answer.err
