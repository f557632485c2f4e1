"""`relit evaluate`: reports on the disk, figures on stdout, and errors."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest

from relit_camera.base.errors import LightsError
from relit_camera.base.video.video_writer import VideoWriter
from relit_camera.capture.reflectance.method_registry import method_names
from relit_camera.lab.evaluate import light_holdout
from tests.cli.relit_command import Answer, call, files
from tests.lab.capture_documents import documents
from tests.lab.lit_sphere import cap, grid, lambert
from tests.synthetic import write_lights

pytestmark = pytest.mark.slow

PARTY = ("--environment", "party")
"""One, since the built-in environments take a while to paint."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`captured/` and `truth/` of a ball, and a subject of it."""
    folder = tmp_path_factory.mktemp("ball")
    write_lights(folder / "captured", lambert(cap(60, 50)))
    write_lights(folder / "truth", lambert(grid(8)))
    return folder


def test_field_compares_every_method_and_writes_a_report(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "report.html"
    answer = call(
        "evaluate", "field", folder / "captured" / "lights.lp", "--truth", folder / "truth", "--out", out, "--json",
        *PARTY,
    )  # fmt: skip
    assert answer.code == 0, answer.err
    figures = json.loads(answer.out)
    assert set(method_names()) < set(figures["candidates"])
    assert figures["candidates"]["barycentric"]["light_psnr_db"] > 30
    assert list(figures["harmonics"]) == ["party"]
    assert out.read_text().startswith("<!doctype html>")
    assert files(tmp_path) == {"report.html"}


def test_field_compares_a_subject(folder: Path, tmp_path: Path) -> None:
    subject = tmp_path / "ball.relit"
    assert call("capture", "import", folder / "captured" / "lights.lp", "--out", subject).code == 0
    answer = call("evaluate", "field", subject, "--truth", folder / "truth" / "lights.lp", *PARTY, "--json")
    assert answer.code == 0, answer.err
    assert json.loads(answer.out)["candidates"]["ball"]["light_psnr_db"] > 30
    assert call("evaluate", "field", subject, "--truth", folder / "truth", "--every", 2).code == 2


def test_field_takes_fewer_lights(folder: Path) -> None:
    command = ("evaluate", "field", folder / "captured", "--truth", folder / "truth", *PARTY, "--json")
    figures = json.loads(call(*command, "--method", "nearest", "--within-deg", 40, "--every", 2).out)
    assert list(figures["candidates"]) == ["nearest"]
    directions = cap(60, 50)
    assert figures["captured_lights"] == -(-(directions[:, 2] >= np.cos(np.radians(40))).sum() // 2)


def test_olat_prints_each_list(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "report.html"
    lights = folder / "captured" / "lights.lp"
    answer = call(
        "evaluate", "olat", lights, folder / "truth", "--hold-out", "every=3", "--within-deg", 60, "--out", out,
        "--method", "nearest", "--method", "barycentric",
    )  # fmt: skip
    assert answer.code == 0, answer.err
    assert "captured/lights.lp, every 3" in answer.out
    assert "truth/lights.lp, every 3" in answer.out
    assert "nearest" in out.read_text()


def test_olat_compares_every_method(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compared: list[str] = []

    def note(samples: object, inside: object, names: Sequence[str]) -> NoReturn:
        compared.extend(names)
        raise LightsError("not computed", "look at the names alone")

    monkeypatch.setattr(light_holdout, "method_candidates", note)
    call("evaluate", "olat", folder / "captured").complains("not computed")
    assert compared == method_names()


def test_frontal_predicts_the_other_lights(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "report.html"
    answer = call("evaluate", "frontal", folder / "captured", "--out", out, "--json")
    assert answer.code == 0, answer.err
    figures = json.loads(answer.out)["captured"]
    assert figures["frontal_lights"] + figures["predicted_lights"] == len(cap(60, 50))
    assert figures["predictors"]["model"]["psnr_db"] > figures["predictors"]["frontal picture"]["psnr_db"] + 10
    assert "generic head" in out.read_text()


def test_video_compares_two_videos(tmp_path: Path) -> None:
    for name, level in (("relit.mp4", 100), ("truth.mp4", 120)):
        with VideoWriter(tmp_path / name, (64, 64), 24) as video:
            for index in range(4):
                video.write(np.full((64, 64, 3), level, np.uint8), index / 24)
    answer = call("evaluate", "video", tmp_path / "relit.mp4", "--truth", tmp_path / "truth.mp4", "--json")
    assert answer.code == 0, answer.err
    assert json.loads(answer.out)["light"]["gain_ev"] == pytest.approx(np.log2((120 / 100) ** 2.2), abs=0.1)


def test_capture_compares_a_report_with_the_truth(tmp_path: Path) -> None:
    truth, report = documents()
    (tmp_path / "truth.json").write_text(json.dumps(truth))
    (tmp_path / "report.json").write_text(json.dumps(report | {"focal_px": 2 * report["focal_px"]}))
    command = ("evaluate", "capture", tmp_path / "report.json", "--truth", tmp_path / "truth.json")
    answer = call(*command, "--json", "--out", tmp_path / "page.html")
    assert answer.code == 0, answer.err
    assert json.loads(answer.out)["focal_ratio"] == 2
    assert (tmp_path / "page.html").read_text().startswith("<!doctype html>")
    assert "focal length: 2.000" in call(*command).out


def test_what_is_wrong_is_said_in_one_line_and_leaves_nothing(folder: Path, tmp_path: Path) -> None:
    captured, truth, out = folder / "captured", folder / "truth", tmp_path / "report.html"
    write_lights(tmp_path / "small", lambert(cap(60, 50), 12))
    before = files(tmp_path)

    def field(lights: Path | str, *more: object, truth: Path = truth, environment: str = "party") -> Answer:
        return call("evaluate", "field", lights, "--truth", truth, "--environment", environment, "--out", out, *more)

    field(tmp_path / "none.lp").complains("none.lp")
    field(captured, truth=tmp_path / "none.lp").complains("none.lp")
    field("nobody").complains("nobody")
    field(tmp_path / "small").complains("12x12", "16x16")
    field(captured, truth=captured).complains("--every")
    field(captured, "--every", 50).complains("2 captured lights")
    field(captured, "--method", "x").complains("'x'")
    field(captured, "--pixel", "x").complains("NAME=X,Y")
    field(captured, environment="x").complains("'x'")
    field(captured, "--out", tmp_path / "no" / "report.html").complains("report.html")
    call("evaluate", "olat", captured, "--hold-out", "4", "--out", out).complains("every=N")
    call("evaluate", "video", tmp_path / "none.mp4", "--truth", out).complains("none.mp4")
    call("evaluate", "capture", tmp_path / "none.json", "--truth", tmp_path / "none.json", "--out", out).complains(
        "none.json"
    )
    call("evaluate", "frontal", tmp_path / "none.lp", "--out", out).complains("none.lp")
    call("evaluate", "ladder", truth, "--rung", "stairs", "--out", tmp_path / "ladder").complains("'stairs'")
    call("evaluate", "ladder", truth, "--room", "nowhere", "--out", tmp_path / "ladder").complains("'nowhere'")
    call("evaluate", "ladder", tmp_path / "none.lp", "--out", tmp_path / "ladder").complains("none.lp")
    assert call("evaluate", "ladder", truth, truth, "--out", tmp_path / "ladder").code == 2
    assert field(captured, "--out", tmp_path / "report.pdf").code == 2
    assert call("evaluate", "video", out, "--truth", out, "--pose", out).code == 2
    assert files(tmp_path) == before
