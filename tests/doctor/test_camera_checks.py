"""The checks as the API tells them: ids, states, and commands to copy."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from relit_camera.base.config.settings import RelitSettings, StorageSettings
from relit_camera.doctor import run_checks
from relit_camera.doctor.camera_checks import check_camera, commands_of
from relit_camera.live.status.setup_status import Check, CheckState
from tests.doctor.fake_host import FakeMachine


def checks(folder: Path, machine: FakeMachine) -> dict[str, Check]:
    settings = RelitSettings(storage=StorageSettings(data_dir=folder / "data"), server={"port": 0})
    return {check.id: check for check in check_camera(settings.model_dump(), machine.host)}


@pytest.mark.parametrize(
    ("cure", "commands"),
    [
        ("", ()),
        ("plug one in, or use --source FILE", ()),
        ("run: relit models pull", ("relit models pull",)),
        ("run `relit models pull face_mesh`", ("relit models pull face_mesh",)),
        ('run: sudo usermod -aG video "$USER", and log in again', ('sudo usermod -aG video "$USER"',)),
        ("run: sudo a && sudo b; or restart into a kernel that has it", ("sudo a && sudo b",)),
        ("on the host itself, sudo modprobe v4l2loopback", ("sudo modprobe v4l2loopback",)),
    ],
)
def test_commands_of_a_cure(cure: str, commands: tuple[str, ...]) -> None:
    assert commands_of(cure) == commands


def test_a_bare_machine_gets_every_command_from_the_package_to_the_restart(tmp_path: Path) -> None:
    found = checks(tmp_path, FakeMachine(tmp_path / "root"))
    module = found["kernel-module"]
    assert (module.state, module.title) == (CheckState.FAILED, "Kernel module")
    assert [command.split()[:3] for command in module.commands] == [
        ["sudo", "apt", "install"],
        ["echo", "'options", "v4l2loopback"],
        ["echo", "v4l2loopback", "|"],
        ["sudo", "modprobe", "v4l2loopback"],
    ]
    assert found["webcam"].state is CheckState.FAILED
    assert found["models"].commands == ("relit models pull",)
    assert len(found) == 19  # the ids are of one check each


def test_what_is_there_is_fine_and_needs_no_command(tmp_path: Path) -> None:
    machine = FakeMachine(tmp_path / "root")
    machine.tree.add_webcam(0, "Cam")
    machine.load_module("0.13.2")
    machine.load_at_boot()
    machine.tree.add_loopback(10, "Relit Camera")
    found = checks(tmp_path, machine)
    for name in ("webcam", "kernel-module", "after-a-restart", "virtual-camera"):
        assert (found[name].state, found[name].commands) == (CheckState.OK, ()), found[name]


def test_ids_are_for_programs(tmp_path: Path) -> None:
    for name, check in checks(tmp_path, FakeMachine(tmp_path / "root")).items():
        assert re.fullmatch(r"[a-z]+(-[a-z]+)*", name)
        assert check.title[0].isupper()


def test_a_check_that_fails_itself_hides_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr(run_checks, "check_webcam", fail)
    found = checks(tmp_path, FakeMachine(tmp_path / "root"))
    assert found["check"].state is CheckState.UNKNOWN
    assert "kernel-module" in found


def test_the_camera_loads_nothing_of_the_doctor_before_it_is_asked() -> None:
    code = "import sys, relit_camera.doctor.camera_checks; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout.split()
    assert "relit_camera.doctor.run_checks" not in loaded
    assert "psutil" not in loaded
