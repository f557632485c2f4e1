"""Checks of the kernel module v4l2loopback, and the commands for root that install, load and configure it.

The commands are printed for the user to run: the doctor itself never asks for a password.
"""

from __future__ import annotations

import os
import shlex

from relit_camera.base.config.settings import OutputSettings
from relit_camera.devices.device_discovery import list_virtual_cameras, modprobe_command, module_options
from relit_camera.devices.sinks.pipewire.pipewire_library import LIBRARY
from relit_camera.doctor.host import KERNEL_MODULE, Host
from relit_camera.doctor.report import Finding, ok, problem, warning

MODULE_OPTIONS_FILE = "etc/modprobe.d/relit-camera.conf"
MODULES_LOAD_FILE = "etc/modules-load.d/relit-camera.conf"
LOAD_AT_BOOT_COMMAND = f"echo {KERNEL_MODULE} | sudo tee /{MODULES_LOAD_FILE}"
LOAD_COMMAND = f"sudo modprobe {KERNEL_MODULE}"
RELOAD_COMMAND = f"sudo modprobe -r {KERNEL_MODULE} && {LOAD_COMMAND}"
ENROLL_KEY_STEPS = "sudo mokutil --import /var/lib/dkms/mok.pub, restart, and confirm the key at the blue screen"

RPM_FUSION_URL = "https://mirrors.rpmfusion.org/free/fedora/rpmfusion-free-release-$(rpm -E %fedora).noarch.rpm"
INSTALL_COMMANDS = {
    "debian": ('sudo apt install v4l2loopback-dkms "linux-headers-$(uname -r)"',),
    "fedora": (
        f'sudo dnf install "{RPM_FUSION_URL}"',
        "sudo dnf install akmod-v4l2loopback",
        "sudo akmods --force",
    ),
    "arch": ("sudo pacman -S v4l2loopback-dkms linux-headers",),
}
BUILD_COMMANDS = {
    "debian": 'sudo apt install "linux-headers-$(uname -r)" && sudo dkms autoinstall',
    "fedora": 'sudo dnf install "kernel-devel-$(uname -r)" && sudo akmods --force',
    "arch": "sudo pacman -S linux-headers && sudo dkms autoinstall",
}


def install_commands(host: Host) -> tuple[str, ...]:
    """The commands that install the module from this distribution's packages."""
    by_hand = f"# install {KERNEL_MODULE} 0.12.7 or newer for kernel {host.release}: https://github.com/v4l2loopback/v4l2loopback"
    return INSTALL_COMMANDS.get(host.family, (by_hand,))


def options_command(label: str) -> str:
    """The command that writes the module's options to the file where modprobe finds them."""
    line = f"options {KERNEL_MODULE} {module_options(label)}"
    return f"echo {shlex.quote(line)} | sudo tee /{MODULE_OPTIONS_FILE}"


def root_commands(settings: OutputSettings, host: Host, groups: tuple[str, ...] = ()) -> tuple[str, ...]:
    """The commands for root that are still needed, in order; none where all is done.

    Args:
        settings: their label becomes the device's name.
        host: the machine in its present state.
        groups: groups that this user has to join to use the devices.
    """
    lines: list[str] = []
    foreign = [
        path
        for path in host.configured("etc/modprobe.d", f"options {KERNEL_MODULE}")
        if path.name != "relit-camera.conf"
    ]
    ours = any(camera.ours for camera in list_virtual_cameras(host.tree, settings.label))
    if not host.module_loaded and host.release not in host.kernels_with_module:
        is_there = host.kernels_with_module or host.module_built_by_dkms
        lines += [BUILD_COMMANDS[host.family]] if is_there and host.family else install_commands(host)
    if foreign:
        lines.append(
            f"# {foreign[0]} sets options of {KERNEL_MODULE} already: add '{settings.label}' there (docs/install.md)"
        )
    elif module_options(settings.label) not in host.read(MODULE_OPTIONS_FILE):
        lines.append(options_command(settings.label))
    if (
        not host.configured("etc/modules-load.d", KERNEL_MODULE)
        and KERNEL_MODULE not in host.read("etc/modules").splitlines()
    ):
        lines.append(LOAD_AT_BOOT_COMMAND)
    if not ours:
        lines.append(RELOAD_COMMAND if host.module_loaded else LOAD_COMMAND)
    lines += [f'sudo usermod -aG {group} "$USER"   # then log in again' for group in groups]
    return tuple(lines)


def has_session(settings: OutputSettings, host: Host) -> bool:
    """Whether the camera is in a PipeWire session, or will be when it runs: then it needs no kernel module."""
    if settings.sink not in ("camera", "pipewire") or not host.is_linux or not host.can_load(LIBRARY):
        return False
    return host.socket is not None and os.path.exists(host.socket)  # noqa: PTH110 - False where the folder may not be entered


def needs_module(settings: OutputSettings, host: Host) -> bool:
    """Whether the sink in the settings is a virtual camera that only the kernel module can provide, or does."""
    if settings.sink == "camera":
        return host.is_linux and (host.module_loaded or not has_session(settings, host))
    return host.is_linux and settings.sink.startswith(str(host.tree.dev / "video"))


def check_module(settings: OutputSettings, host: Host) -> Finding:
    """Check that the running kernel has loaded the module, and if not, which step of its installation is missing."""
    topic = "kernel module"
    if not needs_module(settings, host):
        through = ": the camera is in PipeWire (only programs that do not read that need it)"
        return ok(topic, f"not needed{through if has_session(settings, host) else ''}")
    if host.module_loaded:
        return ok(topic, f"{KERNEL_MODULE} {host.module_version or '0.12 or older'} is loaded in {host.release}")
    having = host.kernels_with_module
    if host.release in having:
        seen, cure = (
            f"{KERNEL_MODULE} is installed for {host.release} but not loaded",
            f"run: {modprobe_command(settings.label)}",
        )
        if host.secure_boot:
            seen += "; Secure Boot is on and refuses it unless it is signed ('Key was rejected by service')"
            cure += f"; if it is refused: {ENROLL_KEY_STEPS}"
        return problem(topic, seen, cure)
    if not (host.root / "lib/modules" / host.release).is_dir():
        cure = f"on the host itself, {modprobe_command(settings.label)}"
        return problem(
            topic, f"{KERNEL_MODULE} is not loaded, and {host.release}'s modules are not here: a container?", cure
        )
    if having or host.module_built_by_dkms:
        others = f" (it is for {', '.join(having)})" if having else ""
        cure = f"run: {BUILD_COMMANDS.get(host.family, BUILD_COMMANDS['debian'])}; or restart into a kernel that has it"
        return problem(
            topic, f"{KERNEL_MODULE} is installed, but not built for {host.release}, which runs{others}", cure
        )
    return problem(topic, f"{KERNEL_MODULE} is not installed", f"run: {' && '.join(install_commands(host))}")


def check_load_at_boot(settings: OutputSettings, host: Host) -> Finding:
    """Check that the module is loaded at boot, and that only one file sets its options."""
    topic = "after a restart"
    if not needs_module(settings, host):
        return ok(topic, "nothing has to be loaded")
    options = [path for folder in _MODPROBE_FOLDERS for path in host.configured(folder, f"options {KERNEL_MODULE}")]
    foreign = [str(path) for path in options if path != host.root / MODULE_OPTIONS_FILE]
    if foreign and len(options) > 1:
        cure = "join their lines into one: devices=2 exclusive_caps=1,1 and both labels, with a comma between"
        return warning(topic, f"{' and '.join(map(str, options))} both set options of {KERNEL_MODULE}", cure)
    if not options:
        return warning(topic, f"no options of {KERNEL_MODULE} are set", f"run: {options_command(settings.label)}")
    if foreign and settings.label not in host.tree.read(options[0]):
        return warning(
            topic, f"{foreign[0]} has no '{settings.label}'", "add the device to its line: see docs/install.md"
        )
    loads = [path for folder in _MODULES_LOAD_FOLDERS for path in host.configured(folder, KERNEL_MODULE)]
    if not loads and KERNEL_MODULE not in host.read("etc/modules").splitlines():
        return warning(topic, f"{KERNEL_MODULE} is not loaded at boot", f"run: {LOAD_AT_BOOT_COMMAND}")
    return ok(topic, f"the virtual camera is made at boot, by {options[0]}")


_MODPROBE_FOLDERS = ("etc/modprobe.d", "usr/lib/modprobe.d", "run/modprobe.d")
_MODULES_LOAD_FOLDERS = ("etc/modules-load.d", "usr/lib/modules-load.d", "run/modules-load.d")
