"""Facts about the machine, read from files of the system: no program is run, and root is not needed."""

from __future__ import annotations

import ctypes
import os
import platform
import shlex
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import psutil

from relit_camera.devices.device_discovery import SYSTEM_FOLDERS, DeviceFolders
from relit_camera.devices.device_users import DeviceUser, find_device_users
from relit_camera.devices.sinks.pipewire.pipewire_sink import session_socket

SECURE_BOOT_VARIABLE = "sys/firmware/efi/efivars/SecureBoot-8be4df61-93ca-11d2-aa0d-00e098032b8c"
KERNEL_MODULE = "v4l2loopback"


def running_programs() -> set[str]:
    """Names of the processes that run, as far as this user may see them."""
    return {process.info["name"] or "" for process in psutil.process_iter(["name"])}


def data_home() -> Path | None:
    """Where this user's programs keep their data, if the environment says so; a relative path does not count."""
    folder = Path(os.environ.get("XDG_DATA_HOME", ""))
    return folder if folder.is_absolute() else None


def can_load(library: str) -> bool:
    """Whether a library of that file name can be loaded, wherever it is."""
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


@dataclass(frozen=True)
class Host:
    """The machine to check: this one, or a test's own.

    Attributes:
        root: where its files are.
        tree: its devices.
        release: of the kernel that runs, such as 6.1.0-56-amd64.
        is_linux: whether it has v4l2loopback at all.
        find_device_users: who else has a device node open.
        socket: where this user's programs reach PipeWire; None where the environment does not say.
        find_processes: names of the processes that run.
        can_load: whether a library of that file name can be loaded.
        data_home: where this user's programs keep their data; None for the usual folder in the user's home.
    """

    root: Path = Path("/")
    tree: DeviceFolders = SYSTEM_FOLDERS
    release: str = field(default_factory=platform.release)
    is_linux: bool = field(default_factory=lambda: platform.system() == "Linux")
    find_device_users: Callable[[str], list[DeviceUser]] = find_device_users
    socket: Path | None = field(default_factory=session_socket)
    find_processes: Callable[[], set[str]] = running_programs
    can_load: Callable[[str], bool] = can_load
    data_home: Path | None = field(default_factory=data_home)

    def read(self, path: str) -> str:
        """Text of a file below the root; empty where it cannot be read."""
        return self.tree.read(self.root / path)

    def user_data(self, home: Path) -> Path:
        """Where the programs of the user of that home keep their data."""
        return self.root / str(self.data_home or home / ".local/share").lstrip("/")

    @property
    def family(self) -> str:
        """The family of Linux distributions: `debian` (Ubuntu too), `fedora`, `arch`, or empty."""
        fields = dict(line.split("=", 1) for line in self.read("etc/os-release").splitlines() if "=" in line)
        names = [" ".join(shlex.split(fields.get(key, ""))) for key in ("ID", "ID_LIKE")]
        words = " ".join(names).split()
        return next((family for family in ("debian", "fedora", "arch") if family in words), "")

    @property
    def secure_boot(self) -> bool:
        """Whether the firmware says that Secure Boot is on: then the kernel takes signed modules only."""
        try:
            return (self.root / SECURE_BOOT_VARIABLE).read_bytes()[4:5] == b"\1"  # after four bytes of attributes
        except OSError:
            return False

    @property
    def module_loaded(self) -> bool:
        """Whether v4l2loopback is in the running kernel."""
        return (self.tree.sys / "module" / KERNEL_MODULE).is_dir()

    @property
    def module_version(self) -> str:
        """Version of the loaded module; empty for 0.12, which does not show it."""
        return self.tree.read(self.tree.sys / "module" / KERNEL_MODULE / "version")

    @property
    def kernels_with_module(self) -> list[str]:
        """Releases of the installed kernels for which modprobe knows the module."""
        found = (self.root / "lib/modules").glob("*/modules.dep")
        return sorted(path.parent.name for path in found if f"/{KERNEL_MODULE}.ko" in self.tree.read(path))

    @property
    def module_built_by_dkms(self) -> bool:
        """Whether DKMS has the module's source, built or not."""
        return (self.root / "var/lib/dkms" / KERNEL_MODULE).is_dir()

    def configured(self, folder: str, words: str) -> list[Path]:
        """Files of a folder such as etc/modprobe.d that have a line, no comment, that begins with these words."""
        return [
            path
            for path in sorted((self.root / folder).glob("*.conf"))
            if any(line.split()[: len(words.split())] == words.split() for line in self.tree.read(path).splitlines())
        ]
