"""Browsers in sandboxes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from relit_camera.doctor.browsers import check_browsers
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


# Where they look for cameras.


def firefox(machine: FakeMachine, version: str, folder: str = "usr/lib/firefox-esr") -> None:
    machine.write(f"{folder}/application.ini", f"[App]\nVendor=Mozilla\nName=Firefox\nVersion={version}\n")


def prefer_pipewire(machine: FakeMachine, file: str, value: str = "true", function: str = "user_pref") -> None:
    machine.write(file, f'// comment\n{function}("media.webrtc.camera.allow-pipewire", {value});\n')


def chromium(machine: FakeMachine, home: Path, version: str = "131.0.6778.85", *experiments: str) -> None:
    machine.write("usr/bin/chromium", "")
    folder = f"{str(home).lstrip('/')}/.config/chromium"
    machine.write(f"{folder}/Last Version", version)
    machine.write(f"{folder}/Local State", json.dumps({"browser": {"enabled_labs_experiments": experiments}}))


def test_what_each_browser_reads_is_said(machine: FakeMachine, tmp_path: Path) -> None:
    firefox(machine, "128.5.0")
    chromium(machine, tmp_path)
    expect(
        check_browsers(machine.host, tmp_path), Severity.OK, "Firefox 128.5.0 reads devices, Chromium 131 reads devices"
    )


def test_where_the_camera_is_in_pipewire_alone_each_gets_its_cure(bare: FakeMachine, tmp_path: Path) -> None:
    bare.run_session()
    firefox(bare, "128.5.0")
    chromium(bare, tmp_path)
    finding = check_browsers(bare.host, tmp_path)
    expect(
        finding,
        Severity.WARNING,
        "about:config set media.webrtc.camera.allow-pipewire",
        "enable-webrtc-pipewire-camera",
    )
    assert "flatpak permissions devices camera" in finding.cure
    home = str(tmp_path).lstrip("/")
    prefer_pipewire(bare, f"{home}/.mozilla/firefox/x.default/prefs.js")
    chromium(bare, tmp_path, "131.0.6778.85", "other", "enable-webrtc-pipewire-camera@1")
    expect(
        check_browsers(bare.host, tmp_path), Severity.OK, "Firefox 128.5.0 reads PipeWire, Chromium 131 reads PipeWire"
    )


def test_a_distribution_may_set_it_and_the_user_has_the_last_word(bare: FakeMachine, tmp_path: Path) -> None:
    bare.run_session()
    firefox(bare, "133.0", "usr/lib64/firefox")
    prefer_pipewire(bare, "usr/lib64/firefox/defaults/preferences/all-redhat.js", function="pref")
    expect(check_browsers(bare.host, tmp_path), Severity.OK, "Firefox 133.0 reads PipeWire")
    prefer_pipewire(bare, f"{str(tmp_path).lstrip('/')}/.mozilla/firefox/x.default/prefs.js", "false")
    expect(check_browsers(bare.host, tmp_path), Severity.WARNING, "Firefox 133.0 reads devices")


def test_an_old_firefox_has_no_such_setting(bare: FakeMachine, tmp_path: Path) -> None:
    bare.run_session()
    firefox(bare, "115.12.0")
    prefer_pipewire(bare, f"{str(tmp_path).lstrip('/')}/.mozilla/firefox/x.default/prefs.js")
    finding = check_browsers(bare.host, tmp_path)
    expect(finding, Severity.WARNING, "Firefox 115.12.0 reads devices", "newer")
    assert "about:config" not in finding.cure


def test_one_that_looks_in_pipewire_sees_no_device(machine: FakeMachine, tmp_path: Path) -> None:
    firefox(machine, "128.5.0")
    prefer_pipewire(machine, f"{str(tmp_path).lstrip('/')}/.mozilla/firefox/x.default/prefs.js")
    expect(check_browsers(machine.host, tmp_path), Severity.WARNING, "Firefox 128.5.0 looks", "start pipewire")
    machine.run_session()
    expect(check_browsers(machine.host, tmp_path), Severity.OK)


def test_damaged_settings_are_as_none(bare: FakeMachine, tmp_path: Path) -> None:
    bare.run_session()
    chromium(bare, tmp_path)
    for text in ("{", "[]", '{"browser": 3}'):
        bare.write(f"{str(tmp_path).lstrip('/')}/.config/chromium/Local State", text)
        expect(check_browsers(bare.host, tmp_path), Severity.WARNING, "Chromium 131 reads devices")
