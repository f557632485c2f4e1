"""Where the kernel module is missing: at each step its own finding and cure."""

from __future__ import annotations

from pathlib import Path

import pytest

from relit_camera.base.config.settings import OutputSettings
from relit_camera.doctor.kernel_module import check_load_at_boot, check_module
from relit_camera.doctor.report import Severity
from tests.doctor.fake_host import RELEASE, FakeMachine, expect

CAMERA = OutputSettings()


def test_a_loaded_module_is_fine_with_its_version(machine: FakeMachine) -> None:
    expect(check_module(CAMERA, machine.host), Severity.OK, "0.15.0", RELEASE)


def test_the_version_that_does_not_tell_is_debian_12s(bare: FakeMachine) -> None:
    bare.load_module()
    expect(check_module(CAMERA, bare.host), Severity.OK, "0.12 or older")


@pytest.mark.parametrize(
    ("distribution", "command"),
    [
        ("debian", 'sudo apt install v4l2loopback-dkms "linux-headers-$(uname -r)"'),
        ("ubuntu", "sudo apt install v4l2loopback-dkms"),
        ("fedora", "sudo dnf install akmod-v4l2loopback"),
        ("nobara", "rpmfusion-free-release"),
        ("arch", "sudo pacman -S v4l2loopback-dkms linux-headers"),
        ("nixos", "github.com/v4l2loopback"),
    ],
)
def test_each_distribution_has_its_own_line(tmp_path: Path, distribution: str, command: str) -> None:
    machine = FakeMachine(tmp_path, distribution)
    expect(check_module(CAMERA, machine.host), Severity.PROBLEM, "is not installed", command)


def test_installed_but_not_loaded(bare: FakeMachine) -> None:
    bare.add_kernel(RELEASE, with_module=True)
    finding = check_module(CAMERA, bare.host)
    expect(finding, Severity.PROBLEM, "not loaded", "sudo modprobe v4l2loopback", 'card_label="Relit Camera"')
    assert "Secure Boot" not in finding.seen


@pytest.mark.parametrize("on", [True, False])
def test_secure_boot_is_told_from_the_firmware(bare: FakeMachine, on: bool) -> None:
    bare.add_kernel(RELEASE, with_module=True)
    bare.set_secure_boot(on)
    finding = check_module(CAMERA, bare.host)
    assert ("Secure Boot is on" in finding.seen) is on
    assert ("mokutil --import" in finding.cure) is on


def test_installed_for_another_kernel(bare: FakeMachine) -> None:
    bare.add_kernel("6.1.0-40-amd64", with_module=True)
    finding = check_module(CAMERA, bare.host)
    expect(finding, Severity.PROBLEM, "not built for", RELEASE, "6.1.0-40-amd64", "linux-headers", "dkms autoinstall")


def test_source_without_a_build(bare: FakeMachine) -> None:
    bare.write("var/lib/dkms/v4l2loopback/0.12.7/source", "")
    expect(check_module(CAMERA, bare.host), Severity.PROBLEM, "not built for", "dkms autoinstall")


def test_a_container_is_told_from_a_bare_machine(tmp_path: Path) -> None:
    machine = FakeMachine(tmp_path)
    (tmp_path / f"lib/modules/{RELEASE}/modules.dep").unlink()
    (tmp_path / f"lib/modules/{RELEASE}").rmdir()
    expect(check_module(CAMERA, machine.host), Severity.PROBLEM, "a container", "on the host")


def test_nothing_is_needed_for_a_file_or_elsewhere(bare: FakeMachine, tmp_path: Path) -> None:
    other = FakeMachine(tmp_path / "mac", is_linux=False)
    for settings, host in ((OutputSettings(sink="null"), bare.host), (CAMERA, other.host)):
        expect(check_module(settings, host), Severity.OK, "not needed")
        expect(check_load_at_boot(settings, host), Severity.OK)


# After a restart.


def test_the_two_files_make_it_come_back(machine: FakeMachine) -> None:
    expect(check_load_at_boot(CAMERA, machine.host), Severity.OK, "relit-camera.conf")


def test_no_options_no_camera_after_a_restart(bare: FakeMachine) -> None:
    expect(
        check_load_at_boot(CAMERA, bare.host), Severity.WARNING, "sudo tee /etc/modprobe.d/relit-camera.conf", "options"
    )


def test_options_alone_do_not_load_it(bare: FakeMachine) -> None:
    bare.load_at_boot()
    (bare.root / "etc/modules-load.d/relit-camera.conf").unlink()
    expect(
        check_load_at_boot(CAMERA, bare.host), Severity.WARNING, "not loaded at boot", "sudo tee /etc/modules-load.d"
    )
    bare.write("etc/modules", "# old way\nv4l2loopback\n")
    expect(check_load_at_boot(CAMERA, bare.host), Severity.OK)


def test_a_commented_line_does_not_count(bare: FakeMachine) -> None:
    bare.write("etc/modprobe.d/relit-camera.conf", "# options v4l2loopback devices=1\n")
    expect(check_load_at_boot(CAMERA, bare.host), Severity.WARNING, "no options")


def test_another_programs_options_are_not_overwritten(bare: FakeMachine) -> None:
    bare.load_at_boot("OBS Virtual Camera", "obs.conf")
    expect(check_load_at_boot(CAMERA, bare.host), Severity.WARNING, "obs.conf", "'Relit Camera'")
    bare.load_at_boot()
    expect(check_load_at_boot(CAMERA, bare.host), Severity.WARNING, "both set options", "devices=2")
