"""Which parts of the gate a change needs: those whose files differ from what they were when the part last passed.

`passed.json` keeps the files' digest, which tells the same in any clone, however shallow or rebased, and the commit,
which is for people.
"""

from __future__ import annotations

import hashlib
import json
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from tests.gate.parts import Part

ROOT = Path(__file__).resolve().parents[2]
PASSED = Path(__file__).parent / "passed.json"


@dataclass(frozen=True)
class Pass:
    """When a part last passed.

    Attributes:
        commit: that was checked out, with "-dirty" where files differed from it.
        digest: of the files that the part is about.
    """

    commit: str
    digest: str


@dataclass(frozen=True)
class Choice:
    """Whether a part runs, and why."""

    part: Part
    runs: bool
    why: str


def choose(
    parts: Sequence[Part], passed: Mapping[str, Pass], everything: bool = False, root: Path = ROOT
) -> list[Choice]:
    """Which parts the files in `root` need; all of them with `everything`, and where `root` is no git repository."""
    return [_choose(part, passed.get(part.name), everything, root) for part in parts]


def _choose(part: Part, last: Pass | None, everything: bool, root: Path) -> Choice:
    if not part.about:
        return Choice(part, True, "always")
    if everything:
        return Choice(part, True, "all parts are asked for")
    if last is None:
        return Choice(part, True, "no pass is on record")
    if _git(root, "rev-parse", "--git-dir") is None:
        return Choice(part, True, "without git nobody knows what has changed")
    if last.digest == digest(part.about, root):
        return Choice(part, False, f"nothing that it is about has changed since it passed at {last.commit}")
    changed = changed_files(part.about, last.commit, root)
    more = f" and {len(changed) - 1} more" if len(changed) > 1 else ""
    return Choice(part, True, f"changed since {last.commit}: {changed[0]}{more}" if changed else "files have changed")


def read_passed(path: Path = PASSED) -> dict[str, Pass]:
    """The last pass of each part; none where the file is missing."""
    return {name: Pass(**of) for name, of in json.loads(path.read_text()).items()} if path.exists() else {}


def write_passed(passed: Mapping[str, Pass], path: Path = PASSED) -> None:
    """Write the last pass of each part."""
    path.write_text(json.dumps({name: asdict(of) for name, of in sorted(passed.items())}, indent=1) + "\n")


def digest(about: Iterable[str], root: Path = ROOT) -> str:
    """Of names and contents of the files that match these git pathspecs: those that git knows, and new ones.

    Raises:
        RuntimeError: `root` is no git repository.
    """
    total = hashlib.sha256()
    for name in files(about, root):
        total.update(f"{name}\0{hashlib.sha256((root / name).read_bytes()).hexdigest()}\n".encode())
    return total.hexdigest()[:16]


def files(about: Iterable[str], root: Path = ROOT) -> list[str]:
    """Those that match these git pathspecs, sorted, but for what git ignores.

    Raises:
        RuntimeError: `root` is no git repository.
    """
    listed = _git(root, "ls-files", "--cached", "--others", "--exclude-standard", "-z", "--", *about)
    if listed is None:
        raise RuntimeError(f"{root} is no git repository")
    return sorted(name for name in set(listed.split("\0")) if name and (root / name).is_file())


def changed_files(about: Iterable[str], commit: str, root: Path = ROOT) -> list[str]:
    """The files that match and differ from a commit's, new ones included; none where git does not know the commit."""
    differing = _git(root, "diff", "--name-only", "-z", commit.removesuffix("-dirty"), "--", *about)
    new = _git(root, "ls-files", "--others", "--exclude-standard", "-z", "--", *about)
    return sorted(filter(None, (differing + new).split("\0"))) if differing is not None and new is not None else []


def this_commit(root: Path = ROOT) -> str:
    """The commit that is checked out, "-dirty" added where files differ from it; "unknown" without git."""
    return (_git(root, "describe", "--always", "--dirty", "--abbrev=10", "--exclude=*") or "unknown").strip()


def _git(root: Path, *arguments: str) -> str | None:
    done = subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, check=False)
    return done.stdout if done.returncode == 0 else None
