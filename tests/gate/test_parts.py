"""The table of the gate's parts: every test is of one, and a part is about all that its tests import."""

from __future__ import annotations

import os
import subprocess
import sys

import grimp
import pytest

from tests.gate.choice import ROOT, files
from tests.gate.parts import NEEDS, PARTS, PARTS_VARIABLE, Part, part_of

CONDITIONAL = [part for part in PARTS if part.about]
IN_PROCESS = {"captures", "faults", "runs", "cost"}


def test_names_are_words_that_occur_once() -> None:
    names = [part.name for part in PARTS]
    assert len(set(names)) == len(names)
    assert all(name.isidentifier() for name in names)


def test_needs_are_known() -> None:
    assert {need for part in PARTS for need in part.needs} == set(NEEDS)


@pytest.mark.parametrize("part", PARTS, ids=lambda part: part.name)
def test_paths_exist(part: Part) -> None:
    for path in part.about:
        assert path.startswith(":(exclude") or files([path]), path
    for path in part.tests:
        assert (ROOT / path).exists(), path


@pytest.mark.parametrize("part", CONDITIONAL, ids=lambda part: part.name)
def test_a_part_is_about_its_own_tests(part: Part) -> None:
    own = [path for path in part.tests if not part.slow or path != "tests"]
    assert set(files(own) if own else []) <= set(files(part.about))


@pytest.mark.parametrize(
    ("path", "slow", "name"),
    [
        ("tests/vm/test_webcam.py", False, "vm"),
        ("tests/browser/test_privacy.py", True, "flows"),
        ("tests/browser/test_stills.py", True, "panel"),
        ("tests/pipewire/test_browsers.py", False, "pipewire"),
        ("tests/lab/bench/test_recorded_cost.py", True, "cost"),
        ("tests/faults/test_source_faults.py", False, "faults"),
        ("tests/test_crash.py", True, "faults"),
        ("tests/capture/film/test_film.py", True, "captures"),
        ("tests/capture/film/test_film.py", False, "unit"),
        ("tests/api/test_api_fuzz.py", True, "runs"),
        ("tests/api/test_api_scene.py", False, "unit"),
        ("tests/subject_maker/test_it.py", True, "runs"),  # no folder whose name only begins alike
    ],
)
def test_each_test_is_of_one_part(path: str, slow: bool, name: str) -> None:
    assert part_of(path, slow).name == name


@pytest.fixture(scope="module")
def graph() -> grimp.ImportGraph:
    """What imports what; but for the command line, by which tests call what they are about."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT))
        found = grimp.build_graph(
            "relit_camera", "relit_studio", "tests", cache_dir=None
        )  # a cache has files that are gone
    for command_line in [name for name in found.modules if name.startswith("relit_camera.cli")]:
        found.remove_module(command_line)
    return found


@pytest.mark.parametrize("part", CONDITIONAL, ids=lambda part: part.name)
def test_a_part_is_about_what_its_tests_import(part: Part, graph: grimp.ImportGraph) -> None:
    """Of other tests' files all of them; of the program all where they run in the test's process."""
    prefixes = tuple(path.removesuffix(".py").replace("/", ".") for path in part.tests)
    tests = [name for name in graph.modules for prefix in prefixes if name == prefix or name.startswith(f"{prefix}.")]
    imported = set().union(*(graph.find_upstream_modules(name) for name in tests)) | set(tests)
    asked = imported if part.name in IN_PROCESS else {name for name in imported if name.startswith("tests.")}
    about = set(files(part.about))
    assert [name for name in sorted(asked) if _path(name) not in about] == []


def _path(module: str) -> str:
    path = module.replace(".", "/")
    folder = "" if module.startswith("tests") else "service/"
    package = f"{folder}{path}/__init__.py"
    return package if (ROOT / package).exists() else f"{folder}{path}.py"


@pytest.mark.slow
def test_pytest_takes_the_tests_of_the_parts_asked_for() -> None:
    environment = {**os.environ, PARTS_VARIABLE: "faults", "PYTEST_ADDOPTS": ""}
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "tests/test_crash.py", "tests/test_layout.py"]
    found = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True).stdout
    assert "tests/test_crash.py::" in found
    assert "tests/test_layout.py::" not in found
