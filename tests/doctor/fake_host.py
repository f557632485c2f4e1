"""A machine in a folder: devices, kernels, modules and configuration as a test wants them."""

from __future__ import annotations

from pathlib import Path

from relit_camera.devices.device_users import DeviceUser
from relit_camera.doctor.host import SECURE_BOOT_VARIABLE, Host
from relit_camera.doctor.report import Finding, Severity
from tests.devices.fake_devices import FakeTree

RELEASE = "6.1.0-56-amd64"
DISTRIBUTIONS = {
    "debian": 'PRETTY_NAME="Debian GNU/Linux 12 (bookworm)"\nID=debian\n',
    "ubuntu": "NAME=Ubuntu\nID=ubuntu\nID_LIKE=debian\n",
    "fedora": 'NAME="Fedora Linux"\nID=fedora\n',
    "nobara": 'ID=nobara\nID_LIKE="rhel centos fedora"\n',
    "arch": "ID=arch\n",
    "nixos": "ID=nixos\n",
}


class FakeMachine:
    """Files of a machine under one folder, and the `Host` that sees them."""

    def __init__(self, root: Path, distribution: str = "debian", is_linux: bool = True) -> None:
        self.root = root
        self.tree = FakeTree(root)
        self.users: dict[str, list[DeviceUser]] = {}
        self.write("etc/os-release", DISTRIBUTIONS[distribution])
        self.add_kernel(RELEASE)
        self.processes: set[str] = set()
        self.libraries: set[str] = set()
        self.host = Host(
            root,
            self.tree,
            RELEASE,
            is_linux,
            lambda node: self.users.get(node, []),
            root / "run/pipewire-0",
            lambda: self.processes,
            lambda library: library in self.libraries,
            data_home=None,
        )

    def write(self, path: str, text: str) -> Path:
        file = self.root / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
        return file

    def add_kernel(self, release: str, with_module: bool = False) -> None:
        module = "updates/dkms/v4l2loopback.ko.xz: kernel/drivers/media/v4l2-core/videodev.ko.xz\n"
        self.write(f"lib/modules/{release}/modules.dep", "kernel/fs/ext4.ko:\n" + (module if with_module else ""))

    def load_module(self, version: str = "", exclusive_caps: str = "Y,N,N,N,N,N,N,N") -> None:
        folder = "sys/module/v4l2loopback"
        self.write(f"{folder}/parameters/exclusive_caps", exclusive_caps + "\n")
        if version:
            self.write(f"{folder}/version", version + "\n")

    def load_at_boot(self, label: str = "Relit Camera", file: str = "relit-camera.conf") -> None:
        self.write(f"etc/modprobe.d/{file}", f"# ours\noptions v4l2loopback {OPTIONS.format(label)}\n")
        self.write(f"etc/modules-load.d/{file}", "v4l2loopback\n")

    def run_session(self) -> None:
        """Install PipeWire, and let a session run."""
        self.libraries.add("libpipewire-0.3.so.0")
        self.write("run/pipewire-0", "")
        self.processes.add("wireplumber")

    def set_secure_boot(self, on: bool) -> None:
        file = self.root / SECURE_BOOT_VARIABLE
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(b"\6\0\0\0" + bytes([on]))

    def open_by(self, node: str, *users: DeviceUser) -> None:
        self.users[node] = list(users)


OPTIONS = 'devices=1 video_nr=10 exclusive_caps=1 card_label="{}"'
FIREFOX = DeviceUser(30, "firefox", ("/usr/bin/firefox",))
RELIT = DeviceUser(40, "python3", ("/venv/bin/python3", "/venv/bin/relit", "run"))


def nobody_may(path: str, mode: int) -> bool:
    return False


def everybody_may(path: str, mode: int) -> bool:
    return True


def expect(finding: Finding, state: Severity, *words: str) -> None:
    """Of that state; the words are in what was seen or its cure. What is not ok has a cure, what is ok has none."""
    assert finding.state is state, finding
    for word in words:
        assert word in f"{finding.seen} → {finding.cure}", finding
    assert bool(finding.cure) == (state is not Severity.OK), finding
    assert "\n" not in finding.seen + finding.cure
