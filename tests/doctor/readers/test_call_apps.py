"""Call apps in sandboxes: what each sees."""

from __future__ import annotations

from pathlib import Path

from relit_camera.doctor.readers.call_apps import check_call_apps
from relit_camera.doctor.report import Severity
from tests.doctor.fake_host import FakeMachine, expect
from tests.doctor.readers.test_browsers import flatpak

HOME = Path("/home/me")
ZOOM, SLACK = "us.zoom.Zoom", "com.slack.Slack"


def test_none_is_fine(machine: FakeMachine) -> None:
    expect(check_call_apps(machine.host, HOME), Severity.OK, "none in a sandbox")


def test_a_flatpak_that_is_given_no_devices(machine: FakeMachine) -> None:
    flatpak(machine, ZOOM, "all;")
    expect(check_call_apps(machine.host, HOME), Severity.OK, "Zoom (Flatpak) read devices")
    flatpak(machine, SLACK, "dri;", "home/me/.local/share/flatpak")
    finding = check_call_apps(machine.host, HOME)
    expect(finding, Severity.WARNING, "Slack is given no devices", f"flatpak override --user --device=all {SLACK}")
    assert ZOOM not in finding.cure
    machine.write(f"home/me/.local/share/flatpak/overrides/{SLACK}", "[Context]\ndevices=all;\n")
    expect(check_call_apps(machine.host, HOME), Severity.OK)


def test_a_snap_is_a_hint(machine: FakeMachine) -> None:
    (machine.root / "snap/zoom-client").mkdir(parents=True)
    expect(check_call_apps(machine.host, HOME), Severity.OK, "Zoom (Snap)", "sudo snap connect zoom-client:camera")


def test_where_the_camera_is_in_pipewire_alone_they_need_the_module(bare: FakeMachine) -> None:
    bare.run_session()
    flatpak(bare, ZOOM, "all;")
    (bare.root / "snap/discord").mkdir(parents=True)
    finding = check_call_apps(bare.host, HOME)
    expect(finding, Severity.WARNING, "Zoom (Flatpak), Discord (Snap) read devices alone", "kernel module")
