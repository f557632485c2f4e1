"""Check of the desktop's portal, the service through which browsers and sandboxed apps get PipeWire's cameras."""

from __future__ import annotations

import configparser
import shlex
from pathlib import Path

from relit_camera.base.config.settings import OutputSettings
from relit_camera.doctor.host import Host
from relit_camera.doctor.kernel_module import has_session
from relit_camera.doctor.readers.permission_store import read_camera_permissions
from relit_camera.doctor.report import Finding, ok, warning

PROGRAM = "xdg-desktop-portal"
SERVICE = "usr/share/dbus-1/services/org.freedesktop.portal.Desktop.service"
"""With it the session starts the portal when a program asks."""
BACKENDS = "usr/share/xdg-desktop-portal/portals"
ASKS = "org.freedesktop.impl.portal.Access"
"""What a desktop's part of the portal must offer: the question whether a program may. Else there are no cameras."""
STORE = "flatpak/db/devices"
"""In the folder of the user's data."""
PACKAGES = {
    "debian": "sudo apt install xdg-desktop-portal xdg-desktop-portal-gtk",
    "fedora": "sudo dnf install xdg-desktop-portal xdg-desktop-portal-gtk",
    "arch": "sudo pacman -S xdg-desktop-portal xdg-desktop-portal-gtk",
}
_DELETE = (
    "busctl --user call org.freedesktop.impl.portal.PermissionStore /org/freedesktop/impl/portal/PermissionStore "
    "org.freedesktop.impl.portal.PermissionStore DeletePermission sss devices camera"
)


def check_portal(host: Host, home: Path | None = None, settings: OutputSettings | None = None) -> Finding:
    """Check that the portal is there, that the desktop can ask, and that nobody was told no.

    Files are read, and names of processes; nothing is started.
    """
    topic, home, settings = "camera portal", home or Path.home(), settings or OutputSettings()
    if not has_session(settings, host):
        return ok(topic, f"not needed: '{settings.label}' is not in PipeWire")
    install = PACKAGES.get(host.family, f"# install {PROGRAM} and {PROGRAM}-gtk, or your desktop's own")
    running = host.find_processes()
    if PROGRAM not in running and not (host.root / SERVICE).is_file():
        seen = f"{PROGRAM} is not installed: browsers and sandboxed apps get no cameras from PipeWire"
        return warning(topic, seen, f"run: {install}; then log in again")
    asking = _backends(host)
    if not asking:
        seen = f"no desktop's part of {PROGRAM} can ask you ({ASKS}): then it gives no cameras"
        return warning(topic, seen, f"run: {install}; then log in again")
    answers = read_camera_permissions(host.user_data(home) / STORE)  # none where nobody has been asked yet
    names = {app: app or "programs without a sandbox" for app in answers}
    denied = [app for app, answer in answers.items() if answer == "no"]
    if denied:
        has_flatpak = (host.root / "usr/bin/flatpak").exists()
        forget = "flatpak permission-remove devices camera" if has_flatpak else _DELETE
        lines = " && ".join(f"{forget} {shlex.quote(app)}" for app in denied)
        seen = f"{', '.join(names[app] for app in denied)} may use no camera: so you answered the portal"
        return warning(topic, seen, f"to be asked again, run: {lines}")
    parts = sorted(name for name in running if name.startswith(f"{PROGRAM}-"))
    runs = f"{PROGRAM} runs" if PROGRAM in running else f"{PROGRAM} starts when a program asks for a camera"
    runs += f", with {', '.join(parts)}" if parts else ""
    allowed = ", ".join(names[app] for app, answer in answers.items() if answer == "yes")
    told = f"allowed: {allowed}" if allowed else "you have allowed no program yet, and are asked"
    return ok(topic, f"{runs}; {', '.join(asking)} can ask you; {told}")


def _backends(host: Host) -> list[str]:
    """Names of the desktops' parts that can ask."""
    found = []
    for file in sorted((host.root / BACKENDS).glob("*.portal")):
        parser = configparser.ConfigParser(interpolation=None, strict=False)
        try:
            parser.read_string(host.tree.read(file))
        except configparser.Error:
            continue
        if ASKS in parser.get("portal", "Interfaces", fallback="").split(";"):
            found.append(file.stem)
    return found
