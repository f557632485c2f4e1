"""The command line: what is wrong is said at once, and is no traceback."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from relit_camera.errors import StorageError
from relit_studio.__main__ import app


def refused(*arguments: str) -> str:
    """What is said of a command line that is a usage error."""
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    return result.output


def test_angles_that_are_no_numbers_are_a_usage_error(tmp_path: Path) -> None:
    assert "--yaws" in refused("sheet", "--out", str(tmp_path / "sheet"), "--yaws", "0,left")
    assert not (tmp_path / "sheet").exists()


def test_a_picture_that_cannot_be_written_is_said_before_the_work(tmp_path: Path) -> None:
    assert "--out" in refused("person", "--out", str(tmp_path / "adam.gif"))
    result = CliRunner().invoke(app, ["person", "--out", str(tmp_path / "none" / "adam.png")])
    with pytest.raises(StorageError, match="cannot write"):
        raise result.exception or AssertionError(result.output)
