"""The mutants, the choice of them, and the tests that each is tried on."""

from __future__ import annotations

import ast
import shutil
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from tests.mutants import Mutant, allotted, chosen, mutants_of, mutated
from tests.mutation import ROOT, TestFiles, comparison, table, within


def changes(text: str) -> set[tuple[str, str, str]]:
    return {(mutant.operator, mutant.before, mutant.after) for mutant in mutants_of(text, "a.py")}


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("a < b", {("comparison", "a < b", "a <= b")}),
        ("a == b is c", {("comparison", "a == b is c", each) for each in ("a != b is c", "a == b is not c")}),
        ("a and b and c", {("boolean", "a and b and c", "a or b or c")}),
        ("x = not a", {("not", "not a", "a")}),
        ("a * b", {("arithmetic", "a * b", "a / b")}),
        ("x = 3", {("constant", "3", "4")}),
        ("x: float = 0.5", {("constant", "0.5", "1.5")}),
        ("f(a, key=True)", {("constant", "True", "False"), ("call", "f(a, key=True)", "pass")}),
        ("def f(a: int = 1, *, b=False): ...", {("default", "1", "2"), ("default", "False", "True")}),
        ("def f() -> int: return a", {("return", "return a", "return None")}),
        ("if a: b", {("if", "a", "not (a)")}),
        ("if not a: b", {("not", "not a", "a")}),
    ],
)
def test_each_operator(text: str, found: set[tuple[str, str, str]]) -> None:
    assert changes(text) == found


@pytest.mark.parametrize(
    "text",
    [
        '"""It has 3 words."""',
        "x: Literal[1, True]",
        "def f(a: Literal[1]) -> Literal[2]: ...",
        "def f() -> None: return g(a)",
        "def f(): return g(a)",
        "def __repr__(self) -> str: return a + b",
        "__all__ = a + b",
        "if TYPE_CHECKING: import a",
        "log.info('%d', a + 1)",
        "x = f'{a + 1} of 3'",
        "x = 'a' + b",
        "x = zip(a, b, strict=True)",
        "@dataclass(frozen=True)\nclass A: ...",
    ],
)
def test_what_nobody_can_notice_is_no_mutant(text: str) -> None:
    assert changes(text) == set()


@pytest.mark.parametrize(
    ("operator", "changed"),
    [
        ("arithmetic", 'α = "µ", ((a - b))\nif c:\n    f(\n        1\n    )\n'),
        ("if", 'α = "µ", (a +\n    b)\nif (not (c)):\n    f(\n        1\n    )\n'),
        ("call", 'α = "µ", (a +\n    b)\nif c:\n    pass\n'),
        ("constant", 'α = "µ", (a +\n    b)\nif c:\n    f(\n        (2)\n    )\n'),
    ],
)
def test_a_mutated_module_differs_in_that_place_alone(operator: str, changed: str) -> None:
    text = 'α = "µ", (a +\n    b)\nif c:\n    f(\n        1\n    )\n'
    (mutant,) = (each for each in mutants_of(text, "a.py") if each.operator == operator)
    assert mutated(text, mutant) == changed


def test_each_folder_has_its_share() -> None:
    assert allotted({"a": 10, "b": 90, "c": 0}, 13) == {"a": 2, "b": 10, "c": 1}
    assert sum(allotted({"a": 1, "b": 1, "c": 1}, 10).values()) == 10


@pytest.mark.slow
def test_the_choice_is_fixed_and_each_mutant_can_be_compiled(tmp_path: Path) -> None:
    folder = "service/relit_camera/light"
    shutil.copytree(ROOT / folder, tmp_path / folder)
    mutants = chosen(tmp_path, 30, 1)
    assert len({mutant.id for mutant in mutants}) == 30
    assert mutants == chosen(tmp_path, 30, 1)
    assert mutants != chosen(tmp_path, 30, 2)
    assert len({mutant.operator for mutant in mutants}) > 5
    for mutant in mutants:
        text = (ROOT / mutant.file).read_text()
        assert ast.dump(ast.parse(mutated(text, mutant))) != ast.dump(ast.parse(text))


@pytest.fixture
def files(tmp_path: Path) -> TestFiles:
    texts = {
        "light/test_lamps.py": "import pytest",
        "light/test_light_map.py": "from relit_camera.light import lamps",
        "face/test_face.py": "from tests.helper import lamp",
        "face/test_other.py": "from relit_camera.light.exposure import x",
        "light/test_exposure.py": "import numpy",
        "face/test_tracker.py": "from relit_camera.face import tracker",
        "vm/test_machine.py": "from relit_camera.light import lamps",
        "helper.py": "import relit_camera.light.lamps",
    }
    for name, text in texts.items():
        path = tmp_path / "tests" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return TestFiles(tmp_path)


def test_the_nearest_tests_come_first(files: TestFiles) -> None:
    assert files.near("relit_camera.light.lamps") == [
        ["tests/light/test_lamps.py"],
        ["tests/light/test_light_map.py"],
        ["tests/face/test_face.py", "tests/face/test_other.py"],
        ["tests/light/test_exposure.py"],
    ]


def test_the_time_for_a_mutant_is_kept() -> None:
    seconds = {"a": 50.0, "b": 5.0, "c": 1.0, "d": 30.0}
    assert within([["a"], ["b"]], seconds, 40) == ["a"]
    assert within([["d", "b"], ["c", "untimed"]], seconds, 35) == ["b", "d"]
    assert within([["untimed"]], seconds, 40) == []


def test_results_are_compared() -> None:
    def results(*outcomes: str) -> dict[str, Any]:
        mutants = [Mutant("service/relit_camera/light/a.py", line, 0, line, 1, "constant", "1", "2") for line in (1, 2)]
        told = zip(mutants, outcomes, strict=True)
        return {"mutants": {m.id: {**asdict(m), "outcome": o, "files": 1, "farther": 0} for m, o in told}}

    before, after = results("tests/test_a.py::test_a", "alive"), results("alive", "timed out")
    assert table(before["mutants"].values()).splitlines()[-1] == "| all | 2 | 1 | 0 | 1 | 0 |"
    assert table(after["mutants"].values()).splitlines()[-1] == "| all | 2 | 0 | 1 | 1 | 0 |"
    text = comparison(before, after)
    assert text.count("a.py:1") == 2, "alive, and lost"
    assert "a.py:2" not in text
