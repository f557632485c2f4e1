"""What the doctor sees of webcam and virtual camera."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from relit_camera.base.config.settings import OutputSettings, SourceSettings
from relit_camera.base.plugin_groups import PluginGroup
from relit_camera.doctor.camera_access import check_pipewire, check_virtual_camera, check_webcam, groups_to_join
from relit_camera.doctor.kernel_module import check_load_at_boot, check_module
from relit_camera.doctor.report import Severity
from tests.doctor.conftest import C920
from tests.doctor.fake_host import FIREFOX, RELIT, FakeMachine, everybody_may, expect, nobody_may

# The virtual camera.


def test_a_virtual_camera_as_it_should_be(machine: FakeMachine) -> None:
    expect(check_virtual_camera(OutputSettings(), machine.host, everybody_may), Severity.OK, "Relit Camera", "video10")


def test_without_the_module_the_cure_loads_it(bare: FakeMachine) -> None:
    finding = check_virtual_camera(OutputSettings(), bare.host, everybody_may)
    expect(finding, Severity.PROBLEM, "not loaded", "sudo modprobe v4l2loopback", 'card_label="Relit Camera"')


def test_another_label_is_named(machine: FakeMachine) -> None:
    finding = check_virtual_camera(OutputSettings(label="Studio"), machine.host, everybody_may)
    expect(finding, Severity.PROBLEM, "'Studio'", "there are 'Relit Camera'", 'card_label="Studio"')


def test_without_exclusive_caps_browsers_do_not_list_it(machine: FakeMachine) -> None:
    machine.load_module(exclusive_caps="N,N,N,N,N,N,N,N")
    finding = check_virtual_camera(OutputSettings(), machine.host, everybody_may)
    expect(finding, Severity.WARNING, "Chrome", "modprobe -r v4l2loopback", "exclusive_caps=1")


def test_exclusive_caps_count_for_each_device(machine: FakeMachine) -> None:
    machine.tree.add_loopback(9, "OBS Virtual Camera")
    machine.load_module(exclusive_caps="Y,N,N,N,N,N,N,N")  # ours is the second now
    expect(check_virtual_camera(OutputSettings(), machine.host, everybody_may), Severity.WARNING, "exclusive_caps")
    machine.load_module(exclusive_caps="N,Y,N,N,N,N,N,N")
    expect(check_virtual_camera(OutputSettings(), machine.host, everybody_may), Severity.OK)


def test_who_may_use_the_node_is_said(machine: FakeMachine) -> None:
    expect(
        check_virtual_camera(OutputSettings(), machine.host, nobody_may),
        Severity.PROBLEM,
        "group",
        "usermod -aG",
        "log in again",
    )


def test_no_virtual_camera_is_needed_for_a_file(bare: FakeMachine) -> None:
    for sink in ("null", "out.mp4"):
        finding = check_virtual_camera(OutputSettings(sink=sink), bare.host, nobody_may)
        expect(finding, Severity.OK, "not needed", sink)


def test_a_node_given_as_sink_is_examined(machine: FakeMachine) -> None:
    node = machine.tree.add_loopback(11, "Spare", size=(1280, 720))
    machine.load_module(exclusive_caps="Y,Y")
    finding = check_virtual_camera(OutputSettings(sink=node), machine.host, everybody_may)
    expect(finding, Severity.OK, "Spare", "video11", "in use at 1280x720")


def test_a_node_that_is_no_virtual_camera_is_a_problem_though_there_is_one(
    machine: FakeMachine, tmp_path: Path
) -> None:
    node = str(machine.tree.dev / "video97")
    finding = check_virtual_camera(OutputSettings(sink=node), machine.host, everybody_may)
    expect(finding, Severity.PROBLEM, "video97 is no virtual camera", "choose one of", "'Relit Camera'")
    bare = FakeMachine(tmp_path / "another")
    finding = check_virtual_camera(OutputSettings(sink=str(bare.tree.dev / "video97")), bare.host, everybody_may)
    expect(finding, Severity.PROBLEM, "modprobe")


# The webcam.


def test_a_webcam_is_named_with_its_node(machine: FakeMachine) -> None:
    expect(check_webcam(SourceSettings(), machine.host, everybody_may), Severity.OK, "HD Pro Webcam C920", "video2")


def test_no_webcam_and_an_unknown_one_are_problems(machine: FakeMachine, bare: FakeMachine) -> None:
    expect(check_webcam(SourceSettings(), bare.host, everybody_may), Severity.PROBLEM, "no webcam", "--source FILE")
    expect(
        check_webcam(SourceSettings(source="usb-other"), machine.host, everybody_may),
        Severity.PROBLEM,
        "usb-other",
        C920,
    )


def test_our_own_camera_is_no_webcam_whatever_it_is_called(machine: FakeMachine) -> None:
    machine.tree.add_loopback(12, "Studio")
    source = SourceSettings(source="Studio")
    expect(check_webcam(source, machine.host, everybody_may), Severity.OK, "video12")
    finding = check_webcam(source, machine.host, everybody_may, "Studio")
    expect(finding, Severity.PROBLEM, "film itself")


def test_who_may_read_the_webcam_is_said(machine: FakeMachine) -> None:
    expect(
        check_webcam(SourceSettings(), machine.host, nobody_may),
        Severity.PROBLEM,
        "only be read by group",
        "usermod -aG",
    )


def test_no_webcam_is_needed_for_a_file_or_the_pattern(bare: FakeMachine, tmp_path: Path) -> None:
    clip = tmp_path / "clip.mp4"
    clip.touch()
    for source in (str(clip), "pattern"):
        finding = check_webcam(SourceSettings(source=source), bare.host, nobody_may)
        expect(finding, Severity.OK, "not needed", source)


# Who has them open, and who may.


def test_a_webcam_that_another_program_has_open_is_named_with_it(machine: FakeMachine) -> None:
    node = str(machine.tree.dev / "video2")
    machine.open_by(node, FIREFOX)
    finding = check_webcam(SourceSettings(), machine.host, everybody_may)
    expect(finding, Severity.WARNING, node, "firefox (process 30)", "close it")
    machine.open_by(node, RELIT)
    expect(check_webcam(SourceSettings(), machine.host, everybody_may), Severity.OK, "read by relit (process 40)")


def test_who_has_the_virtual_camera_open_is_listed(machine: FakeMachine) -> None:
    machine.open_by(str(machine.tree.dev / "video10"), FIREFOX, RELIT)
    finding = check_virtual_camera(OutputSettings(), machine.host, everybody_may)
    expect(finding, Severity.OK, "opened by firefox (process 30), relit (process 40)")


def test_the_groups_to_join_are_those_of_shut_devices(machine: FakeMachine) -> None:
    assert groups_to_join(machine.tree, everybody_may) == ()
    group = (machine.tree.dev / "video2").group()
    assert groups_to_join(machine.tree, nobody_may) == (group,)


def test_another_system_has_obs_studios_camera(tmp_path: Path) -> None:
    other = FakeMachine(tmp_path / "mac", is_linux=False)
    expect(check_virtual_camera(OutputSettings(), other.host, everybody_may), Severity.OK, "install OBS Studio")


def test_a_plug_in_source_needs_no_webcam(machine: FakeMachine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(PluginGroup, "has", lambda self, text: text.startswith("example"))
    finding = check_webcam(SourceSettings(source="example:77"), machine.host)
    assert finding.state is Severity.OK
    assert "not needed: the source is 'example:77'" in finding.seen


def test_a_webcam_may_be_named_by_the_plug_in_and_its_id(machine: FakeMachine) -> None:
    named = check_webcam(SourceSettings(source="webcam:nowhere"), machine.host)
    assert "'nowhere'" in named.seen


# PipeWire.

PIPEWIRE = OutputSettings(sink="pipewire")


def test_a_session_with_its_manager_is_fine(bare: FakeMachine) -> None:
    bare.run_session()
    for settings in (OutputSettings(), PIPEWIRE):
        expect(check_pipewire(settings, bare.host), Severity.OK, "'Relit Camera' can be published at", "pipewire-0")
        expect(check_module(settings, bare.host), Severity.OK, "not needed: the camera is in PipeWire")
        expect(check_load_at_boot(settings, bare.host), Severity.OK)
    expect(check_virtual_camera(OutputSettings(), bare.host), Severity.OK, "in PipeWire, and no device")
    expect(check_virtual_camera(PIPEWIRE, bare.host), Severity.OK, "not needed")


@pytest.mark.parametrize(
    ("distribution", "command"),
    [("debian", "sudo apt install pipewire wireplumber"), ("fedora", "sudo dnf install"), ("arch", "sudo pacman -S")],
)
def test_pipewire_that_is_not_installed(tmp_path: Path, distribution: str, command: str) -> None:
    machine = FakeMachine(tmp_path, distribution)
    expect(check_pipewire(OutputSettings(), machine.host), Severity.PROBLEM, "not installed", command)
    machine.tree.add_loopback(10, "Relit Camera")
    expect(check_pipewire(OutputSettings(), machine.host), Severity.OK, "not installed", "'Relit Camera' is a device")
    expect(check_pipewire(PIPEWIRE, machine.host), Severity.PROBLEM, command)


def test_a_session_that_does_not_run(bare: FakeMachine) -> None:
    bare.run_session()
    (bare.root / "run/pipewire-0").unlink()
    finding = check_pipewire(OutputSettings(), bare.host)
    expect(finding, Severity.PROBLEM, "no session runs", "systemctl --user start pipewire wireplumber")
    expect(check_module(OutputSettings(), bare.host), Severity.PROBLEM, "not installed")
    nowhere = replace(bare.host, socket=None)
    expect(check_pipewire(PIPEWIRE, nowhere), Severity.PROBLEM, "XDG_RUNTIME_DIR is not set")


def test_a_session_without_manager_links_nobody(bare: FakeMachine) -> None:
    bare.run_session()
    bare.processes.clear()
    expect(check_pipewire(OutputSettings(), bare.host), Severity.WARNING, "without a session manager", "wireplumber")


def test_a_socket_alone_is_no_session(bare: FakeMachine) -> None:
    bare.write("run/pipewire-0", "")
    expect(check_pipewire(OutputSettings(), bare.host), Severity.PROBLEM, "not installed")
    expect(check_module(OutputSettings(), bare.host), Severity.PROBLEM, "not installed")


def test_pipewire_is_not_asked_for(bare: FakeMachine, tmp_path: Path) -> None:
    expect(check_pipewire(OutputSettings(sink="null"), bare.host), Severity.OK, "not used")
    elsewhere = FakeMachine(tmp_path / "mac", is_linux=False)
    expect(check_pipewire(OutputSettings(), elsewhere.host), Severity.OK, "not used")
