"""Browsers in sandboxes."""

from __future__ import annotations

from pathlib import Path

import pytest

from relit_camera.doctor.camera_access import check_browsers
from relit_camera.doctor.report import Severity
from tests.doctor.fake_host import FakeMachine, expect

CHROME = "com.google.Chrome"
METADATA = "app/{}/current/active/metadata"


def flatpak(machine: FakeMachine, app: str, devices: str, folder: str = "var/lib/flatpak") -> None:
    machine.write(f"{folder}/{METADATA.format(app)}", f"[Application]\nname={app}\n\n[Context]\ndevices={devices}\n")


def test_none_is_fine(machine: FakeMachine, tmp_path: Path) -> None:
    expect(check_browsers(machine.host, tmp_path), Severity.OK, "none in a sandbox")


def test_a_flatpak_with_all_devices_is_fine_and_one_without_is_named(machine: FakeMachine, tmp_path: Path) -> None:
    flatpak(machine, "org.mozilla.firefox", "dri;all;")
    expect(check_browsers(machine.host, tmp_path), Severity.OK)
    flatpak(machine, CHROME, "dri;")
    finding = check_browsers(machine.host, tmp_path)
    expect(finding, Severity.WARNING, f"flatpak override --user --device=all {CHROME}")
    assert "firefox" not in finding.seen


@pytest.mark.parametrize("name", [CHROME, "global"])
def test_an_override_opens_it(machine: FakeMachine, tmp_path: Path, name: str) -> None:
    home = machine.root / "home/me"
    flatpak(machine, CHROME, "dri;", "home/me/.local/share/flatpak")
    home = home.relative_to(machine.root)
    expect(check_browsers(machine.host, home), Severity.WARNING, CHROME)
    machine.write(f"home/me/.local/share/flatpak/overrides/{name}", "[Context]\ndevices=all;\n")
    expect(check_browsers(machine.host, home), Severity.OK)


def test_a_damaged_file_is_as_none(machine: FakeMachine, tmp_path: Path) -> None:
    machine.write(f"var/lib/flatpak/{METADATA.format(CHROME)}", "][")
    expect(check_browsers(machine.host, tmp_path), Severity.WARNING, CHROME)


def test_snaps_are_a_hint(machine: FakeMachine, tmp_path: Path) -> None:
    (machine.root / "snap/chromium").mkdir(parents=True)
    expect(check_browsers(machine.host, tmp_path), Severity.OK, "sudo snap connect chromium:camera")
