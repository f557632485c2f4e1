"""Finds the programs that have a device open, by Linux's /proc."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

PROC = Path("/proc")
KEEPER_MODULE = "relit_camera.devices.keeper.keeper_process"
"""What a keeper's command line names."""


@dataclass(frozen=True)
class DeviceUser:
    """A program that has a device open.

    Attributes:
        pid: its process.
        name: its short name, such as `firefox`.
        command: its arguments; empty where they may not be read.
    """

    pid: int
    name: str
    command: tuple[str, ...] = ()

    @property
    def is_relit_camera(self) -> bool:
        """Whether it is the command `relit`, or its keeper."""
        return self.is_keeper or any(Path(part).name == "relit" for part in self.command[:2])

    @property
    def is_keeper(self) -> bool:
        """Whether it is a keeper: it has the virtual camera open to write to it."""
        return KEEPER_MODULE in self.command

    def __str__(self) -> str:
        return f"{'relit' if self.is_relit_camera else self.name} (process {self.pid})"


def find_device_users(node: str, proc: Path = PROC) -> list[DeviceUser]:
    """List the other programs that have a device node open, by process number.

    Only root sees the programs of other users, for /proc shows open files to their owner alone. The links are read
    here since psutil's `open_files` lists regular files only, no devices.
    """
    return [_device_user(folder) for folder in _processes(proc) if _has_open(folder, node)]


def has_mapped_buffers(user: DeviceUser, node: str, proc: Path = PROC) -> bool:
    """Whether a program has mapped the device's buffers into its memory, as programs do that read pictures from it."""
    try:
        lines = (proc / str(user.pid) / "maps").read_text(errors="replace").splitlines()
    except OSError:  # it has ended, or may not be read
        return False
    return any(line.endswith(f" {node}") for line in lines)


def _processes(proc: Path) -> Iterator[Path]:
    try:
        numbers = sorted(int(entry.name) for entry in proc.iterdir() if entry.name.isdigit())
    except OSError:
        return
    yield from (proc / str(number) for number in numbers if number != os.getpid())


def _has_open(folder: Path, node: str) -> bool:
    try:
        with os.scandir(folder / "fd") as links:
            return any(_link_target(Path(link)) == node for link in links)
    except OSError:  # it has ended, or is another user's
        return False


def _link_target(link: Path) -> str:
    try:
        return str(link.readlink())
    except OSError:
        return ""


def _device_user(folder: Path) -> DeviceUser:
    try:
        name = (folder / "comm").read_text(errors="replace").strip()
        command = (folder / "cmdline").read_text(errors="replace").rstrip("\0").split("\0")
    except OSError:
        name, command = "a program that has just ended", []
    return DeviceUser(int(folder.name), name, tuple(command))
