"""Browsers in sandboxes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from relit_camera.doctor.readers.browsers import check_browsers
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


def test_an_override_closes_it(machine: FakeMachine, tmp_path: Path) -> None:
    home, overrides = Path("home/me"), "home/me/.local/share/flatpak/overrides"
    flatpak(machine, CHROME, "all;")
    machine.write(f"{overrides}/{CHROME}", "[Context]\ndevices=!all;dri;\n")
    expect(check_browsers(machine.host, home), Severity.WARNING, CHROME)
    # The user's have the last word, and those of an app before those of all.
    machine.write(f"var/lib/flatpak/overrides/{CHROME}", "[Context]\ndevices=all;\n")
    machine.write(f"{overrides}/global", "[Context]\ndevices=all;\n")
    expect(check_browsers(machine.host, home), Severity.WARNING, CHROME)
    machine.write(f"{overrides}/{CHROME}", "[Context]\ndevices=dri;\n")
    machine.write(f"{overrides}/global", "[Context]\ndevices=!all;\n")
    expect(check_browsers(machine.host, home), Severity.WARNING, CHROME)
    machine.write(f"{overrides}/{CHROME}", "[Context]\ndevices=all;\n")
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


# Profiles and sandboxes.


def test_each_profile_of_firefox_is_named(bare: FakeMachine, tmp_path: Path) -> None:
    bare.run_session()
    firefox(bare, "140.1.0")
    home = str(tmp_path).lstrip("/")
    prefer_pipewire(bare, f"{home}/.mozilla/firefox/x1.default-esr/prefs.js")
    bare.write(f"{home}/.mozilla/firefox/x2.work/prefs.js", 'user_pref("other", 1);\n')
    finding = check_browsers(bare.host, tmp_path)
    expect(
        finding,
        Severity.WARNING,
        "Firefox 140.1.0, profile default-esr reads PipeWire, Firefox 140.1.0, profile work reads devices",
        "in Firefox, profile work's about:config",
    )
    assert "default-esr" not in finding.cure
    prefer_pipewire(bare, f"{home}/.mozilla/firefox/x2.work/user.js")
    expect(check_browsers(bare.host, tmp_path), Severity.OK, "profile work reads PipeWire")


def test_profiles_of_the_same_name_are_told_apart(bare: FakeMachine, tmp_path: Path) -> None:
    bare.run_session()
    firefox(bare, "140.1.0")
    folder = f"{str(tmp_path).lstrip('/')}/.mozilla/firefox"
    bare.write(f"{folder}/a1.default-release/prefs.js", "")
    prefer_pipewire(bare, f"{folder}/b2.default-release/prefs.js")
    prefer_pipewire(bare, f"{folder}/c3.work/prefs.js")
    expect(
        check_browsers(bare.host, tmp_path),
        Severity.WARNING,
        "profile a1.default-release reads devices",
        "profile b2.default-release reads PipeWire",
        "profile work reads PipeWire",
        "in Firefox, profile a1.default-release's about:config",
    )


def test_sandboxed_browsers_have_settings_of_their_own(bare: FakeMachine, tmp_path: Path) -> None:
    bare.run_session()
    home = str(tmp_path).lstrip("/")
    firefox(bare, "140.1.0")
    prefer_pipewire(bare, f"{home}/.mozilla/firefox/x.default/prefs.js")
    flatpak(bare, "org.mozilla.firefox", "dri;")
    firefox(bare, "141.0", "var/lib/flatpak/app/org.mozilla.firefox/current/active/files/lib/firefox")
    firefox(bare, "142.0", "snap/firefox/current/usr/lib/firefox")
    flatpak(bare, CHROME, "dri;")
    finding = check_browsers(bare.host, tmp_path)
    expect(
        finding,
        Severity.WARNING,
        "Firefox 140.1.0 reads PipeWire",
        "Firefox (Snap) 142.0 reads devices",
        "Firefox (Flatpak) 141.0 reads devices",
        "Chrome (Flatpak) reads devices",
        "in Chrome (Flatpak) set chrome://flags",
    )
    prefer_pipewire(bare, f"{home}/snap/firefox/common/.mozilla/firefox/x.default/prefs.js")
    prefer_pipewire(bare, f"{home}/.var/app/org.mozilla.firefox/.mozilla/firefox/x.default/prefs.js")
    bare.write(
        f"{home}/.var/app/{CHROME}/config/google-chrome/Local State",
        json.dumps({"browser": {"enabled_labs_experiments": ["enable-webrtc-pipewire-camera@1"]}}),
    )
    expect(check_browsers(bare.host, tmp_path), Severity.OK, "Firefox (Flatpak) 141.0 reads PipeWire")
