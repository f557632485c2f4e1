"""`python -m tests.gate`: the checks and tests that a change needs, one line a part; exit status 1 if one fails.

With `--all`, or where CI_ALL is set, every part runs. With `--prepare` what parts need of the machine is installed
meanwhile, as far as it can be had. With `--record` the parts that pass are noted in `passed.json`, so that later runs
leave them out.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from enum import StrEnum

from tests.durations import FILE, PART_VARIABLE
from tests.durations import main as print_durations
from tests.gate.choice import ROOT, Choice, Pass, choose, digest, read_passed, this_commit, write_passed
from tests.gate.parts import NEEDS, PARTS, PARTS_VARIABLE, UNAVAILABLE, Part, pytest_command


class Kind(StrEnum):
    """When a step runs."""

    CHECK = "check"
    """First, one after another."""
    TOGETHER = "together"
    """Then the tests that share a run of pytest."""
    BESIDE = "beside"
    """While these run, one after another."""
    ALONE = "alone"
    """In the end, one after another."""


@dataclass(frozen=True)
class Step:
    """One command, which may be several parts' tests."""

    kind: Kind
    name: str
    does: str
    usual: str
    command: tuple[str, ...]
    parts: tuple[Part, ...]
    variables: Mapping[str, str] = field(default_factory=dict)


def steps_of(parts: Sequence[Part]) -> list[Step]:
    """The commands that run these parts."""
    steps = [
        Step(_kind_of(part), part.name, part.does, part.usual, part.command, (part,), part.variables)
        for part in parts
        if part.command
    ]
    if shared := tuple(part for part in parts if not part.command):
        # One process more than there are cores, as tests wait much of their time.
        processes = str((os.cpu_count() or 2) + 1)
        together = pytest_command("-n", processes, "--dist", "loadgroup", "--no-loadscope-reorder", "tests")
        names = " ".join(part.name for part in shared)
        does = "; ".join(part.does for part in shared)
        usual = " + ".join(part.usual for part in shared)
        steps.append(Step(Kind.TOGETHER, names, does, usual, together, shared, {PARTS_VARIABLE: names}))
    return steps


def _kind_of(part: Part) -> Kind:
    if part.beside:
        return Kind.BESIDE
    return Kind.ALONE if part.tests else Kind.CHECK


@dataclass(frozen=True)
class Result:
    """What became of a step.

    Attributes:
        step: that was run.
        seconds: it took.
        passed: whether its command succeeded.
        missing: what it needs and this machine does not have, and why.
        ran: it did, but for tests that need what is missing.
    """

    step: Step
    seconds: float = 0.0
    passed: bool = True
    missing: str = ""
    ran: bool = True


Ready = Mapping[str, Future[subprocess.CompletedProcess[str]]]
"""What came of making ready each need."""


def make_ready(name: str) -> subprocess.CompletedProcess[str]:
    """Install what parts need."""
    return subprocess.run(NEEDS[name].command, cwd=ROOT, capture_output=True, text=True, check=False)


def run_step(step: Step, ready: Ready) -> Result:
    """Run a step's command as soon as what it needs is there. What one beside others prints is shown if it fails."""
    done = {need: ready[need].result() for part in step.parts for need in part.needs + part.wants if need in ready}
    for need, made in done.items():
        if made.returncode not in (0, UNAVAILABLE):
            print(f"-- {step.name}: failed, as making ready {need} did:\n{made.stdout}{made.stderr}", flush=True)
            return Result(step, passed=False, ran=False)
    missing = {need: made.stderr.strip() for need, made in done.items() if made.returncode}
    told = "; ".join(f"{need}: {why}" for need, why in missing.items())
    if any(need in missing for part in step.parts for need in part.needs):
        print(f"-- {step.name} is left out, this machine has no {told}", flush=True)
        return Result(step, missing=told, ran=False)
    environment = {**os.environ, **step.variables, PART_VARIABLE: step.name}
    for need in done.keys() - missing:
        environment |= NEEDS[need].variables
    # What is compiled once need not be by each of the hundreds of processes that tests start.
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    print(f"-- {step.name}: {step.does} (usually {step.usual})", flush=True)
    begun, hidden = time.monotonic(), step.kind is Kind.BESIDE
    ended = subprocess.run(step.command, cwd=ROOT, env=environment, capture_output=hidden, text=True, check=False)
    took = time.monotonic() - begun
    last = ""
    if hidden and ended.returncode:
        print(ended.stdout, ended.stderr, sep="")
    elif hidden and ended.stdout.strip():
        last = f": {ended.stdout.strip().splitlines()[-1]}"
    print(f"-- {step.name}: {'failed' if ended.returncode else 'passed'} after {took:.0f} s{last}", flush=True)
    return Result(step, took, ended.returncode == 0, told)


def run_steps(steps: Sequence[Step], prepare: bool) -> list[Result]:
    """Run the steps up to the first that fails: checks; tests together, the longer checks beside them; tests alone."""
    needed = {need for step in steps for part in step.parts for need in part.needs + part.wants} if prepare else set()
    checks, together, beside, alone = ([step for step in steps if step.kind is kind] for kind in Kind)
    results: list[Result] = []
    # Debian's packages are installed one after another, in the order of the table.
    with ThreadPoolExecutor(1) as installing, ThreadPoolExecutor(1) as second:
        ready = {name: installing.submit(make_ready, name) for name in NEEDS if name in needed}
        try:
            for step in checks:
                results.append(run_step(step, ready))
                if not results[-1].passed:
                    return results
            meanwhile = [second.submit(run_step, step, ready) for step in beside]
            results += [run_step(step, ready) for step in together]
            results += [each.result() for each in meanwhile]
            for step in alone:
                if not all(result.passed for result in results):
                    break
                results.append(run_step(step, ready))
        finally:
            for pool in (installing, second):
                pool.shutdown(wait=False, cancel_futures=True)
    return results


def passes(results: Sequence[Result], before: Mapping[str, str]) -> dict[str, Pass]:
    """What goes on record: parts that ran, lacked nothing and passed, and whose files are as they were before."""
    parts = [part for each in results if each.ran and each.passed and not each.missing for part in each.step.parts]
    commit = this_commit()
    unchanged = [part.name for part in parts if part.about and before[part.name] == digest(part.about)]
    return {name: Pass(commit, before[name]) for name in unchanged}


def main() -> int:
    """Run the parts that are needed; 0 if none has failed."""
    parser = argparse.ArgumentParser(prog="python -m tests.gate", description=__doc__)
    names = [part.name for part in PARTS]
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"run only these: {' '.join(names)}")
    parser.add_argument("--all", action="store_true", help="run every part")
    parser.add_argument("--prepare", action="store_true", help="install what parts need of the machine")
    parser.add_argument(
        "--record", action="store_true", help="--prepare, and note in passed.json which parts have passed"
    )
    parser.add_argument("--list", action="store_true", help="only say what would run, and why")
    options = parser.parse_args()
    if unknown := set(options.parts) - set(names):
        parser.error(f"no part is called {', '.join(sorted(unknown))}; there are {' '.join(names)}")
    begun = time.monotonic()
    passed = read_passed()
    choices = choose(PARTS, passed, everything=options.all or bool(os.environ.get("CI_ALL")))
    if options.parts:
        choices = [Choice(part, part.name in options.parts, "only some are asked for") for part in PARTS]
    for choice in choices:
        if options.list or not (choice.runs or options.parts):
            print(f"-- {'runs' if choice.runs else 'left out'}: {choice.part.name} ({choice.part.does}): {choice.why}")
    if options.list:
        return 0
    chosen = [choice.part for choice in choices if choice.runs]
    before = {part.name: digest(part.about) for part in chosen if part.about} if options.record else {}
    FILE.unlink(missing_ok=True)
    results = run_steps(steps_of(chosen), options.prepare or options.record)
    print_durations()
    print("| part | usually | took | |\n| --- | --- | --- | --- |")
    for result in results:
        end = "left out" if not result.ran else "passed" if result.passed else "FAILED"
        missing = f", no {result.missing}" if result.missing else ""
        print(f"| {result.step.name} | {result.step.usual} | {result.seconds:.0f} s | {end}{missing} |")
    print(f"| all | | {time.monotonic() - begun:.0f} s | |")
    if options.record:
        write_passed(passed | passes(results, before))
    return 0 if all(result.passed for result in results) else 1


if __name__ == "__main__":
    sys.exit(main())
