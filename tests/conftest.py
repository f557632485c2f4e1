"""Fixtures every test may use, and which tests may run at the same time."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings
from threadpoolctl import threadpool_limits

from tests.cli.relit_command import Material, write_material
from tests.gate.parts import PARTS_VARIABLE, part_of
from tests.made_once import run_folder

pytest_plugins = ["tests.report_tables", "tests.durations"]

# A test's time depends on what else the machine does: pytest-timeout holds the whole, not each example.
# The same examples on every run, so that a red run is of the change it tests; HYPOTHESIS_PROFILE=explore seeks others.
settings.register_profile("relit", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None, max_examples=500)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "relit"))


def pytest_configure() -> None:
    """Make the run's folder before the processes of pytest-xdist start, which share it; and keep out of the session.

    No test but those of `tests/pipewire`, in a session of their own, may publish a camera.
    """
    os.environ["PIPEWIRE_RUNTIME_DIR"] = str(run_folder() / "no-session")


def pytest_make_parametrize_id(val: object) -> str | None:
    """Name a test after the length of a file's content, not after megabytes of it."""
    return f"{len(val)} bytes" if isinstance(val, bytes) and len(val) > 60 else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out the tests of parts that are not asked for (`tests.gate`); group and order the others.

    A group runs in one process, one test after another: the tests of a file, which share its fixtures. Groups with slow
    tests come first, so that no process waits for the others at the end; `--no-loadscope-reorder` keeps that order.
    First of all hooks, as pytest-xdist's reads the groups.
    """
    if chosen := os.environ.get(PARTS_VARIABLE, "").split():
        left_out = [item for item in items if _part(item) not in chosen]
        items[:] = [item for item in items if _part(item) in chosen]
        config.hook.pytest_deselected(items=left_out)
    slow = {_file(item) for item in items if item.get_closest_marker("slow")}
    for item in items:
        item.add_marker(pytest.mark.xdist_group(_file(item)))
    items.sort(key=lambda item: _file(item) not in slow)


def _file(item: pytest.Item) -> str:
    return item.nodeid.partition("::")[0]


def _part(item: pytest.Item) -> str:
    path = item.path.relative_to(item.config.rootpath).as_posix()
    return part_of(path, slow=item.get_closest_marker("slow") is not None).name


@pytest.fixture(scope="session", autouse=True)
def one_blas_thread() -> Iterator[None]:
    """As in the running camera: on a busy machine BLAS's threads wait for each other far longer than they work."""
    with threadpool_limits(limits=1, user_api="blas"):
        yield


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
