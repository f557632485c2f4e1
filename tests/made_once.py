"""Material that takes long to make: made once in a test run, whichever of its processes asks first.

What depends on nothing but files of the repository is kept for later runs too, while its makers stay as they are.
"""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path

from filelock import FileLock

from tests.gate.choice import digest

KEPT = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "relit-camera-tests"
"""Where material is kept, the newest of each name; may be deleted at any time but during a run."""
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
        makers: git pathspecs of all files that decide what is made. Where they are given it is made once for all runs
            in which these files are the same.
    """
    folder = KEPT / name / digest(makers) if makers else run_folder()
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    with FileLock(path.with_name(f"{name}.lock")):
        if not path.exists():
            unfinished = path.with_name(f"unfinished-{name}")
            shutil.rmtree(unfinished, ignore_errors=True)
            unfinished.unlink(missing_ok=True)
            make(unfinished)
            unfinished.rename(path)
            for other in folder.parent.iterdir() if makers else ():
                if other != folder:
                    shutil.rmtree(other, ignore_errors=True)
    return path
