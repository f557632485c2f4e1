"""The offer to pull missing models: to a person at a terminal, once; to nobody else."""

from __future__ import annotations

import os
import pty
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from relit_camera.app.demo import demo_files
from relit_camera.base.models.model_store import ModelStore
from relit_camera.cli import model_offer
from relit_camera.cli.model_offer import offer_models
from tests.cli.relit_command import COMMAND, call, environment

QUESTION = "Get them now?"


@pytest.fixture
def pulls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """No model is stored; a pull is noted, and stores none."""
    noted: list[str] = []
    monkeypatch.setenv("RELIT_MODELS_DIR", str(tmp_path / "models"))
    monkeypatch.setattr(ModelStore, "pull", lambda *_, say, report: noted.append("pulled"))
    return noted


@pytest.mark.parametrize(
    ("pull", "setting", "expected"),
    [
        (None, "ask", []),
        (None, "always", ["pulled"]),
        (None, "never", []),
        (True, "never", ["pulled"]),
        (False, "always", []),
    ],
)
def test_without_a_terminal_the_option_or_the_setting_decides(
    pulls: list[str], pull: bool | None, setting: str, expected: list[str]
) -> None:
    offer_models("mesh", "selfie", pull, setting)
    assert pulls == expected


def test_what_needs_no_model_is_offered_none(pulls: list[str]) -> None:
    offer_models("recorded:track.json", "recorded:mattes.npz", True, "always")
    assert pulls == []


@pytest.mark.parametrize(("answer", "expected"), [(True, ["pulled"]), (False, [])])
def test_at_a_terminal_the_person_decides_once(
    pulls: list[str], monkeypatch: pytest.MonkeyPatch, answer: bool, expected: list[str]
) -> None:
    asked: list[str] = []

    def confirm(question: str, **_: object) -> bool:
        asked.append(question)
        return answer

    monkeypatch.setattr(model_offer, "_is_terminal", lambda: True)
    monkeypatch.setattr("typer.confirm", confirm)
    offer_models("mesh", "", None, "never")
    assert asked == []
    offer_models("mesh", "selfie", None, "ask")
    assert (asked, pulls) == ([QUESTION], expected)
    offer_models("mesh", "selfie", None, "ask")
    assert len(asked) == (2 if answer else 1)  # the pull of this test stores nothing


def test_commands_without_a_terminal_say_what_to_do(pulls: list[str], tmp_path: Path) -> None:
    answer = call("track", demo_files.CLIP, "--out", tmp_path / "t.json")
    answer.complains("model face_mesh is not pulled", "relit models pull face_mesh")
    assert pulls == []
    call("track", demo_files.CLIP, "--out", tmp_path / "t.json", "--pull").complains("is not pulled")
    assert pulls == ["pulled"]


@pytest.fixture
def at_terminal(tmp_path: Path) -> Callable[..., tuple[int, str]]:
    """Runs `relit track` on a terminal with no models, types an answer, and gives the status and what was shown."""

    def run(typed: str) -> tuple[int, str]:
        ours, theirs = pty.openpty()
        process = subprocess.Popen(
            [*COMMAND, "track", str(demo_files.CLIP), "--out", str(tmp_path / "t.json")],
            stdin=theirs,
            stdout=theirs,
            stderr=theirs,
            env={**environment(tmp_path), "RELIT_MODELS_DIR": str(tmp_path / "models")},
        )
        os.close(theirs)
        os.write(ours, typed.encode())
        shown = b""
        try:
            while part := os.read(ours, 4096):
                shown += part
        except OSError:
            pass  # so Linux says that the process has closed its end
        os.close(ours)
        return process.wait(30), shown.decode()

    return run


@pytest.mark.slow
def test_no_is_clear_and_remembered(at_terminal: Callable[..., tuple[int, str]], tmp_path: Path) -> None:
    status, shown = at_terminal("n\n")
    assert status == 1
    assert QUESTION in shown
    assert "you are not asked again" in shown
    assert "model face_mesh is not pulled; run `relit models pull face_mesh`" in shown
    assert {path.name for path in (tmp_path / "models").iterdir()} == {model_offer.REFUSED_FILE_NAME}
    status, shown = at_terminal("y\n")
    assert status == 1
    assert QUESTION not in shown


def test_a_no_that_cannot_be_noted_is_no_error(tmp_path: Path) -> None:
    (tmp_path / "models").touch()
    model_offer._remember(tmp_path / "models" / model_offer.REFUSED_FILE_NAME)
    assert (tmp_path / "models").is_file()
