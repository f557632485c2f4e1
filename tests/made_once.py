"""Material that takes long to make: made once in a test run, whichever of its processes asks first."""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from filelock import FileLock

FOLDER_VARIABLE = "TEST_RUN_FOLDER"
"""Names the run's folder to the processes of pytest-xdist, which inherit it."""


def run_folder() -> Path:
    """The folder of this test run; gone when the process that made it ends."""
    if FOLDER_VARIABLE not in os.environ:
        folder = os.environ[FOLDER_VARIABLE] = tempfile.mkdtemp(prefix="relit-tests.")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(os.environ[FOLDER_VARIABLE])


def made_once(name: str, make: Callable[[Path], object]) -> Path:
    """The file or folder of this name in the run's folder, made by the first who asks while the others wait.

    Args:
        name: of the file or folder, its suffix included.
        make: writes it to the path that it is given. What it leaves when it raises is made anew by the next who asks.
    """
    path = run_folder() / name
    with FileLock(path.with_name(f"{name}.lock")):
        if not path.exists():
            unfinished = path.with_name(f"unfinished-{name}")
            shutil.rmtree(unfinished, ignore_errors=True)
            unfinished.unlink(missing_ok=True)
            make(unfinished)
            unfinished.rename(path)
    return path
