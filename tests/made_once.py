"""Material that takes long to make: made once in a test run, whichever of its processes asks first.

What depends on nothing but files of the repository is kept for later runs too, while its makers stay as they are.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from importlib import metadata
from pathlib import Path

from filelock import FileLock

from tests.gate.choice import ROOT, digest

KEPT = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "relit-camera-tests"
"""Where material is kept, of each name what was used within a week; may be deleted at any time but during a run."""
WEEK_S = 7 * 24 * 3600
LIBRARY_OF_PICTURES = "opencv-contrib-python-headless"
FOLDER_VARIABLE = "TEST_RUN_FOLDER"
"""Names the run's folder to the processes of pytest-xdist, which inherit it."""


def run_folder() -> Path:
    """The folder of this test run; gone when the process that made it ends."""
    if FOLDER_VARIABLE not in os.environ:
        folder = os.environ[FOLDER_VARIABLE] = tempfile.mkdtemp(prefix="relit-tests.")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(os.environ[FOLDER_VARIABLE])


def made_once(name: str, make: Callable[[Path], object], makers: Iterable[str] = ()) -> Path:
    """The file or folder of this name in the run's folder, made by the first who asks while the others wait.

    Args:
        name: of the file or folder, its suffix included.
        make: writes it to the path that it is given. What it leaves when it raises is made anew by the next who asks.
        makers: git pathspecs of all files that decide what is made, beside the libraries. Where they are given, and in
            a git repository, it is made once for all runs in which these and the libraries are the same.
    """
    folder = KEPT / name / _key(makers) if makers and (ROOT / ".git").exists() else run_folder()
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    lock = path.with_name(f"{name}.lock")
    with FileLock(lock):
        lock.touch()
        if not path.exists():
            unfinished = path.with_name(f"unfinished-{name}")
            shutil.rmtree(unfinished, ignore_errors=True)
            unfinished.unlink(missing_ok=True)
            make(unfinished)
            unfinished.rename(path)
            _forget_old(folder.parent)
    return path


def _key(makers: Iterable[str]) -> str:
    versions = "".join(f"{name} {metadata.version(name)}\n" for name in ("numpy", "scipy", LIBRARY_OF_PICTURES))
    return f"{digest(makers)}-{hashlib.sha256((sys.version + versions).encode()).hexdigest()[:8]}"


def _forget_old(kept: Path) -> None:
    """Delete what another state of the makers made and nobody has used for a week: other checkouts have theirs."""
    for lock in kept.glob("*/*.lock") if kept.parent == KEPT else ():
        if lock.stat().st_mtime < time.time() - WEEK_S:
            shutil.rmtree(lock.parent, ignore_errors=True)
