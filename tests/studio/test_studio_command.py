"""The command line: what is wrong is said at once, and is no traceback."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest
from typer.testing import CliRunner

from relit_camera.base.errors import InputError, StorageError
from relit_camera.capture.picture_import import import_samples
from relit_studio.__main__ import app
from relit_studio.field.transport_solver import SolverSettings


def refused(*arguments: str) -> str:
    """What is said of a command line that is a usage error."""
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    return result.output


def test_the_solver_fills_a_folder_that_imports_and_keeps_to_its_settings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small = partial(SolverSettings, width=32, height=24, map_rows=2, bundles=8, rays=32, supersampling=1, shadow=96)
    monkeypatch.setattr("relit_studio.field.transport_solver.SolverSettings", small)
    result = CliRunner().invoke(app, ["field", "--renderer", "solver", "--out", str(tmp_path / "field")])
    assert result.exit_code == 0
    assert "mannequin.relit" in result.output
    assert import_samples(tmp_path / "field" / "lights.lp").pictures.shape == (8, 24, 32, 3)
    monkeypatch.undo()
    result = CliRunner().invoke(app, ["field", "--renderer", "solver", "--out", str(tmp_path / "field")])
    assert isinstance(result.exception, InputError)


def test_the_solver_takes_none_of_the_options_of_cycles(tmp_path: Path) -> None:
    said = refused("field", "--renderer", "solver", "--out", str(tmp_path / "x"), "--person", "bea", "--lights", "253")
    assert "--person, --lights" in said
    assert not (tmp_path / "x").exists()


def test_the_solvers_scene_in_cycles_has_its_own_size_and_lights(tmp_path: Path) -> None:
    out = ("--out", str(tmp_path / "x"))
    said = refused("field", "--person", "mannequin", "--samples", "4", "--size", "64", "--denoise", *out)
    assert "--person mannequin takes no --size" in said
    assert "--samples" not in said
    assert not (tmp_path / "x").exists()


def test_angles_that_are_no_numbers_are_a_usage_error(tmp_path: Path) -> None:
    assert "--yaws" in refused("sheet", "--out", str(tmp_path / "sheet"), "--yaws", "0,left")
    assert not (tmp_path / "sheet").exists()


def test_a_drive_that_cannot_be_is_refused_before_the_work(tmp_path: Path) -> None:
    out = ["drive", "--out", str(tmp_path / "drive")]
    assert "has 144 frames" in refused(*out, "--frames", "145")
    assert "--size" in refused(*out, "--size", "191x108")
    result = CliRunner().invoke(app, [*out, "--performance", "dance"])
    assert isinstance(result.exception, InputError)
    assert "talk, turn, hands, away" in result.exception.cure
    assert not (tmp_path / "drive").exists()


def test_a_picture_that_cannot_be_written_is_said_before_the_work(tmp_path: Path) -> None:
    assert "--out" in refused("person", "--out", str(tmp_path / "adam.gif"))
    result = CliRunner().invoke(app, ["person", "--out", str(tmp_path / "none" / "adam.png")])
    with pytest.raises(StorageError, match="cannot write"):
        raise result.exception or AssertionError(result.output)
