"""The kernel module v4l2loopback: installed for this kernel, loaded, and loaded again after a restart."""

from __future__ import annotations

from relit_camera.config.settings import OutputSettings
from relit_camera.doctor.findings import Finding, fine, problem, warning
from relit_camera.doctor.host import MODULE, Host
from relit_camera.doctor.root_commands import (
    BUILD,
    ENROLL_KEY,
    LOAD_AT_BOOT,
    MODULE_OPTIONS_FILE,
    install_commands,
    options_command,
)
from relit_camera.stream.devices import load_command


def needs_module(settings: OutputSettings, host: Host) -> bool:
    """Whether the sink that is set is a virtual camera of this system's kernel."""
    is_camera = settings.sink == "camera" or settings.sink.startswith(str(host.tree.dev / "video"))
    return is_camera and host.is_linux


def check_module(settings: OutputSettings, host: Host) -> Finding:
    """Whether the running kernel has the module, and if not, at which step it is missing."""
    topic = "kernel module"
    if not needs_module(settings, host):
        return fine(topic, "not needed")
    if host.module_loaded:
        return fine(topic, f"{MODULE} {host.module_version or '0.12 or older'} is loaded in {host.release}")
    having = host.kernels_with_module
    if host.release in having:
        seen, cure = f"{MODULE} is installed for {host.release} but not loaded", f"run: {load_command(settings.label)}"
        if host.secure_boot:
            seen += "; Secure Boot is on and refuses it unless it is signed ('Key was rejected by service')"
            cure += f"; if it is refused: {ENROLL_KEY}"
        return problem(topic, seen, cure)
    if not (host.root / "lib/modules" / host.release).is_dir():
        cure = f"on the host itself, {load_command(settings.label)}"
        return problem(topic, f"{MODULE} is not loaded, and {host.release}'s modules are not here: a container?", cure)
    if having or host.module_built_by_dkms:
        others = f" (it is for {', '.join(having)})" if having else ""
        cure = f"run: {BUILD.get(host.family, BUILD['debian'])}; or restart into a kernel that has it"
        return problem(topic, f"{MODULE} is installed, but not built for {host.release}, which runs{others}", cure)
    return problem(topic, f"{MODULE} is not installed", f"run: {' && '.join(install_commands(host))}")


def check_boot(settings: OutputSettings, host: Host) -> Finding:
    """Whether the virtual camera is there again after a restart, by one set of options."""
    topic = "after a restart"
    if not needs_module(settings, host):
        return fine(topic, "nothing has to be loaded")
    options = [path for folder in _MODPROBE for path in host.configured(folder, f"options {MODULE}")]
    foreign = [str(path) for path in options if path != host.root / MODULE_OPTIONS_FILE]
    if foreign and len(options) > 1:
        cure = "join their lines into one: devices=2 exclusive_caps=1,1 and both labels, with a comma between"
        return warning(topic, f"{' and '.join(map(str, options))} both set options of {MODULE}", cure)
    if not options:
        return warning(topic, f"no options of {MODULE} are set", f"run: {options_command(settings.label)}")
    if foreign and settings.label not in host.tree.read(options[0]):
        return warning(
            topic, f"{foreign[0]} has no '{settings.label}'", "add the device to its line: see docs/install.md"
        )
    loads = [path for folder in _MODULES_LOAD for path in host.configured(folder, MODULE)]
    if not loads and MODULE not in host.read("etc/modules").splitlines():
        return warning(topic, f"{MODULE} is not loaded at boot", f"run: {LOAD_AT_BOOT}")
    return fine(topic, f"the virtual camera is made at boot, by {options[0]}")


_MODPROBE = ("etc/modprobe.d", "usr/lib/modprobe.d", "run/modprobe.d")
_MODULES_LOAD = ("etc/modules-load.d", "usr/lib/modules-load.d", "run/modules-load.d")
