"""Flatpaks and Snaps on this machine, and whether their sandboxes let devices in, by their own files."""

from __future__ import annotations

import configparser
from collections.abc import Iterable
from pathlib import Path

from relit_camera.doctor.host import Host


class Sandboxes:
    """What is installed for everybody and for one user."""

    def __init__(self, host: Host, home: Path) -> None:
        """Set up.

        Args:
            host: the machine.
            home: the user's folder on it.
        """
        self._host = host
        self._flatpaks = (host.root / "var/lib/flatpak", host.user_data(home) / "flatpak")

    def program_of(self, app: str) -> Path | None:
        """The folder with a Flatpak's files, by its identifier; None where it is not installed."""
        for path in self._metadata(app):
            if path.is_file():
                return path.parent / "files"
        return None

    def hides_devices(self, app: str) -> bool:
        """Whether a Flatpak is installed and is not given all devices, by itself or by overrides: the last has its way.

        Overrides follow in Flatpak's order: those of the system before the user's, those for all apps before the app's.
        """
        if self.program_of(app) is None:
            return False
        overrides = [folder / "overrides" / name for folder in self._flatpaks for name in ("global", app)]
        said = [word for path in [*self._metadata(app), *overrides] for word in self._devices(path)]
        return next((word for word in reversed(said) if word in ("all", "!all")), "!all") == "!all"

    def snaps(self, names: Iterable[str]) -> list[str]:
        """Those of these Snaps that are installed."""
        return [name for name in names if (self._host.root / "snap" / name).is_dir()]

    def snap_hint(self, names: Iterable[str]) -> str:
        """What to do where one of these Snaps lists no camera, which only root can tell; empty where there are none."""
        lines = ", ".join(f"sudo snap connect {name}:camera" for name in self.snaps(names))
        return f"Snaps need their camera connected (if one lists no camera: {lines})" if lines else ""

    def _metadata(self, app: str) -> list[Path]:
        return [folder / "app" / app / "current/active/metadata" for folder in self._flatpaks]

    def _devices(self, path: Path) -> list[str]:
        parser = configparser.ConfigParser(interpolation=None, strict=False)
        try:
            parser.read_string(self._host.tree.read(path))
        except configparser.Error:
            return []
        return parser.get("Context", "devices", fallback="").split(";")


def give_devices(apps: Iterable[str]) -> str:
    """The cure for Flatpaks that are given no devices."""
    return "run: " + " && ".join(f"flatpak override --user --device=all {app}" for app in apps)
