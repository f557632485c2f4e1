"""The program as its users get it, on a disk for the test machine: the wheel and, from PyPI, what it needs."""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

from tests.vm.machine import GUEST_PROGRAM, cache_folder

ROOT = Path(__file__).resolve().parents[2]
GUEST_PYTHON = "3.11"
GLIBC = (28, 27, 26, 24, 17, 12, 5)
"""Debian 12 has 2.36; wheels name the oldest that they run on."""


def program_disk(folder: Path) -> Path:
    """Make the disk image in `folder`. The libraries come from PyPI once, until what the wheel asks for changes.

    Raises:
        subprocess.CalledProcessError: pip or mke2fs failed.
    """
    content = folder / "program"
    _copy_libraries(content)
    wheels = folder / "wheel"
    _pip("wheel", "--no-deps", "--wheel-dir", str(wheels), str(ROOT))
    (wheel,) = wheels.glob("relit_camera-*.whl")
    _pip("install", "--no-deps", "--target", str(content), str(wheel))
    # pip wrote the host's Python into the command.
    command = content / "bin" / "relit"
    command.write_text(f"#!/usr/bin/python{GUEST_PYTHON}\n" + command.read_text().partition("\n")[2])
    image = folder / "program.img"
    used_mib = sum(path.stat().st_size for path in content.rglob("*") if path.is_file()) >> 20
    size = f"{used_mib * 5 // 4 + 64}M"
    mke2fs = shutil.which("mke2fs", path=f"{os.environ['PATH']}:/usr/sbin:/sbin")
    assert mke2fs is not None, "mke2fs is Debian's e2fsprogs"
    make = [mke2fs, "-q", "-t", "ext4", "-O", "^has_journal", "-m", "0", "-d", str(content), str(image), size]
    subprocess.run(make, check=True, stdout=subprocess.DEVNULL)
    shutil.rmtree(content)
    return image


def environment() -> str:
    """The shell's words for using the program in the machine."""
    return f"export PYTHONPATH={GUEST_PROGRAM} PATH={GUEST_PROGRAM}/bin:$PATH PYTHONUNBUFFERED=1; "


def _copy_libraries(content: Path) -> None:
    needs = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    platforms = [f"--platform=manylinux_2_{minor}_x86_64" for minor in GLIBC]
    kind = [f"--python-version={GUEST_PYTHON}", "--implementation=cp", "--only-binary=:all:", *platforms]
    cache = cache_folder()
    found = cache / f"libraries-{hashlib.sha256(repr([kind, needs]).encode()).hexdigest()[:16]}"
    with (cache / "libraries.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not found.exists():
            for old in cache.glob("libraries-*"):
                shutil.rmtree(old)
            unfinished = cache / "libraries-unfinished"
            _pip("install", "--target", str(unfinished), *kind, *needs)
            shutil.rmtree(unfinished / "bin")  # their commands, for the host's Python
            unfinished.rename(found)
        shutil.copytree(found, content, symlinks=True)


def _pip(*words: str) -> None:
    subprocess.run([sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check", *words], check=True)
