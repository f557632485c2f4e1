"""The gate's steps: their order, what each is told, and what stops it."""

from __future__ import annotations

import sys
from concurrent.futures import Future
from pathlib import Path

import pytest

from tests.gate import __main__ as gate
from tests.gate.parts import NEEDS, PARTS, PARTS_VARIABLE, Need, Part


def python(code: str) -> tuple[str, ...]:
    return (sys.executable, "-c", code)


def test_all_parts_run_checks_first_and_tests_that_run_alone_last() -> None:
    steps = gate.steps_of(PARTS)
    assert sorted(part.name for step in steps for part in step.parts) == sorted(part.name for part in PARTS)
    (together,) = [step for step in steps if len(step.parts) > 1]
    assert together.variables[PARTS_VARIABLE].split() == [part.name for part in together.parts]
    at = steps.index(together)
    assert {step.parts[0].tests for step in steps[:at]} == {()}
    assert () not in {step.parts[0].tests for step in steps[at + 1 :]}


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Where the steps below write that they ran."""
    return tmp_path / "log"


def step(name: str, log: Path, code: str = "", **of: object) -> gate.Step:
    command = python(f"open({str(log)!r}, 'a').write({name + ' '!r}); {code}")
    part = Part(name, f"does {name}", "1 s", command, **of)  # type: ignore[arg-type]
    return gate.steps_of([part])[0]


def test_the_first_check_that_fails_ends_it(log: Path, capfd: pytest.CaptureFixture[str]) -> None:
    steps = [
        step("good", log),
        step("bad", log, "raise SystemExit('broken')"),
        step("beside", log, beside=True),
        step("later", log, tests=("tests",)),
    ]
    results = gate.run_steps(steps, prepare=False)
    assert [(result.step.name, result.passed) for result in results] == [("good", True), ("bad", False)]
    assert log.read_text() == "good bad "
    printed = capfd.readouterr()
    assert "-- good: does good (usually 1 s)" in printed.out
    assert "-- bad: failed after" in printed.out
    assert "broken" in printed.err


def test_what_runs_beside_others_is_shown_only_if_it_fails(log: Path, capfd: pytest.CaptureFixture[str]) -> None:
    steps = [
        step("quiet", log, "print('nobody need know')", beside=True),
        step("loud", log, "print('what is wrong'); raise SystemExit(1)", beside=True),
        step("later", log, tests=("tests",)),
    ]
    results = gate.run_steps(steps, prepare=False)
    assert [(result.step.name, result.passed) for result in results] == [("quiet", True), ("loud", False)]
    printed = capfd.readouterr().out
    assert "nobody need know" not in printed
    assert "what is wrong" in printed


def test_what_is_ready_is_told_to_tests_and_what_is_missing_to_people(
    log: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(NEEDS, "Chromium", Need(python(""), {"BROWSER_NEEDED": "1"}))
    monkeypatch.setitem(NEEDS, "PipeWire", Need(python("raise SystemExit('no apt here')")))
    look = f"import os; open({str(log)!r}, 'a').write(os.environ.get('BROWSER_NEEDED', 'unset') + ' ')"
    monkeypatch.delenv("BROWSER_NEEDED", raising=False)
    steps = [
        step("panel", log, look, tests=("tests",), needs=("Chromium",)),
        step("sound", log, tests=("tests",), needs=("PipeWire",)),
        step("other", log, look, tests=("tests",)),
    ]
    results = gate.run_steps(steps, prepare=True)
    assert log.read_text() == "panel 1 other unset "
    assert [(result.step.name, result.ran) for result in results] == [
        ("panel", True),
        ("sound", False),
        ("other", True),
    ]
    assert "sound is left out, this machine has no PipeWire: no apt here" in capfd.readouterr().out


def test_without_preparing_nothing_is_installed(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(NEEDS, "Chromium", Need(python(f"open({str(log)!r}, 'a').write('installed')")))
    gate.run_steps([step("panel", log, tests=("tests",), needs=("Chromium",))], prepare=False)
    assert log.read_text() == "panel "


def test_tests_that_share_a_run_are_run_but_not_on_record_where_something_is_missing() -> None:
    ready: Future[str] = Future()
    ready.set_result("public networks: none here")
    part = Part("unit", "each unit", "1 s", needs=("public networks",))
    shared = gate.Step("unit", "each unit", "1 s", python(""), (part,))
    result = gate.run_step(shared, {"public networks": ready})
    assert (result.ran, result.passed, result.missing) == (True, True, "public networks: none here")
