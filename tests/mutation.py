"""`python -m tests.mutation`: which small faults in the program the tests notice.

`list` prints a fixed choice of mutants (a place in the program, and the fault that is put there), `run` tries each on
the tests that are nearest to it, `compare` tells two results from each other. The program is that of this checkout; the
tests may be those of another one (`run --tests`), as a mutant's name depends on the program alone.

A mutant is written into a copy of the checkout. Tests run in the order of their nearness to the mutated module, for
some time for each mutant: what lives may still be noticed by a test that is farther away. Left out are tests marked
`study`, the suites of the browser, the virtual machine and PipeWire, files that take longer than a minute, and tests
that fail without a mutant.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import queue
import re
import shutil
import subprocess
import sys
import tempfile
import venv
from ast import Import, ImportFrom, parse, walk
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import asdict, fields
from functools import cached_property
from itertools import count
from pathlib import Path
from threading import Lock
from typing import Any

import pytest

from relit_camera.base.storage.atomic_files import write_atomic
from tests import forked_pytest
from tests.made_once import FOLDER_VARIABLE
from tests.mutants import Mutant, chosen, mutated
from tests.package_index import PACKAGED

ROOT = Path(__file__).resolve().parents[1]
SEED, MUTANTS = 1, 300
SLOW_FILE_S = 60.0
MOST_S = 40.0
"""So long run the tests of one mutant, as measured without it."""
TIMEOUT_S = 180.0
LEFT_OUT = ("tests/browser/", "tests/pipewire/", "tests/vm/", "tests/test_mutation.py")
PYTEST = ("-q", "-p", "no:cacheprovider", "-W", "ignore::pytest.PytestWarning")
OWN_FOLDERS = ("HOME", "TMPDIR", FOLDER_VARIABLE)
LIVE_OUTCOMES = ("timed out", "alive", "not covered")


class TestFiles:
    """The test files of a checkout, and what of the program each names."""

    __test__ = False

    def __init__(self, root: Path) -> None:
        self.root = root
        paths = sorted(path.relative_to(root).as_posix() for path in (root / "tests").rglob("*.py"))
        self._named = {name: set(_imports((root / name).read_text(encoding="utf-8"))) for name in paths}
        self.names = [name for name in paths if Path(name).name[:5] == "test_" and not name.startswith(LEFT_OUT)]

    @cached_property
    def _reached(self) -> dict[str, set[str]]:
        """What each test file names, its helpers and the conftest.py of its folders included."""
        return {name: self._closure(name) for name in self.names}

    def _closure(self, name: str) -> set[str]:
        folders = [parent.as_posix() for parent in Path(name).parents if parent.as_posix() not in ("tests", ".")]
        waiting = [name, *(f"{folder}/conftest.py" for folder in folders)]
        seen, reached = set[str](), set[str]()
        while waiting:
            file = waiting.pop()
            if file in self._named and file not in seen:
                seen.add(file)
                reached |= self._named[file]
                waiting += [f"{named.replace('.', '/')}.py" for named in self._named[file]]
        return reached

    def near(self, module: str) -> list[list[str]]:
        """Test files for a module in four ranks.

        Those that have its name; those that import it; those that import it through helpers, or another module of its
        folder; those that do the latter through helpers, or lie in the folder that mirrors one of its folders.
        """
        folder, _, own = module.rpartition(".")
        ranks: list[list[str]] = [[], [], [], []]
        for name in self.names:
            path, named, reached = Path(name), self._named[name], self._reached[name]
            mirrors = ".".join(("relit_camera", *path.parts[1:-1]))
            lies_near = path.parent != Path("tests") and f"{folder}.".startswith(f"{mirrors}.")
            if lies_near and re.search(rf"_{re.escape(own)}$", path.stem):
                ranks[0].append(name)
            elif module in named:
                ranks[1].append(name)
            elif module in reached or any(each.startswith(f"{folder}.") for each in named):
                ranks[2].append(name)
            elif lies_near or any(each.startswith(f"{folder}.") for each in reached):
                ranks[3].append(name)
        return ranks

    def digest(self, name: str) -> str:
        """Changes with a file's text."""
        return hashlib.sha256((self.root / name).read_bytes()).hexdigest()[:10]


def _imports(text: str) -> Iterator[str]:
    """Every dotted name that a text imports; of `from a import b` both a and a.b, which may be a module too."""
    for node in walk(parse(text)):
        if isinstance(node, Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def within(ranks: Iterable[Iterable[str]], seconds: Mapping[str, float], most_s: float) -> list[str]:
    """Test files of some ranks, the quickest of a rank first, which together take no longer than so many seconds."""
    taken, total = list[str](), 0.0
    for rank in ranks:
        for name in sorted((name for name in rank if name in seconds), key=lambda name: seconds[name]):
            if not taken or total + seconds[name] <= most_s:
                taken.append(name)
                total += seconds[name]
    return taken


class Overlay:
    """A copy of the checkout with tests from another, and a Python that imports the program from it."""

    def __init__(self, folder: Path, tests: Path, marks: str) -> None:
        self.folder, self.root, self._marks = folder, folder / "repo", marks
        for root, is_ours in ((ROOT, True), (tests, False)):
            listed = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
            for name in subprocess.check_output(listed, cwd=root, text=True).splitlines():
                if name.startswith("service/") == is_ours and (root / name).is_file():
                    (self.root / name).parent.mkdir(parents=True, exist_ok=True)
                    shutil.copy2(root / name, self.root / name)
        venv.create(folder / "python", symlinks=True)
        paths = [self.root / "service", *(path for path in sys.path if path.endswith("-packages"))]
        (packages,) = (folder / "python/lib").glob("python*/site-packages")
        (packages / "overlay.pth").write_text("".join(f"{path}\n" for path in paths))
        self._times = count(1_000_000_000)
        own = {name: str(folder / name) for name in OWN_FOLDERS}
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("RELIT_CONFIG", "PYTHON"))}
        command = [str(folder / "python/bin/python"), "-P", forked_pytest.__file__]
        self._process = subprocess.Popen(
            command, cwd=self.root, env=kept | own, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )

    def close(self) -> None:
        """End its process."""
        self._process.communicate()

    def pytest(self, arguments: Sequence[str], files: Sequence[str], timeout_s: float) -> dict[str, Any]:
        """Run test files in this order; the answer holds `status`, None if it took too long, and tests by outcome."""
        for name in OWN_FOLDERS:
            shutil.rmtree(self.folder / name, ignore_errors=True)
        for name in ("HOME", "TMPDIR"):
            (self.folder / name).mkdir()
        shutil.copytree(self.folder.parent / "networks", self.folder / FOLDER_VARIABLE, copy_function=os.link)
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        request = {"arguments": [*PYTEST, "-m", self._marks, *arguments], "files": files, "timeout_s": timeout_s}
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        answer: dict[str, Any] = json.loads(self._process.stdout.readline())
        return answer

    def write(self, file: str, text: str) -> None:
        """Replace a module's text, its time being one that no compiled file has."""
        (self.root / file).write_text(text, encoding="utf-8")
        os.utime(self.root / file, (0, next(self._times)))


def tried(overlay: Overlay, mutant: Mutant, files: Sequence[str], times: Mapping[str, Mapping[str, Any]]) -> str:
    """What becomes of a mutant: "alive", "timed out", or the test that it fails."""
    original = (ROOT / mutant.file).read_text(encoding="utf-8")
    deselected = [word for name in files for test in times[name]["failed"] for word in ("--deselect", test)]
    limit_s = min(TIMEOUT_S, 30 + 4 * sum(times[name]["seconds"] for name in files))
    overlay.write(mutant.file, mutated(original, mutant))
    try:
        answer = overlay.pytest(["-x", *deselected], files, limit_s)
    finally:
        overlay.write(mutant.file, original)
    if answer["status"] is None:
        return "timed out"
    return "alive" if answer["status"] == pytest.ExitCode.OK else (answer["failed"] or ["the start"])[0]


def run(mutants: Sequence[Mutant], tests: Path, marks: str, jobs: int, most_s: float, out: Path) -> dict[str, Any]:
    """Try mutants, and write what is found as it is found; what the file holds already is not done again."""
    out.parent.mkdir(parents=True, exist_ok=True)
    results: dict[str, Any] = json.loads(out.read_text()) if out.exists() else {"times": {}, "mutants": {}}
    files, free, writing = TestFiles(tests), queue.SimpleQueue[Overlay](), Lock()
    ranks = {mutant.id: files.near(mutant.module) for mutant in mutants if mutant.id not in results["mutants"]}

    def note(kind: str, key: str, found: Mapping[str, Any]) -> None:
        with writing:
            results[kind][key] = found
            write_atomic(out, json.dumps(results, indent=1).encode())

    def each(work: Callable[[Overlay, Any], None], things: Collection[Any]) -> None:
        def with_overlay(thing: Any) -> None:
            overlay = free.get()
            try:
                work(overlay, thing)
            finally:
                free.put(overlay)

        with ThreadPoolExecutor(jobs) as pool:
            for done, _ in enumerate(pool.map(with_overlay, things), 1):
                print(f"{work.__name__} {done} of {len(things)}", end="\r", file=sys.stderr, flush=True)

    def time_file(overlay: Overlay, name: str) -> None:
        note("times", name, {"digest": files.digest(name), **overlay.pytest([], [name], SLOW_FILE_S)})

    def try_mutant(overlay: Overlay, mutant: Mutant) -> None:
        near = [name for rank in ranks[mutant.id] for name in rank]
        taken = within(ranks[mutant.id], seconds, most_s)
        outcome = tried(overlay, mutant, taken, results["times"]) if taken else "not covered"
        found = {"outcome": outcome, "files": len(taken), "farther": len(near) - len(taken)}
        note("mutants", mutant.id, {**asdict(mutant), **found})

    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="m.")))
        fetch_networks(folder / "networks")
        for job in range(jobs):
            overlay = Overlay(folder / str(job), tests, marks)
            stack.callback(overlay.close)
            free.put(overlay)
        needed = sorted({name for near in ranks.values() for rank in near for name in rank})
        known = results["times"]
        each(time_file, [name for name in needed if known.get(name, {}).get("digest") != files.digest(name)])
        seconds = {
            name: time["seconds"] for name, time in known.items() if time["status"] is not None and time["passed"]
        }
        each(try_mutant, [mutant for mutant in mutants if mutant.id in ranks])
    return results


def fetch_networks(folder: Path) -> None:
    """Fetch the public networks, where the package index has them, as tests would for each mutant anew."""
    folder.mkdir()
    # An overlay is no git repository: what it makes is of its own run alone (`tests.made_once`).
    code = "import shutil, sys, tests.package_index as index; shutil.copytree(index.packaged_models(), sys.argv[1])"
    subprocess.run([sys.executable, "-c", code, str(folder / PACKAGED)], cwd=ROOT, check=False)


def table(mutants: Iterable[Mapping[str, Any]]) -> str:
    """What became of mutants, a line for each top folder and one for all."""
    found = defaultdict[str, Counter[str]](Counter)
    for mutant in mutants:
        folder = Path(mutant["file"]).parts[2]
        for name in (folder, "all"):
            found[name][mutant["outcome"] if mutant["outcome"] in LIVE_OUTCOMES else "killed"] += 1
    head = ("folder", "mutants", "killed", *LIVE_OUTCOMES)
    rows = [
        (name, str(counts.total()), *(str(counts[column]) for column in head[2:]))
        for name, counts in sorted(found.items(), key=lambda item: (item[0] == "all", item[0]))
    ]
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ("---",) * len(head), *rows))


def comparison(before: Mapping[str, Any], after: Mapping[str, Any]) -> str:
    """Two results of the same mutants: the share killed in each, those that live now, and those killed only before."""
    both = before["mutants"].keys() & after["mutants"].keys()

    def told(results: Mapping[str, Any]) -> list[Mapping[str, Any]]:
        return [results["mutants"][key] for key in sorted(both)]

    def is_killed(results: Mapping[str, Any], key: str) -> bool:
        return results["mutants"][key]["outcome"] not in ("alive", "not covered")

    alive = [key for key in after["mutants"] if key in both and not is_killed(after, key)]
    lost = [key for key in alive if is_killed(before, key)]
    parts = {
        "before": table(told(before)),
        "after": table(told(after)),
        "alive after": "\n".join(map(line_of, (after["mutants"][key] for key in alive))),
        "killed before, and not after": "\n".join(map(line_of, (after["mutants"][key] for key in lost))),
    }
    return "\n\n".join(f"{title}:\n{text or 'none'}" for title, text in parts.items())


def line_of(found: Mapping[str, Any]) -> str:
    """A mutant and what became of it."""
    mutant = Mutant(**{field.name: found[field.name] for field in fields(Mutant)})
    return f"{mutant}  [{found['outcome']}, {found['files']} files, {found['farther']} farther]"


def _only(mutants: Sequence[Mutant], wanted: str | None) -> list[Mutant]:
    """Those whose ids are given, between commas or in a file."""
    if wanted is None:
        return list(mutants)
    ids = (Path(wanted).read_text() if Path(wanted).is_file() else wanted.replace(",", " ")).split()
    return [mutant for mutant in mutants if mutant.id in ids]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    for command in (commands.add_parser("list"), running := commands.add_parser("run")):
        command.add_argument("--mutants", type=int, default=MUTANTS, help="how many are chosen")
        command.add_argument("--seed", type=int, default=SEED)
        command.add_argument("--only", metavar="IDS", help="of these ids, between commas or in a file")
    running.add_argument("--tests", type=Path, default=ROOT, metavar="CHECKOUT", help="whose tests are run")
    running.add_argument("--jobs", type=int, default=2)
    running.add_argument("--most", type=float, default=MOST_S, metavar="SECONDS", help="of tests for a mutant")
    running.add_argument(
        "--out", type=Path, default=ROOT / "build/mutation.json", help="what it holds is not done again"
    )
    comparing = commands.add_parser("compare")
    comparing.add_argument("before", type=Path)
    comparing.add_argument("after", type=Path)
    options = parser.parse_args(arguments)
    if options.command == "compare":
        print(comparison(*(json.loads(path.read_text()) for path in (options.before, options.after))))
        return
    mutants = _only(chosen(ROOT, options.mutants, options.seed), options.only)
    if options.command == "list":
        print("\n".join(map(str, mutants)))
        return
    results = run(mutants, options.tests.resolve(), "not study", options.jobs, options.most, options.out)
    print(table(results["mutants"].values()))


if __name__ == "__main__":
    main()
