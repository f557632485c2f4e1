"""Check of call apps in sandboxes, other than browsers: what cameras each one sees."""

from __future__ import annotations

from pathlib import Path

from relit_camera.base.config.settings import OutputSettings
from relit_camera.devices.device_discovery import list_virtual_cameras
from relit_camera.doctor.host import Host
from relit_camera.doctor.kernel_module import has_session
from relit_camera.doctor.readers.sandboxes import Sandboxes, give_devices
from relit_camera.doctor.report import Finding, ok, warning

FLATPAKS = {
    "us.zoom.Zoom": "Zoom",
    "com.slack.Slack": "Slack",
    "com.discordapp.Discord": "Discord",
    "com.github.IsmaelMartinez.teams_for_linux": "Teams for Linux",
    "org.signal.Signal": "Signal",
    "org.jitsi.jitsi-meet": "Jitsi Meet",
}
"""Call apps by Flatpak's identifier. They look at devices alone: Zoom's own camera code, and Electron, whose switch for
PipeWire's cameras is off."""
SNAPS = {
    "zoom-client": "Zoom",
    "slack": "Slack",
    "discord": "Discord",
    "teams-for-linux": "Teams for Linux",
    "signal-desktop": "Signal",
}
MODULE_CURE = "they need a device: install the kernel module, as `kernel module` above and docs/install.md say"


def check_call_apps(host: Host, home: Path | None = None, settings: OutputSettings | None = None) -> Finding:
    """Check that call apps in Flatpaks and Snaps see our camera, by their own files."""
    topic, settings = "call apps", settings or OutputSettings()
    sandboxes = Sandboxes(host, home or Path.home())
    flatpaks = [app for app in FLATPAKS if sandboxes.program_of(app) is not None]
    snaps = sandboxes.snaps(SNAPS)
    names = [f"{FLATPAKS[app]} (Flatpak)" for app in flatpaks] + [f"{SNAPS[name]} (Snap)" for name in snaps]
    if not names:
        return ok(topic, "none in a sandbox")
    loopback = any(camera.ours for camera in list_virtual_cameras(host.tree, settings.label))
    if not loopback and has_session(settings, host):
        seen = f"{', '.join(names)} read devices alone, and '{settings.label}' is in PipeWire alone"
        return warning(topic, seen, MODULE_CURE)
    denied = [app for app in flatpaks if sandboxes.hides_devices(app)]
    if denied and loopback:
        seen = f"the Flatpak {', '.join(FLATPAKS[app] for app in denied)} is given no devices"
        return warning(topic, seen, give_devices(denied))
    return ok(topic, "; ".join(filter(None, (f"{', '.join(names)} read devices", sandboxes.snap_hint(snaps)))))
