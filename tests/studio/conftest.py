from __future__ import annotations

from pathlib import Path

import pytest

from relit_studio.mannequin.__main__ import main


@pytest.fixture(scope="session")
def generated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The command's output, small: 96 x 96 pictures under 12 lights, three frames of the clip."""
    out = tmp_path_factory.mktemp("mannequin") / "new" / "folder"
    assert main(["--out", str(out), "--size", "96", "--lights", "12", "--frames", "3", "--quiet"]) == 0
    return out
