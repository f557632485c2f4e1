"""The desktop's camera portal: there, able to ask, and what was answered."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from relit_camera.doctor.host import data_home
from relit_camera.doctor.readers.camera_portal import ASKS, BACKENDS, PROGRAM, SERVICE, STORE, check_portal
from relit_camera.doctor.readers.permission_store import MAX_BYTES, camera_permissions, read_camera_permissions
from relit_camera.doctor.report import Severity
from tests.doctor.fake_host import FakeMachine, expect

HOME = Path("home/me")
STORED = bytes.fromhex(
    "4756617269616e740000000000000000180000005800000000000028020000000000000001000000"
    "6a7f9a7cffffffff58000000040048005c00000080000000992b947cffffffffd200000004004800"
    "d8000000340100006d61696e000000280100000000000000ee85e6f5ffffffff8000000006007600"
    "88000000d200000063616d65726100000000790079657300"
    "0401636f6d2e6578616d706c652e44656e696564006e6f0003136f72672e6d6f7a696c6c612e6669"
    "7265666f7800796573000414071f3903002876617b7361737d296170707300"
)
"""A file of xdg-permission-store's (xdg-desktop-portal 1.16.0), without its end: one is told no."""


@pytest.fixture
def desktop(bare: FakeMachine) -> FakeMachine:
    """A desktop with a portal that nobody has used."""
    bare.run_session()
    bare.write(SERVICE, "[D-BUS Service]\n")
    bare.write(f"{BACKENDS}/gtk.portal", f"[portal]\nInterfaces=org.freedesktop.impl.portal.FileChooser;{ASKS};\n")
    return bare


def store(machine: FakeMachine, data: bytes, folder: str = "home/me/.local/share") -> None:
    file = machine.root / folder / STORE
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(data)


def test_without_a_session_none_is_needed(bare: FakeMachine) -> None:
    expect(check_portal(bare.host, HOME), Severity.OK, "not needed")


def test_one_that_is_started_on_demand_and_one_that_runs(desktop: FakeMachine) -> None:
    expect(check_portal(desktop.host, HOME), Severity.OK, f"{PROGRAM} starts when", "gtk can ask you", "no program yet")
    desktop.processes |= {PROGRAM, f"{PROGRAM}-gtk"}
    expect(check_portal(desktop.host, HOME), Severity.OK, f"{PROGRAM} runs, with {PROGRAM}-gtk; gtk can ask you")


def test_a_missing_one_and_its_package(desktop: FakeMachine) -> None:
    (desktop.root / SERVICE).unlink()
    expect(check_portal(desktop.host, HOME), Severity.WARNING, "not installed", "apt install xdg-desktop-portal")


@pytest.mark.parametrize("text", ["[portal]\nInterfaces=org.freedesktop.impl.portal.ScreenCast\n", "][", ""])
def test_a_desktop_that_cannot_ask(desktop: FakeMachine, text: str) -> None:
    (desktop.root / BACKENDS / "gtk.portal").unlink()
    desktop.write(f"{BACKENDS}/wlr.portal", text)
    expect(check_portal(desktop.host, HOME), Severity.WARNING, "can ask you", "xdg-desktop-portal-gtk")


def test_who_was_told_no_and_how_to_be_asked_again(desktop: FakeMachine) -> None:
    store(desktop, STORED)
    finding = check_portal(desktop.host, HOME)
    expect(finding, Severity.WARNING, "com.example.Denied may use no camera", "DeletePermission sss devices camera com")
    assert "firefox" not in finding.seen
    desktop.write("usr/bin/flatpak", "")
    expect(
        check_portal(desktop.host, HOME),
        Severity.WARNING,
        "flatpak permission-remove devices camera com.example.Denied",
    )


def test_who_may_is_said(desktop: FakeMachine) -> None:
    store(desktop, STORED.replace(b"\0no\0", b"\0ok\0"))
    expect(check_portal(desktop.host, HOME), Severity.OK, "allowed: programs without a sandbox, org.mozilla.firefox")


def test_the_store_s_file_is_read() -> None:
    assert camera_permissions(STORED) == {"": "yes", "com.example.Denied": "no", "org.mozilla.firefox": "yes"}


def test_the_user_s_data_may_be_elsewhere(desktop: FakeMachine, monkeypatch: pytest.MonkeyPatch) -> None:
    store(desktop, STORED, "elsewhere")
    expect(check_portal(desktop.host, HOME), Severity.OK, "no program yet")
    for folder in ("elsewhere", ""):
        monkeypatch.setenv("XDG_DATA_HOME", folder)
        assert data_home() is None
    monkeypatch.setenv("XDG_DATA_HOME", "/elsewhere")
    host = replace(desktop.host, data_home=data_home())
    expect(check_portal(host, HOME), Severity.WARNING, "com.example.Denied may use no camera")


def test_a_file_that_is_too_large_is_not_read(tmp_path: Path) -> None:
    file = tmp_path / "devices"
    assert read_camera_permissions(file) == {}
    file.write_bytes(STORED)
    assert read_camera_permissions(file) == camera_permissions(STORED) != {}
    file.write_bytes(STORED + bytes(MAX_BYTES))
    assert read_camera_permissions(file) == {}


def test_damaged_files_give_known_answers_or_none() -> None:
    assert camera_permissions(b"") == {}
    assert camera_permissions(b"raVGtnai" + STORED[8:]) == {}
    for place in range(len(STORED)):
        damaged = [STORED[:place] + bytes([value]) + STORED[place + 1 :] for value in (0, 0x7F, 0xFF)]
        for data in (*damaged, STORED[:place]):
            assert set(camera_permissions(data).values()) <= {"yes", "no", "ask"}
