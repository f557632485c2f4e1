"""The gate's steps: their order, what each is told, and what stops it."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import pytest

from tests.gate import __main__ as gate
from tests.gate.choice import Pass, digest, files
from tests.gate.parts import NEEDS, PARTS, PARTS_VARIABLE, UNAVAILABLE, Need, Part


def python(code: str) -> tuple[str, ...]:
    return (sys.executable, "-c", code)


def test_every_part_runs_in_a_step_of_its_kind() -> None:
    steps = gate.steps_of(PARTS)
    assert sorted(part.name for step in steps for part in step.parts) == sorted(part.name for part in PARTS)
    (together,) = [step for step in steps if len(step.parts) > 1]
    assert together.variables[PARTS_VARIABLE].split() == [part.name for part in together.parts]
    assert together.kind is gate.Kind.TOGETHER
    of_kind = {kind: {bool(step.parts[0].tests) for step in steps if step.kind is kind} for kind in gate.Kind}
    assert of_kind[gate.Kind.CHECK] == {False}
    assert of_kind[gate.Kind.ALONE] == {True}
    assert all(step.parts[0].beside is (step.kind is gate.Kind.BESIDE) for step in steps)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Where the steps below write that they ran."""
    return tmp_path / "log"


UNAVAILABLE_HERE = f"import sys; print('no apt here', file=sys.stderr); sys.exit({UNAVAILABLE})"


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
        step("quiet", log, "print('nobody need know\\n7 passed')", beside=True),
        step("loud", log, "print('what is wrong'); raise SystemExit(1)", beside=True),
        step("later", log, tests=("tests",)),
    ]
    results = gate.run_steps(steps, prepare=False)
    assert [(result.step.name, result.passed) for result in results] == [("quiet", True), ("loud", False)]
    printed = capfd.readouterr().out
    assert "nobody need know" not in printed
    assert "-- quiet: passed after 0 s: 7 passed" in printed
    assert "what is wrong" in printed


def test_what_is_ready_is_told_to_tests_and_what_is_missing_to_people(
    log: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(NEEDS, "Chromium", Need(python(""), {"BROWSER_NEEDED": "1"}))
    monkeypatch.setitem(NEEDS, "PipeWire", Need(python(UNAVAILABLE_HERE)))
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


def test_a_need_that_fails_to_be_made_ready_fails_the_part(
    log: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(NEEDS, "PipeWire", Need(python("raise SystemExit('the script is broken')")))
    (result,) = gate.run_steps([step("sound", log, tests=("tests",), needs=("PipeWire",))], prepare=True)
    assert (result.passed, result.ran) == (False, False)
    assert not log.exists()
    assert "the script is broken" in capfd.readouterr().out


def test_tests_that_want_what_is_missing_are_run_and_it_is_said(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(NEEDS, "public networks", Need(python(UNAVAILABLE_HERE)))
    (result,) = gate.run_steps([step("unit", log, tests=("tests",), wants=("public networks",))], prepare=True)
    assert (result.ran, result.passed, result.missing) == (True, True, "public networks: no apt here")


def test_on_record_goes_what_ran_whole_and_passed(monkeypatch: pytest.MonkeyPatch) -> None:
    digests = {"before": "1"}
    monkeypatch.setattr(gate, "digest", lambda about: digests[about[0]])
    monkeypatch.setattr(gate, "this_commit", lambda: "abc")
    step = gate.steps_of([Part("vm", "the camera", "1 s", python(""), tests=("tests/vm",), about=("before",))])[0]
    good = gate.Result(step)
    assert gate.passes([good], {"vm": "1"}) == {"vm": Pass("abc", "1")}
    for bad in ({"passed": False}, {"ran": False}, {"missing": "Chromium: no apt here"}):
        assert gate.passes([dataclasses.replace(good, **bad)], {"vm": "1"}) == {}
    assert gate.passes([good], {"vm": "another when it began"}) == {}
    always = gate.steps_of([Part("lint", "style", "1 s", python(""))])[0]
    assert gate.passes([gate.Result(always)], {}) == {}


def test_no_part_is_about_the_record_of_passes() -> None:
    assert not [part.name for part in PARTS if "tests/gate/passed.json" in files(part.about) and part.about]


@pytest.mark.parametrize(
    ("arguments", "everything", "runs_all"), [([], "", False), (["--all"], "", True), ([], "1", True)]
)
def test_every_part_runs_where_all_are_asked_for(
    arguments: list[str],
    everything: str,
    runs_all: bool,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    passed = {part.name: Pass("abc", digest(part.about)) for part in PARTS if part.about}
    monkeypatch.setattr(gate, "read_passed", lambda: passed)
    monkeypatch.setenv("CI_ALL", everything)
    monkeypatch.setattr(sys, "argv", ["gate", "--list", *arguments])
    assert gate.main() == 0
    assert ("left out: vm" not in capsys.readouterr().out) == runs_all


def test_a_part_that_there_is_not_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["gate", "linnt"])
    with pytest.raises(SystemExit):
        gate.main()
    assert "no part is called linnt" in capsys.readouterr().err
