"""Fixtures of the doctor's tests."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.doctor.fake_host import FakeMachine

C920 = "usb-046d_HD_Pro_Webcam_C920_2B31-video-index0"


@pytest.fixture(autouse=True)
def own_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep everything of the user's in folders of the test."""
    monkeypatch.setenv("RELIT_STORAGE__DATA_DIR", str(tmp_path / "data"))
    monkeypatch.setenv("RELIT_MODELS_DIR", str(tmp_path / "models"))
    monkeypatch.setenv("RELIT_SERVER__PORT", "0")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("RELIT_CONFIG", raising=False)
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def machine(tmp_path: Path) -> FakeMachine:
    """A machine as it should be."""
    machine = FakeMachine(tmp_path / "machine")
    machine.tree.add_webcam(2, "HD Pro Webcam C920", by_id=C920)
    machine.tree.add_loopback(10, "Relit Camera")
    machine.add_kernel(machine.host.release, with_module=True)
    machine.load_module("0.15.0")
    machine.load_at_boot()
    return machine


@pytest.fixture
def bare(tmp_path: Path) -> FakeMachine:
    """A machine with nothing of the kind."""
    return FakeMachine(tmp_path / "bare")
