"""Fixtures every test may use."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

from tests.cli.relit_command import Material, write_material

# A test's time depends on what else the machine does: pytest-timeout holds the whole, not each example.
# The same examples on every run, so that a red run is of the change it tests; HYPOTHESIS_PROFILE=explore seeks others.
settings.register_profile("relit", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None, max_examples=500)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "relit"))


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of real data that developers may have beside the checkout (or where RELIT_SHARED says)."""
    folder = Path(os.environ.get("RELIT_SHARED", Path(__file__).resolve().parents[2] / "shared"))
    if not (folder / "design.md").exists():
        pytest.skip(f"no shared data at {folder} (set RELIT_SHARED)")
    return folder


@pytest.fixture(scope="session")
def material(tmp_path_factory: pytest.TempPathFactory) -> Material:
    """A small subject, clip and track."""
    return write_material(tmp_path_factory.mktemp("material"))
