"""What only root may do, as lines to paste: the doctor itself never asks for a password."""

from __future__ import annotations

import shlex

from relit_camera.config.settings import OutputSettings
from relit_camera.doctor.host import MODULE, Host
from relit_camera.stream.devices import list_virtual_cameras, module_options

MODULE_OPTIONS_FILE = "etc/modprobe.d/relit-camera.conf"
MODULES_LOAD_FILE = "etc/modules-load.d/relit-camera.conf"
LOAD_AT_BOOT = f"echo {MODULE} | sudo tee /{MODULES_LOAD_FILE}"
LOAD = f"sudo modprobe {MODULE}"
RELOAD = f"sudo modprobe -r {MODULE} && {LOAD}"
ENROLL_KEY = "sudo mokutil --import /var/lib/dkms/mok.pub, restart, and confirm the key at the blue screen"

RPM_FUSION = "https://mirrors.rpmfusion.org/free/fedora/rpmfusion-free-release-$(rpm -E %fedora).noarch.rpm"
INSTALL = {
    "debian": ('sudo apt install v4l2loopback-dkms "linux-headers-$(uname -r)"',),
    "fedora": (
        f'sudo dnf install "{RPM_FUSION}"',
        "sudo dnf install akmod-v4l2loopback",
        "sudo akmods --force",
    ),
    "arch": ("sudo pacman -S v4l2loopback-dkms linux-headers",),
}
BUILD = {
    "debian": 'sudo apt install "linux-headers-$(uname -r)" && sudo dkms autoinstall',
    "fedora": 'sudo dnf install "kernel-devel-$(uname -r)" && sudo akmods --force',
    "arch": "sudo pacman -S linux-headers && sudo dkms autoinstall",
}


def install_commands(host: Host) -> tuple[str, ...]:
    """The lines that install the module with this distribution's packages."""
    by_hand = (
        f"# install {MODULE} 0.12.7 or newer for kernel {host.release}: https://github.com/v4l2loopback/v4l2loopback"
    )
    return INSTALL.get(host.family, (by_hand,))


def options_command(label: str) -> str:
    """The line that writes the module's options where modprobe finds them."""
    line = f"options {MODULE} {module_options(label)}"
    return f"echo {shlex.quote(line)} | sudo tee /{MODULE_OPTIONS_FILE}"


def root_commands(settings: OutputSettings, host: Host, groups: tuple[str, ...] = ()) -> tuple[str, ...]:
    """The lines that are still needed, in order; none where all is done.

    Args:
        settings: their label is the device's name.
        host: as it is now.
        groups: that this user has to join for the devices.
    """
    lines: list[str] = []
    foreign = [
        path for path in host.configured("etc/modprobe.d", f"options {MODULE}") if path.name != "relit-camera.conf"
    ]
    ours = any(camera.ours for camera in list_virtual_cameras(host.tree, settings.label))
    if not host.module_loaded and host.release not in host.kernels_with_module:
        is_there = host.kernels_with_module or host.module_built_by_dkms
        lines += [BUILD[host.family]] if is_there and host.family else install_commands(host)
    if foreign:
        lines.append(f"# {foreign[0]} sets options of {MODULE} already: add '{settings.label}' there (docs/install.md)")
    elif module_options(settings.label) not in host.read(MODULE_OPTIONS_FILE):
        lines.append(options_command(settings.label))
    if not host.configured("etc/modules-load.d", MODULE) and MODULE not in host.read("etc/modules").splitlines():
        lines.append(LOAD_AT_BOOT)
    if not ours:
        lines.append(RELOAD if host.module_loaded else LOAD)
    lines += [f'sudo usermod -aG {group} "$USER"   # then log in again' for group in groups]
    return tuple(lines)
