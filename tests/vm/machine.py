"""A small Debian machine under QEMU's software emulation, made by `build.sh`, that does what it is told."""

from __future__ import annotations

import hashlib
import json
import os
import shlex
import shutil
import socket
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as NoAnswer
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from types import TracebackType
from typing import Any, Self

HERE = Path(__file__).parent
GUEST_PROGRAM = "/opt/relit"
BOOT_S = 120.0
"""Five seconds on an idle machine."""
POWER_OFF_S = 20.0
CPU = "Nehalem"
"""Without AVX, whose emulation in QEMU 7.2 spoils Chromium's pictures with dotted lines."""
BOOT_WORDS = "console=ttyS0 quiet loglevel=4 panic=-1 mitigations=off no_timer_check tsc=reliable"


def cache_folder() -> Path:
    """Where `build.sh` puts the machine."""
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return Path(os.environ.get("RELIT_VM_CACHE") or base / "relit-camera-vm")


def what_is_missing() -> str:
    """Say why there is no machine; empty if there is one."""
    if shutil.which("qemu-system-x86_64") is None:
        return "no QEMU (make vm)"
    recipe = cache_folder() / "recipe"
    parts = b"".join((HERE / name).read_bytes() for name in ("build.sh", "init.sh", "initramfs.sh"))
    is_this = recipe.exists() and recipe.read_text().strip() == hashlib.sha256(parts).hexdigest()[:16]
    return "" if is_this else "the test machine is not built, or is of another recipe (make vm)"


def versions() -> list[str]:
    """What the machine was made of, each "package version"."""
    return (cache_folder() / "versions").read_text().splitlines()


class MachineError(Exception):
    """The machine, or a command that had to succeed in it, failed."""


@dataclass(frozen=True)
class Outcome:
    """How a command ended.

    Attributes:
        status: its exit status; 124 when its time was up.
        output: its standard output.
        errors: its standard error.
    """

    status: int
    output: str
    errors: str

    @property
    def text(self) -> str:
        """Output and errors."""
        return self.output + self.errors


class Command:
    """A command that runs in the machine."""

    def __init__(self, machine: Machine, text: str, timeout_s: float) -> None:
        self._machine, self._text, self._timeout_s = machine, text, timeout_s
        self._pid: Future[int] = Future()
        self._outcome: Future[Outcome] = Future()

    @property
    def pid(self) -> int:
        """Its process, the leader of a group of its own."""
        return self._pid.result(BOOT_S)

    @property
    def ended(self) -> bool:
        """Whether it has."""
        return self._outcome.done()

    def wait(self) -> Outcome:
        """Wait for its end.

        Raises:
            MachineError: the machine does not answer.
        """
        try:
            return self._outcome.result(self._timeout_s + POWER_OFF_S)
        except NoAnswer as error:
            raise MachineError(f"no answer to: {self._text}\n{self._machine.console()}") from error

    def kill(self, signal: str = "KILL") -> None:
        """Send a signal to it and all it has started."""
        self._machine.run(f"/bin/kill -{signal} -- -{self.pid}", check=False)

    def fail(self, error: MachineError) -> None:
        """The machine is gone."""
        for answer in (self._pid, self._outcome):
            if not answer.done():
                answer.set_exception(error)

    def note(self, reply: dict[str, Any]) -> None:
        """Take what the machine says of it."""
        if "pid" in reply:
            self._pid.set_result(reply["pid"])
        else:
            self._outcome.set_result(Outcome(reply["status"], reply["output"], reply["errors"]))


class Machine:
    """Booted by `with`, switched off at its end. What it writes is lost, but for what lies below /host.

    Attributes:
        host: the folder that the machine sees as /host; its `guest` holds copies of our scripts.
    """

    def __init__(self, program: Path | None = None, memory_mib: int = 3072) -> None:
        """Set up; `with` boots.

        Args:
            program: a disk image that the machine mounts at /opt/relit.
            memory_mib: of the machine.
        """
        self._folder = Path(tempfile.mkdtemp(prefix="relit-vm-"))
        self.host = self._folder / "host"
        shutil.copytree(HERE / "guest", self.host / "guest", ignore=shutil.ignore_patterns("__pycache__"))
        self.host.chmod(0o777)
        self._program, self._memory_mib = program, memory_mib
        self._numbers = count()
        self._commands: dict[int, Command] = {}
        self._lock = threading.Lock()

    def __enter__(self) -> Self:
        with ExitStack() as undo:
            undo.callback(shutil.rmtree, self._folder, ignore_errors=True)
            address = self._folder / "port"
            listener = undo.enter_context(socket.socket(socket.AF_UNIX))
            listener.bind(str(address))
            listener.listen()
            self._qemu = subprocess.Popen(self._qemu_command(address), stdin=subprocess.DEVNULL)
            undo.callback(self._switch_off)
            listener.settimeout(BOOT_S)
            self._port, _ = listener.accept()
            self._port.settimeout(None)
            undo.callback(self._port.close)
            undo.callback(self._hang_up)
            listener.close()
            threading.Thread(target=self._listen, daemon=True).start()
            self.run("true", timeout_s=BOOT_S)
            self._undo = undo.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._undo.close()

    def start(self, command: str, timeout_s: float = 600.0) -> Command:
        """Begin a shell command, as root."""
        number = next(self._numbers)
        started = self._commands[number] = Command(self, command, timeout_s)
        request = json.dumps({"id": number, "command": command, "timeout": timeout_s})
        with self._lock:
            self._port.sendall(request.encode() + b"\n")
        return started

    def run(self, command: str, timeout_s: float = 60.0, check: bool = True) -> Outcome:
        """Run a shell command to its end, as root.

        Raises:
            MachineError: it failed, or the machine does not answer.
        """
        outcome = self.start(command, timeout_s).wait()
        if check and outcome.status:
            raise MachineError(f"status {outcome.status}: {command}\n{outcome.text}")
        return outcome

    def load(self, module: str) -> None:
        """Load a kernel module, by the words that follow `modprobe`, and give its devices to the group `video`."""
        self.run(f"modprobe {module} && chgrp video /dev/video* && chmod 660 /dev/video*")

    def console(self) -> str:
        """The end of what the machine's kernel said."""
        return (self._folder / "console").read_text(errors="replace")[-3000:]

    def _hang_up(self) -> None:
        with suppress(OSError):
            self._port.shutdown(socket.SHUT_RDWR)  # the machine then powers off by itself

    def _switch_off(self) -> None:
        try:
            self._qemu.wait(POWER_OFF_S)
        except subprocess.TimeoutExpired:
            self._qemu.kill()
            self._qemu.wait()

    def _listen(self) -> None:
        with self._port.makefile("rb") as replies:
            for line in replies:
                reply = json.loads(line)
                self._commands[reply.pop("id")].note(reply)
        for command in list(self._commands.values()):
            command.fail(MachineError(f"the machine has ended\n{self.console()}"))

    def _qemu_command(self, address: Path) -> list[str]:
        cache = cache_folder()
        disks = [cache / "root.img", *([self._program] if self._program else [])]
        return [
            *qemu_command(cache / "vmlinux", cache / "initrd", disks, self.host, self._memory_mib),
            *("-append", BOOT_WORDS),
            *("-serial", f"file:{self._folder / 'console'}"),
            *("-device", "virtio-serial-pci", "-chardev", f"socket,id=port,path={address}"),
            *("-device", "virtserialport,chardev=port,name=relit"),
        ]


def qemu_command(kernel: Path, initrd: Path, disks: list[Path], host: Path, memory_mib: int) -> list[str]:
    """The words that start an emulated machine whose disks forget what is written, and which sees `host` as a share."""
    return [
        *("qemu-system-x86_64", "-nodefaults", "-no-user-config", "-display", "none", "-no-reboot"),
        *("-machine", "pc", "-accel", "tcg,thread=multi,tb-size=512"),
        *("-cpu", CPU, "-smp", "2", "-m", str(memory_mib)),
        *("-kernel", str(kernel), "-initrd", str(initrd), "-device", "virtio-rng-pci"),
        *(word for disk in disks for word in ("-drive", f"file={disk},if=virtio,format=raw,snapshot=on")),
        *("-virtfs", f"local,path={host},mount_tag=host,security_model=none,multidevs=remap"),
    ]


def by_user(command: str) -> str:
    """A shell command, to be run as the plain user `you`."""
    user = "setpriv --reuid you --regid you --init-groups env HOME=/home/you"
    return f"cd /tmp && exec {user} sh -c {shlex.quote(command)}"


def wait_until(condition: Callable[[], Any], within_s: float, what: str) -> Any:
    """Ask twice a second until the answer is true, and return it.

    Raises:
        MachineError: it was not within that time.
    """
    ends_at = time.monotonic() + within_s
    while time.monotonic() < ends_at:
        if answer := condition():
            return answer
        time.sleep(0.5)
    raise MachineError(f"not within {within_s:.0f} s: {what}")
