"""`relit models` as a person runs it."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from relit_camera.base.errors import ModelError, NotFoundError
from relit_camera.base.models.model_manifest import public_manifest
from relit_camera.cli.commands.models import app
from tests.base.models.test_model_store import MIRRORED


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("RELIT_MODELS_DIR", str(tmp_path / "models"))
    return tmp_path / "models"


def relit_models(*arguments: str) -> list[str]:
    """The lines that the command prints; an error is raised, for the main command to print."""
    result = CliRunner().invoke(app, arguments, catch_exceptions=False)
    assert result.exit_code == 0
    return result.output.splitlines()


def test_list_is_plain_text_in_a_pipe(folder: Path) -> None:
    head, *lines = relit_models("list")
    assert head.split() == ["model", "state", "size", "licence", "from", "purpose"]
    assert [line.split()[:2] for line in lines] == [[name, "missing"] for name in public_manifest().models]
    assert not folder.exists()


def test_list_is_a_table_on_a_terminal(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "140")
    text = "\n".join(relit_models("list"))
    assert "Models in" in text
    assert "\x1b[" in text
    assert all(name in text for name in public_manifest().models)


def test_verify_wants_what_it_is_asked_for(folder: Path) -> None:
    for arguments in (["verify"], ["verify", "openseeface"]):
        with pytest.raises(ModelError, match="is not pulled; run `relit models pull"):
            relit_models(*arguments)
    with pytest.raises(NotFoundError, match="no public model 'mesh'; there are face_mesh, "):
        relit_models("verify", "mesh")


def test_pull_from_a_folder_that_is_not_there(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(NotFoundError, match="no folder"):
        relit_models("pull", "--from", str(tmp_path / "none"))


def test_pull_list_and_verify(folder: Path, shared: Path) -> None:
    mirror = ["--from", str(shared / "models")]
    assert relit_models("verify", *MIRRORED, *mirror)[-1].endswith("has the upstream files")
    assert relit_models("pull", "openseeface", "selfie_square", *mirror) == [
        "openseeface: getting lm_model0_opt.onnx",
        "selfie_square: getting selfie_segmentation.tflite",
        f"models are in {folder}",
    ]
    assert any(str(shared / "models") in line for line in relit_models("list"))
    states = dict(line.split()[:2] for line in relit_models("list")[1:])
    assert {name for name, state in states.items() if state == "pulled"} == {"openseeface", "selfie_square"}
    assert "openseeface: pulled" in relit_models("verify")
    (folder / "openseeface.onnx").write_bytes(b"half of it")
    with pytest.raises(ModelError, match=r"model openseeface in .* is of another version or damaged"):
        relit_models("verify")
    assert relit_models("verify", "selfie_square") == ["selfie_square: pulled"]
