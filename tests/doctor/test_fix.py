"""`relit doctor --fix`: the user's files, once; never what a person changed; lines for root."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import NoReturn

import pytest

from relit_camera.base.config.settings import OutputSettings, RelitSettings
from relit_camera.base.config.settings_loader import load_settings
from relit_camera.doctor import fix as fixing
from relit_camera.doctor.fix import apply_fixes, user_config_file
from relit_camera.doctor.kernel_module import root_commands
from relit_camera.doctor.models_and_subject import check_subject
from relit_camera.doctor.report import FileOutcome, FixedFile, FixResult, Severity
from relit_camera.doctor.run_checks import run_checks
from relit_camera.doctor.systemd_unit import check_service, is_unmodified, unit_path, unit_text
from relit_camera.subject.subject_file import write_subject
from tests.cli.relit_command import call
from tests.doctor.fake_host import RELEASE, FakeMachine, everybody_may, expect, nobody_may
from tests.generated_subject import small_subject

CAMERA = OutputSettings()


@pytest.fixture
def settings(tmp_path: Path) -> RelitSettings:
    return RelitSettings(storage={"data_dir": tmp_path / "data"})


def states(done: FixResult) -> dict[str, FileOutcome]:
    return {Path(file.path).name: file.state for file in done.files}


def everything(folder: Path) -> dict[Path, str | None]:
    return {path: path.read_text() if path.is_file() else None for path in folder.rglob("*")}


# The user's own files.


def test_what_is_missing_is_written_and_the_second_time_nothing(
    machine: FakeMachine, settings: RelitSettings, tmp_path: Path
) -> None:
    first = apply_fixes(settings, machine.host, everybody_may)
    assert set(states(first)) == {
        "subjects", "environments", "backgrounds", "presets", "models", "config.yaml", "relit-camera.service",
    }  # fmt: skip
    assert set(states(first).values()) == {FileOutcome.WRITTEN}
    assert all(Path(file.path).exists() for file in first.files)
    before = everything(tmp_path)
    second = apply_fixes(settings, machine.host, everybody_may)
    assert set(states(second).values()) == {FileOutcome.UNCHANGED}
    assert everything(tmp_path) == before


def test_the_configuration_that_it_writes_is_right_and_holds_the_defaults(
    machine: FakeMachine, settings: RelitSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    apply_fixes(settings, machine.host, everybody_may)
    monkeypatch.delenv("RELIT_STORAGE__DATA_DIR")
    monkeypatch.delenv("RELIT_SERVER__PORT")
    assert load_settings(user_config_file()).model_dump() == RelitSettings().model_dump()


def test_a_configuration_of_the_users_own_stays(machine: FakeMachine, settings: RelitSettings) -> None:
    user_config_file().parent.mkdir(parents=True)
    user_config_file().write_text("subject: me\n")
    assert states(apply_fixes(settings, machine.host, everybody_may))["config.yaml"] is FileOutcome.UNCHANGED
    assert user_config_file().read_text() == "subject: me\n"


def test_an_old_unit_of_ours_is_renewed(machine: FakeMachine, settings: RelitSettings) -> None:
    unit_path().parent.mkdir(parents=True)
    unit_path().write_text(unit_text(Path("/old/place/relit")))
    expect(check_service(machine.host), Severity.WARNING, "another installation", "--fix")
    assert states(apply_fixes(settings, machine.host, everybody_may))["relit-camera.service"] is FileOutcome.RENEWED
    assert "/old/place" not in unit_path().read_text()
    expect(check_service(machine.host), Severity.OK, str(unit_path()))


def test_a_unit_that_a_person_changed_is_kept_and_the_difference_shown(
    machine: FakeMachine, settings: RelitSettings
) -> None:
    apply_fixes(settings, machine.host, everybody_may)
    mine = unit_path().read_text().replace("WatchdogSec=30", "WatchdogSec=90")
    unit_path().write_text(mine)
    done = apply_fixes(settings, machine.host, everybody_may)
    assert states(done)["relit-camera.service"] is FileOutcome.KEPT
    assert unit_path().read_text() == mine
    note = next(file.note for file in done.files if file.state is FileOutcome.KEPT)
    assert "-WatchdogSec=90" in note
    assert "+WatchdogSec=30" in note
    expect(check_service(machine.host), Severity.OK, "changed or written by you")


def unit_after_fix(settings: RelitSettings, machine: FakeMachine) -> FixedFile:
    return next(f for f in apply_fixes(settings, machine.host, everybody_may).files if f.path == str(unit_path()))


def test_a_folder_in_the_units_place_is_said(machine: FakeMachine, settings: RelitSettings) -> None:
    unit_path().mkdir(parents=True)
    found = unit_after_fix(settings, machine)
    assert found.state is FileOutcome.FAILED
    assert "Is a directory" in found.note
    expect(check_service(machine.host), Severity.WARNING, "cannot be read: Is a directory", "move it away")


def test_a_unit_that_cannot_be_read_is_said(
    machine: FakeMachine, settings: RelitSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    apply_fixes(settings, machine.host, everybody_may)

    def refuse(path: Path, *_: object, **__: object) -> NoReturn:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "read_text", refuse)
    found = unit_after_fix(settings, machine)
    assert found.state is FileOutcome.FAILED
    assert "Permission denied" in found.note


def test_a_unit_that_is_no_text_is_the_users_own(machine: FakeMachine, settings: RelitSettings) -> None:
    unit_path().parent.mkdir(parents=True)
    unit_path().write_bytes(b"\xff\xfe[Unit]")
    assert unit_after_fix(settings, machine).state is FileOutcome.KEPT
    expect(check_service(machine.host), Severity.OK, "changed or written by you")


def test_links_that_lead_nowhere_are_the_users_own(
    machine: FakeMachine, settings: RelitSettings, tmp_path: Path
) -> None:
    for path in (unit_path(), user_config_file()):
        path.parent.mkdir(parents=True)
        path.symlink_to(tmp_path / "away")
    done = apply_fixes(settings, machine.host, everybody_may)
    assert states(done)["config.yaml"] is FileOutcome.UNCHANGED
    assert states(done)["relit-camera.service"] is FileOutcome.KEPT
    assert "away" in unit_after_fix(settings, machine).note
    assert unit_path().is_symlink()
    assert user_config_file().is_symlink()
    assert not (tmp_path / "away").exists()


def test_with_a_faulty_configuration_no_folders_are_made(machine: FakeMachine, tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("look: [")
    before = {each for each in tmp_path.rglob("*") if each.is_dir()}
    report = run_checks(path, machine.host, everybody_may, with_fix=True)
    assert report.fix is not None
    assert set(states(report.fix)) == {"config.yaml", "relit-camera.service"}
    made = {each for each in tmp_path.rglob("*") if each.is_dir()} - before
    assert made <= {*user_config_file().parents, *unit_path().parents}


def test_what_cannot_be_written_is_said_and_the_rest_goes_on(
    machine: FakeMachine, settings: RelitSettings, tmp_path: Path
) -> None:
    (tmp_path / "config").write_text("a file where the folder should be")
    found = states(apply_fixes(settings, machine.host, everybody_may))
    assert found["config.yaml"] is found["relit-camera.service"] is FileOutcome.FAILED
    assert found["subjects"] is FileOutcome.WRITTEN


def test_elsewhere_there_is_no_unit(settings: RelitSettings, tmp_path: Path) -> None:
    done = apply_fixes(settings, FakeMachine(tmp_path / "mac", is_linux=False).host, everybody_may)
    assert "relit-camera.service" not in states(done)
    assert done.root_commands == ()
    assert done.user_commands == ("relit models pull",)


def test_models_are_offered_not_pulled(
    machine: FakeMachine, settings: RelitSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    done = apply_fixes(settings, machine.host, everybody_may)
    assert done.user_commands == (
        "relit models pull",
        "systemctl --user daemon-reload && systemctl --user enable --now relit-camera",
    )
    assert list(Path(next(file.path for file in done.files if file.path.endswith("models"))).iterdir()) == []


# The lines for root.


def test_a_machine_as_it_should_be_needs_none(machine: FakeMachine) -> None:
    assert root_commands(CAMERA, machine.host) == ()


def test_a_bare_machine_needs_four(bare: FakeMachine) -> None:
    lines = root_commands(CAMERA, bare.host, ("video",))
    assert len(lines) == 5
    assert lines[0].startswith("sudo apt install v4l2loopback-dkms")
    assert lines[1].endswith("| sudo tee /etc/modprobe.d/relit-camera.conf")
    assert lines[2] == "echo v4l2loopback | sudo tee /etc/modules-load.d/relit-camera.conf"
    assert lines[3] == "sudo modprobe v4l2loopback"
    assert lines[4].startswith('sudo usermod -aG video "$USER"')


def test_the_lines_do_what_they_say(bare: FakeMachine) -> None:
    """Run by a shell with `sudo tee` writing into the made-up machine, they leave nothing to write."""
    (bare.root / "etc/modprobe.d").mkdir(parents=True)
    (bare.root / "etc/modules-load.d").mkdir(parents=True)
    for label in ("Relit Camera", "Anna's Camera"):
        settings = OutputSettings(label=label)
        for line in root_commands(settings, bare.host):
            if "tee" in line:
                subprocess.run(
                    line.replace("sudo tee /", f"tee {bare.root}/"), shell=True, check=True, stdout=subprocess.DEVNULL
                )
        written = (bare.root / "etc/modprobe.d/relit-camera.conf").read_text()
        assert written == f'options v4l2loopback devices=1 video_nr=10 exclusive_caps=1 card_label="{label}"\n'
        assert not any("tee" in line for line in root_commands(settings, bare.host))


def test_loaded_without_our_device_it_is_loaded_anew(bare: FakeMachine) -> None:
    bare.add_kernel(RELEASE, with_module=True)
    bare.load_module("0.15.0")
    bare.tree.add_loopback(0, "Dummy video device (0x0000)")
    lines = root_commands(CAMERA, bare.host)
    assert not any("install" in line for line in lines)
    assert lines[-1] == "sudo modprobe -r v4l2loopback && sudo modprobe v4l2loopback"


def test_another_programs_options_are_left_to_the_person(bare: FakeMachine) -> None:
    bare.load_at_boot("OBS Virtual Camera", "obs.conf")
    lines = root_commands(CAMERA, bare.host)
    assert not any("tee /etc/modprobe.d" in line for line in lines)
    assert any(line.startswith("# ") and "obs.conf" in line for line in lines)


def test_groups_are_those_of_the_nodes(machine: FakeMachine, settings: RelitSettings) -> None:
    lines = apply_fixes(settings, machine.host, nobody_may).root_commands
    assert [line for line in lines if "usermod" in line]
    no_camera = RelitSettings(output={"sink": "null"}, storage=settings.storage.model_dump())
    assert apply_fixes(no_camera, machine.host, nobody_may).root_commands == ()


# The unit.


def test_a_stamp_tells_a_changed_unit() -> None:
    text = unit_text(Path("/home/me/.local/bin/relit"))
    assert is_unmodified(text)
    assert not is_unmodified(text.replace("RestartSec=2", "RestartSec=4"))
    assert not is_unmodified("[Unit]\n")
    assert not is_unmodified("")


def test_systemd_never_gives_up_starting_it() -> None:
    unit, service = unit_text(Path("/usr/bin/relit")).split("[Service]")
    assert "StartLimitIntervalSec=0\n" in unit
    assert "Burst" not in unit
    assert "Restart=on-failure\nRestartSec=2\nKillMode=process\n" in service


def test_odd_paths_are_quoted_for_systemd() -> None:
    assert 'ExecStart="/home/a b/100%%/relit" run' in unit_text(Path("/home/a b/100%/relit"))


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd-analyze here")
def test_systemd_finds_no_fault_with_the_unit(tmp_path: Path) -> None:
    command = tmp_path / "a folder" / "relit"
    command.parent.mkdir()
    command.write_text("#!/bin/sh\n")
    command.chmod(0o755)
    text = unit_text(command)

    def complaints(text: str) -> list[str]:
        unit = tmp_path / "relit-camera.service"
        unit.write_text(text)
        done = subprocess.run(
            ["systemd-analyze", "verify", "--user", str(unit)],
            env={**os.environ, "XDG_RUNTIME_DIR": str(tmp_path)},
            capture_output=True, text=True, check=True, timeout=60,
        )  # fmt: skip
        return [line for line in done.stderr.splitlines() if unit.name in line]

    assert complaints(text) == []
    assert len(complaints(text.replace("WatchdogSec", "WatchdogSc"))) == 1


# The subject, and the command.


def test_the_subject_is_looked_at(settings: RelitSettings, tmp_path: Path) -> None:
    expect(check_subject(settings), Severity.WARNING, "lit as an average head would be", "relit capture build")
    hidden = settings.model_copy(update={"subject": None})
    expect(check_subject(hidden), Severity.WARNING, "a placeholder is shown", "relit capture build")
    settings.storage.subjects.mkdir(parents=True)
    write_subject(settings.storage.subjects / "me.relit", small_subject())
    expect(check_subject(settings), Severity.WARNING, "stored are: me")
    expect(check_subject(settings.model_copy(update={"subject": "me"})), Severity.OK, "me, 64x80")
    expect(
        check_subject(settings.model_copy(update={"subject": "you"})),
        Severity.PROBLEM,
        "no subject 'you'",
        "there are: me",
    )
    (tmp_path / "half.relit").write_bytes(b"half")
    broken = settings.model_copy(update={"subject": str(tmp_path / "half.relit")})
    expect(check_subject(broken), Severity.PROBLEM, "half.relit")


def test_the_command_fixes_and_says_so_in_text_and_json(monkeypatch: pytest.MonkeyPatch, machine: FakeMachine) -> None:
    monkeypatch.setattr("relit_camera.doctor.run_checks.Host", lambda: machine.host)
    text = call("doctor", "--fix").out
    assert "written    " in text
    assert str(unit_path()) in text
    assert "As yourself, if you want to:\n    relit models pull" in text
    answer = json.loads(call("doctor", "--fix", "--json").out)
    assert {file["state"] for file in answer["fix"]["files"]} == {"unchanged"}
    assert json.loads(call("doctor", "--json").out)["fix"] is None


def test_without_fix_nothing_is_written(machine: FakeMachine, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("relit_camera.doctor.run_checks.Host", lambda: machine.host)
    monkeypatch.setattr(fixing, "apply_fixes", lambda *_: pytest.fail("not asked for"))
    before = everything(tmp_path)
    call("doctor")
    assert everything(tmp_path) == before
