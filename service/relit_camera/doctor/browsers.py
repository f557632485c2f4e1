"""Check of the browsers on this machine: whether each one looks for cameras where ours is, by their own files."""

from __future__ import annotations

import configparser
import json
import re
from dataclasses import dataclass
from pathlib import Path

from relit_camera.base.config.settings import OutputSettings
from relit_camera.devices.device_discovery import list_virtual_cameras
from relit_camera.doctor.host import Host
from relit_camera.doctor.kernel_module import has_session
from relit_camera.doctor.report import Finding, ok, warning

FIREFOX_PREFERENCE = "media.webrtc.camera.allow-pipewire"
"""Firefox 116 and newer look for cameras in PipeWire where it is true; else at devices. False unless somebody sets it:
Fedora does from release 41 on."""
FIREFOX_MIN_VERSION = 116
FIREFOX_FOLDERS = (
    "usr/lib/firefox",
    "usr/lib/firefox-esr",
    "usr/lib64/firefox",
    "opt/firefox",
    "snap/firefox/current/usr/lib/firefox",
)
FIREFOX_PROFILES = (".mozilla/firefox", "snap/firefox/common/.mozilla/firefox", ".config/mozilla/firefox")
TOO_OLD_CURE = f"get Firefox {FIREFOX_MIN_VERSION} or newer"
FIREFOX_CURE = f"in Firefox's about:config set {FIREFOX_PREFERENCE} to true and restart it"

CHROMIUM_EXPERIMENT = "enable-webrtc-pipewire-camera@1"
"""How Chromium notes that its flag was set to "Enabled"; off by default."""
CHROMIUM_CURE = "set chrome://flags/#enable-webrtc-pipewire-camera to Enabled and restart it"
CHROMIUMS = {
    "Chromium": ("usr/bin/chromium", ".config/chromium"),
    "Chrome": ("usr/bin/google-chrome", ".config/google-chrome"),
    "Brave": ("usr/bin/brave-browser", ".config/BraveSoftware/Brave-Browser"),
    "Edge": ("usr/bin/microsoft-edge", ".config/microsoft-edge"),
}
"""Name → its program, and its folder in the user's home."""

FLATPAK_APPS = (
    "org.mozilla.firefox",
    "org.chromium.Chromium",
    "com.google.Chrome",
    "com.brave.Browser",
    "com.microsoft.Edge",
    "us.zoom.Zoom",
)
SNAP_APPS = ("firefox", "chromium", "brave", "zoom-client")
FLATPAK_ROOTS = ("var/lib/flatpak", "{home}/.local/share/flatpak")
PORTAL_NOTE = (
    "it then asks once whether it may (`flatpak permissions devices camera` tells what was answered, "
    "`flatpak permission-remove devices camera` forgets it)"
)


@dataclass(frozen=True)
class Browser:
    """A browser on this machine.

    Attributes:
        name: with its version, where that can be read.
        reads_pipewire: whether it looks for cameras in PipeWire, and not at devices.
        cure: what makes it look in PipeWire.
    """

    name: str
    reads_pipewire: bool
    cure: str


def check_browsers(host: Host, home: Path | None = None, settings: OutputSettings | None = None) -> Finding:
    """Check that browsers look for cameras where ours is, and that no sandbox hides devices from them.

    Their own files are read: programs, settings of users and distributions, and a Flatpak's metadata with the overrides
    of user and system. What a person answered the portal, and options of a command line, are not in such files.
    """
    topic, home = "browsers", home or Path.home()
    settings = settings or OutputSettings()
    user = host.root / str(home).lstrip("/")
    loopback = any(camera.ours for camera in list_virtual_cameras(host.tree, settings.label))
    pipewire = has_session(settings, host)
    found = [*_firefoxes(host, user), *_chromiums(host, user)]
    blind = [browser for browser in found if not (pipewire if browser.reads_pipewire else loopback)]
    reads = ", ".join(f"{each.name} reads {'PipeWire' if each.reads_pipewire else 'devices'}" for each in found)
    if pipewire and (at_devices := [browser for browser in blind if not browser.reads_pipewire]):
        cures = "; ".join(dict.fromkeys(browser.cure for browser in at_devices))
        return warning(topic, f"{reads}; '{settings.label}' is in PipeWire alone", f"{cures}; {PORTAL_NOTE}")
    if loopback and (only := [browser for browser in blind if browser.reads_pipewire]):
        names = ", ".join(browser.name for browser in only)
        cure = "start PipeWire (systemctl --user start pipewire wireplumber), or let it read devices again"
        return warning(topic, f"{names} looks for cameras in PipeWire, where there is none of ours", cure)
    installations = [host.root / path.format(home=str(home).lstrip("/")) for path in FLATPAK_ROOTS]
    denied = [app for app in FLATPAK_APPS if _lacks_device_access(app, installations, host)]
    if denied and loopback:
        cure = " && ".join(f"flatpak override --user --device=all {app}" for app in denied)
        return warning(topic, f"the Flatpak {', '.join(denied)} is given no devices", f"run: {cure}")
    snaps = [name for name in SNAP_APPS if (host.root / "snap" / name).is_dir()]
    if snaps:
        lines = ", ".join(f"sudo snap connect {name}:camera" for name in snaps)
        hint = f"Snaps need their camera connected (if one lists no camera: {lines})"
        return ok(topic, f"{reads}; {hint}" if reads else hint)
    return ok(topic, reads or "none in a sandbox that hides cameras")


def _firefoxes(host: Host, home: Path) -> list[Browser]:
    """Each Firefox that is installed."""
    found = []
    for path in FIREFOX_FOLDERS:
        text = host.read(f"{path}/application.ini")
        version = re.search(r"^Version=(\d+)([\d.]*)", text, re.MULTILINE)
        if version is None:
            continue
        new_enough = int(version[1]) >= FIREFOX_MIN_VERSION
        defaults = [
            *(host.root / path).glob("defaults/pref*/*.js"),
            *(host.root / path).glob("browser/defaults/pref*/*.js"),
        ]
        chosen = [file for folder in FIREFOX_PROFILES for file in (home / folder).glob("*/prefs.js")]
        values = [_preference(host.tree.read(file)) for file in [*defaults, *chosen]]
        stated = [value for value in values if value is not None]
        reads = new_enough and bool(stated) and stated[-1]
        found.append(Browser(f"Firefox {version[1]}{version[2]}", reads, FIREFOX_CURE if new_enough else TOO_OLD_CURE))
    return found


def _preference(text: str) -> bool | None:
    """What a file of preferences sets; None where it does not."""
    values = re.findall(rf'pref\("{re.escape(FIREFOX_PREFERENCE)}",\s*(true|false)', text)
    return values[-1] == "true" if values else None


def _chromiums(host: Host, home: Path) -> list[Browser]:
    """Each browser of Chromium's family that is installed."""
    found = []
    for name, (program, folder) in CHROMIUMS.items():
        if not (host.root / program).exists():
            continue
        version = host.tree.read(home / folder / "Last Version").split(".")[0]
        try:
            state = json.loads(host.tree.read(home / folder / "Local State") or "{}")
            experiments = state.get("browser", {}).get("enabled_labs_experiments", [])
        except (ValueError, AttributeError):  # no JSON, or of another form
            experiments = []
        found.append(
            Browser(f"{name} {version}".strip(), CHROMIUM_EXPERIMENT in experiments, f"in {name} {CHROMIUM_CURE}")
        )
    return found


def _lacks_device_access(app: str, installations: list[Path], host: Host) -> bool:
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
