"""Browsers in sandboxes, which see no camera unless they are let."""

from __future__ import annotations

import configparser
from pathlib import Path

from relit_camera.doctor.findings import Finding, fine, warning
from relit_camera.doctor.host import Host

FLATPAKS = (
    "org.mozilla.firefox",
    "org.chromium.Chromium",
    "com.google.Chrome",
    "com.brave.Browser",
    "com.microsoft.Edge",
    "us.zoom.Zoom",
)
SNAPS = ("firefox", "chromium", "brave", "zoom-client")
INSTALLATIONS = ("var/lib/flatpak", "{home}/.local/share/flatpak")


def check_browsers(host: Host, home: Path | None = None) -> Finding:
    """Which Flatpak browsers are not given devices, and which Snaps may have to be connected.

    A Flatpak's own metadata and the overrides of user and system are read; a portal may give a camera all the same.
    """
    topic, home = "browsers", home or Path.home()
    installations = [host.root / path.format(home=str(home).lstrip("/")) for path in INSTALLATIONS]
    shut = [app for app in FLATPAKS if _is_shut(app, installations, host)]
    if shut:
        cure = " && ".join(f"flatpak override --user --device=all {app}" for app in shut)
        return warning(topic, f"the Flatpak {', '.join(shut)} is given no devices", f"run: {cure}")
    snaps = [name for name in SNAPS if (host.root / "snap" / name).is_dir()]
    if snaps:
        lines = ", ".join(f"sudo snap connect {name}:camera" for name in snaps)
        return fine(topic, f"Snaps need their camera connected (if one lists no camera: {lines})")
    return fine(topic, "none in a sandbox that hides cameras")


def _is_shut(app: str, installations: list[Path], host: Host) -> bool:
    """Whether a Flatpak is installed and neither it nor an override gives it all devices."""
    metadata = [folder / "app" / app / "current/active/metadata" for folder in installations]
    if not any(path.is_file() for path in metadata):
        return False
    overrides = [folder / "overrides" / name for folder in installations for name in (app, "global")]
    return not any("all" in _devices(host.tree.read(path)) for path in metadata + overrides)


def _devices(text: str) -> list[str]:
    parser = configparser.ConfigParser(interpolation=None, strict=False)
    try:
        parser.read_string(text)
    except configparser.Error:
        return []
    return parser.get("Context", "devices", fallback="").split(";")
