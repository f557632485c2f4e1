"""Check of the browsers on this machine: whether each one looks for cameras where ours is, by their own files."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path

from relit_camera.base.config.settings import OutputSettings
from relit_camera.devices.device_discovery import list_virtual_cameras
from relit_camera.doctor.host import Host
from relit_camera.doctor.kernel_module import has_session
from relit_camera.doctor.readers.sandboxes import Sandboxes, give_devices
from relit_camera.doctor.report import Finding, ok, warning

FIREFOX_PREFERENCE = "media.webrtc.camera.allow-pipewire"
"""Firefox 116 and newer look for cameras in PipeWire where it is true; else at devices. False unless somebody sets it:
Fedora does from release 41 on."""
FIREFOX_MIN_VERSION = 116
FIREFOX_PROGRAMS = ("usr/lib/firefox", "usr/lib/firefox-esr", "usr/lib64/firefox", "opt/firefox")
FIREFOX_PROFILES = (".mozilla/firefox", ".config/mozilla/firefox")
FIREFOX_SNAP = "snap/firefox/current/usr/lib/firefox"
FIREFOX_SNAP_PROFILES = ("snap/firefox/common/.mozilla/firefox",)
FIREFOX_FLATPAK = "org.mozilla.firefox"
FIREFOX_FLATPAK_PROFILES = (
    f".var/app/{FIREFOX_FLATPAK}/.mozilla/firefox",
    f".var/app/{FIREFOX_FLATPAK}/config/mozilla/firefox",
)
TOO_OLD_CURE = f"get Firefox {FIREFOX_MIN_VERSION} or newer"
FIREFOX_CURE = f"in {{}}'s about:config set {FIREFOX_PREFERENCE} to true and restart it"

CHROMIUM_EXPERIMENT = "enable-webrtc-pipewire-camera@1"
"""How Chromium notes that its flag was set to "Enabled"; off by default."""
CHROMIUM_CURE = "set chrome://flags/#enable-webrtc-pipewire-camera to Enabled and restart it"
CHROMIUMS = {
    "Chromium": ("usr/bin/chromium", ".config/chromium"),
    "Chrome": ("usr/bin/google-chrome", ".config/google-chrome"),
    "Brave": ("usr/bin/brave-browser", ".config/BraveSoftware/Brave-Browser"),
    "Edge": ("usr/bin/microsoft-edge", ".config/microsoft-edge"),
    "Chromium (Snap)": ("snap/chromium/current", "snap/chromium/common/chromium"),
}
"""Name → its program, and its folder in the user's home."""
CHROMIUM_FLATPAKS = {
    "org.chromium.Chromium": ("Chromium", "chromium"),
    "com.google.Chrome": ("Chrome", "google-chrome"),
    "com.brave.Browser": ("Brave", "BraveSoftware/Brave-Browser"),
    "com.microsoft.Edge": ("Edge", "microsoft-edge"),
}
"""Flatpak's identifier → its name, and its folder in the app's folder of settings."""
SNAP_BROWSERS = ("firefox", "chromium", "brave")
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

    Their own files are read: programs, settings of each profile and of distributions, and a Flatpak's metadata with the
    overrides of user and system. Options of a command line are not in such files.
    """
    topic, home = "browsers", home or Path.home()
    settings = settings or OutputSettings()
    loopback = any(camera.ours for camera in list_virtual_cameras(host.tree, settings.label))
    pipewire = has_session(settings, host)
    found = [*_firefoxes(host, home), *_chromiums(host, home)]
    blind = [browser for browser in found if not (pipewire if browser.reads_pipewire else loopback)]
    reads = ", ".join(f"{each.name} reads {'PipeWire' if each.reads_pipewire else 'devices'}" for each in found)
    if pipewire and (at_devices := [browser for browser in blind if not browser.reads_pipewire]):
        cures = "; ".join(dict.fromkeys(browser.cure for browser in at_devices))
        return warning(topic, f"{reads}; '{settings.label}' is in PipeWire alone", f"{cures}; {PORTAL_NOTE}")
    if loopback and (only := [browser for browser in blind if browser.reads_pipewire]):
        names = ", ".join(browser.name for browser in only)
        cure = "start PipeWire (systemctl --user start pipewire wireplumber), or let it read devices again"
        return warning(topic, f"{names} looks for cameras in PipeWire, where there is none of ours", cure)
    sandboxes = Sandboxes(host, home)
    denied = [app for app in (FIREFOX_FLATPAK, *CHROMIUM_FLATPAKS) if sandboxes.hides_devices(app)]
    if denied and loopback:
        return warning(topic, f"the Flatpak {', '.join(denied)} is given no devices", give_devices(denied))
    if hint := sandboxes.snap_hint(SNAP_BROWSERS):
        return ok(topic, f"{reads}; {hint}" if reads else hint)
    return ok(topic, reads or "none in a sandbox that hides cameras")


def _firefoxes(host: Host, home: Path) -> list[Browser]:
    """Each Firefox that is installed, once for each of its profiles."""
    user = host.root / str(home).lstrip("/")
    flatpak = Sandboxes(host, home).program_of(FIREFOX_FLATPAK)
    places: list[tuple[str, Path, tuple[str, ...]]] = [
        ("Firefox", host.root / path, FIREFOX_PROFILES) for path in FIREFOX_PROGRAMS
    ]
    places.append(("Firefox (Snap)", host.root / FIREFOX_SNAP, FIREFOX_SNAP_PROFILES))
    if flatpak is not None:
        places.append(("Firefox (Flatpak)", flatpak / "lib/firefox", FIREFOX_FLATPAK_PROFILES))
    found = []
    for name, program, folders in places:
        version = re.search(r"^Version=(\d+)([\d.]*)", host.tree.read(program / "application.ini"), re.MULTILINE)
        if version is None:
            continue
        defaults = [*program.glob("defaults/pref*/*.js"), *program.glob("browser/defaults/pref*/*.js")]
        by_default = _preference(host, defaults, False)
        profiles = sorted({file.parent for folder in folders for file in (user / folder).glob("*/prefs.js")})
        values = [_preference(host, [path / "prefs.js", path / "user.js"], by_default) for path in profiles]
        for profile, value in zip(_profile_names(profiles), values, strict=True) if profiles else [("", by_default)]:
            of_profile = f", profile {profile}" if len(profiles) > 1 else ""
            new_enough = int(version[1]) >= FIREFOX_MIN_VERSION
            cure = FIREFOX_CURE.format(f"{name}{of_profile}") if new_enough else TOO_OLD_CURE
            found.append(Browser(f"{name} {version[1]}{version[2]}{of_profile}", new_enough and value, cure))
    return found


def _profile_names(profiles: list[Path]) -> list[str]:
    """What each profile is called: what follows the dot of its folder's name, or all of that where two are alike."""
    short = [profile.name.partition(".")[2] or profile.name for profile in profiles]
    return [name if short.count(name) == 1 else path.name for name, path in zip(short, profiles, strict=True)]


def _preference(host: Host, files: list[Path], otherwise: bool) -> bool:
    """Whether Firefox looks in PipeWire by files of preferences, of which the last that says it holds."""
    pattern = rf'pref\("{re.escape(FIREFOX_PREFERENCE)}",\s*(true|false)'
    values = [value for file in files for value in re.findall(pattern, host.tree.read(file))]
    return values[-1] == "true" if values else otherwise


def _chromiums(host: Host, home: Path) -> list[Browser]:
    """Each browser of Chromium's family that is installed. Its experiments are those of all its profiles."""
    user, sandboxes = host.root / str(home).lstrip("/"), Sandboxes(host, home)
    places = [(name, user / folder) for name, (program, folder) in CHROMIUMS.items() if (host.root / program).exists()]
    places += [
        (f"{name} (Flatpak)", user / ".var/app" / app / "config" / folder)
        for app, (name, folder) in CHROMIUM_FLATPAKS.items()
        if sandboxes.program_of(app) is not None
    ]
    found = []
    for name, folder in places:
        version = host.tree.read(folder / "Last Version").split(".")[0]
        try:
            state = json.loads(host.tree.read(folder / "Local State") or "{}")
            experiments = state.get("browser", {}).get("enabled_labs_experiments", [])
        except (ValueError, AttributeError):  # no JSON, or of another form
            experiments = []
        found.append(
            Browser(f"{name} {version}".strip(), CHROMIUM_EXPERIMENT in experiments, f"in {name} {CHROMIUM_CURE}")
        )
    return found
