"""Python environment of Cycles. `bpy` needs numpy 1 and one exact version of Python, so it has its own."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from filelock import FileLock

from relit_camera.base.errors import DeviceError
from relit_camera.base.storage.atomic_files import make_folder
from relit_studio.base.assets.store import cache_folder

BPY = "4.5.15"
PYTHON = "3.11"
"""Version of Python that this bpy is built for."""
REQUIREMENTS = (f"bpy=={BPY}", "numpy<2")
LIBRARIES = "libx11-6 libxrender1 libxfixes3 libxi6 libxkbcommon0 libxext6 libsm6 libice6 libgl1"
"""Debian packages that bpy links to."""
_SETUP = "run `python -m relit_studio setup`"


def environment_folder() -> Path:
    """Folder of the environment, whether it exists or not."""
    return cache_folder() / f"bpy-{BPY}"


def environment_python() -> Path:
    """The environment's interpreter.

    Raises:
        DeviceError: it has not been made.
    """
    python = environment_folder() / "bin" / "python"
    if not (environment_folder() / "ready").is_file():
        raise DeviceError(f"Cycles is not set up: no environment at {environment_folder()}", _SETUP)
    return python


def create_environment() -> Path:
    """Create the environment unless a working one exists; returns its folder.

    Raises:
        DeviceError: there is no Python 3.11, or no environment can be made with it, or bpy cannot be installed or
            imported.
        StorageError: the cache cannot be written.
    """
    folder = environment_folder()
    make_folder(folder.parent)
    with FileLock(folder.with_suffix(".lock")):
        if not (folder / "ready").is_file():
            _create(folder)
    return folder


def _create(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    _run([_python311(), "-m", "venv", str(folder)], "make an environment")
    python = str(folder / "bin" / "python")
    _run([python, "-m", "pip", "install", "--quiet", *REQUIREMENTS], "install bpy")
    _run([python, "-c", "import bpy"], f"import bpy; on Debian, `apt-get install {LIBRARIES}` may be what is missing")
    (folder / "ready").touch()


def _python311() -> str:
    if f"{sys.version_info.major}.{sys.version_info.minor}" == PYTHON:
        return sys.executable
    found = shutil.which(f"python{PYTHON}")
    if found is None:
        raise DeviceError(f"bpy {BPY} wants Python {PYTHON}, and there is none", f"install python{PYTHON}")
    return found


def _run(command: list[str], purpose: str) -> None:
    # Without PYTHON* variables, or packages of the calling environment would be found in the new one.
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONHOME")}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    if done.returncode:
        # Without Debian's python3-venv, `venv` says so on stdout.
        last = ((done.stderr.strip() or done.stdout.strip()).splitlines() or ["no message"])[-1]
        raise DeviceError(f"cannot {purpose}: {last}", "cure that, then set up again")
