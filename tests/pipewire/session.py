"""A PipeWire session of the tests' own: daemon, session manager and D-Bus in a private runtime folder, without root."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sysconfig
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self, TypeVar

import psutil

from relit_camera.devices.device_users import KEEPER_MODULE

T = TypeVar("T")

CACHE_VARIABLE = "PIPEWIRE_TEST_CACHE"
WAIT_S = 120.0
"""How long to wait for anything; a busy machine needs a minute for `relit run` to start."""

BUS = """<!DOCTYPE busconfig PUBLIC "-//freedesktop//DTD D-Bus Bus Configuration 1.0//EN"
 "http://www.freedesktop.org/standards/dbus/1.0/busconfig.dtd">
<busconfig>
  <type>session</type>
  <listen>{address}</listen>
  <policy context="default">
    <allow send_destination="*" eavesdrop="true"/>
    <allow eavesdrop="true"/>
    <allow own="*"/>
  </policy>
</busconfig>
"""


def cache_folder() -> Path:
    """Where `install.sh` unpacks the packages."""
    default = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "relit-camera-pipewire"
    return Path(os.environ.get(CACHE_VARIABLE) or default)


def what_is_missing(suite: str) -> str:
    """Why there can be no session of that suite's packages; empty where there can."""
    if not (cache_folder() / suite / "recipe").is_file():
        return f"no PipeWire of {suite}: sh tests/pipewire/install.sh {'' if suite == 'own' else suite}".rstrip()
    return ""


@dataclass
class Session:
    """The daemons of one session, ended with the block.

    Attributes:
        suite: whose packages are used.
        folder: a private folder.
    """

    suite: str
    folder: Path
    _running: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)

    def __enter__(self) -> Self:
        self.runtime.mkdir(mode=0o700, parents=True)
        bus = self.folder / "bus.conf"
        bus.write_text(BUS.format(address=self.environment["DBUS_SESSION_BUS_ADDRESS"]))
        try:
            self._start("dbus-daemon", "--nofork", f"--config-file={bus}")
            wait_for(self._bus_answers, "the bus")  # what is started before that ends at once
            self.start()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        self._end("dbus-daemon")

    @property
    def runtime(self) -> Path:
        """XDG_RUNTIME_DIR of the session."""
        return self.folder / "run"

    @property
    def environment(self) -> dict[str, str]:
        """Variables for the programs of the session."""
        root = cache_folder() / self.suite / "root"
        multiarch = str(sysconfig.get_config_var("MULTIARCH"))
        libraries = [root / "usr/lib" / multiarch, root / "lib" / multiarch]

        def place(path: str) -> str:
            """A folder of the packages: unpacked, or installed."""
            unpacked = root / "usr" / path
            return str(unpacked if unpacked.exists() else Path("/usr") / path)

        plugins = [str(folder / "gstreamer-1.0") for folder in (libraries[0], Path("/usr/lib") / multiarch)]
        kept = {
            name: value for name, value in os.environ.items() if not name.startswith(("PIPEWIRE_", "XDG_", "DBUS_"))
        }
        return {
            **kept,
            "PATH": f"{root}/usr/bin:{root}/bin:{os.environ['PATH']}",
            "LD_LIBRARY_PATH": ":".join(map(str, libraries)),
            "XDG_DATA_DIRS": f"{root}/usr/share:/usr/share",
            "XDG_DATA_HOME": str(self.folder / "data"),
            "HOME": str(self.folder),
            "XDG_RUNTIME_DIR": str(self.runtime),
            "XDG_CONFIG_HOME": str(self.folder / "config"),
            "XDG_STATE_HOME": str(self.folder / "state"),
            "DBUS_SESSION_BUS_ADDRESS": f"unix:path={self.runtime / 'bus'}",
            "PIPEWIRE_MODULE_DIR": place(f"lib/{multiarch}/pipewire-0.3"),
            "PIPEWIRE_CONFIG_DIR": place("share/pipewire"),
            "SPA_PLUGIN_DIR": place(f"lib/{multiarch}/spa-0.2"),
            "WIREPLUMBER_MODULE_DIR": str(next(libraries[0].glob("wireplumber-0.*"), "")),
            "WIREPLUMBER_CONFIG_DIR": place("share/wireplumber"),
            "WIREPLUMBER_DATA_DIR": place("share/wireplumber"),
            "GST_PLUGIN_SYSTEM_PATH": ":".join(plugins),
            "GST_PLUGIN_SCANNER": place(f"lib/{multiarch}/gstreamer1.0/gstreamer-1.0/gst-plugin-scanner"),
            "GST_REGISTRY": str(cache_folder() / self.suite / "gstreamer.registry"),
        }

    def start(self) -> None:
        """Start PipeWire and its session manager."""
        self._start("pipewire")
        wait_for(lambda: (self.runtime / "pipewire-0").exists(), "PipeWire's socket")
        self._start("wireplumber")

    def stop(self) -> None:
        """End both, as at a logout."""
        self._end("wireplumber")
        self._end("pipewire")

    def run(self, *command: str, timeout_s: float = WAIT_S) -> subprocess.CompletedProcess[bytes]:
        """Run a program of the session to its end."""
        return subprocess.run(
            command, env=self.environment, cwd=self.folder, capture_output=True, timeout=timeout_s, check=False
        )

    def spawn(self, *command: str) -> subprocess.Popen[bytes]:
        """Start a program of the session; the caller ends it."""
        return subprocess.Popen(
            command, env=self.environment, cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )

    def objects(self) -> list[dict[str, Any]]:
        """Everything in the session, as pw-dump tells it."""
        answer = self.run("pw-dump")
        try:
            found: list[dict[str, Any]] = json.loads(answer.stdout)
        except ValueError:
            return []  # while something changes it writes two lists, one after the other
        return found

    def cameras(self) -> list[dict[str, Any]]:
        """Properties of the nodes that are cameras, with their parameters as `params` and state as `state`."""
        infos = [found["info"] for found in self.objects() if str(found.get("type")).endswith(":Node")]
        return [
            {**info["props"], "params": info.get("params", {}), "state": info.get("state")}
            for info in infos
            if info.get("props", {}).get("media.class") == "Video/Source"
        ]

    def keepers(self) -> list[psutil.Process]:
        """The keepers that hold a camera in it."""
        found = []
        for process in psutil.process_iter():
            try:
                if KEEPER_MODULE in process.cmdline() and str(self.runtime) in process.environ().values():
                    found.append(process)
            except (psutil.NoSuchProcess, psutil.AccessDenied):
                continue
        return found

    def end_keepers(self) -> None:
        """End them, as if nobody came for their cameras."""
        for process in self.keepers():
            process.kill()

    def log(self, name: str) -> str:
        """What a daemon has written."""
        return (self.folder / f"{name}.log").read_text(errors="replace")

    def _bus_answers(self) -> bool:
        bus = "org.freedesktop.DBus"
        return self.run("dbus-send", "--session", "--print-reply", f"--dest={bus}", "/", f"{bus}.GetId").returncode == 0

    def _start(self, name: str, *arguments: str) -> None:
        program = shutil.which(name, path=self.environment["PATH"])
        assert program is not None, f"{name} is missing"
        with (self.folder / f"{name}.log").open("ab") as log:
            self._running[name] = subprocess.Popen(
                [program, *arguments], env=self.environment, cwd=self.folder, stdout=log, stderr=log
            )

    def _end(self, name: str) -> None:
        process = self._running.pop(name, None)
        if process is None:
            return
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(5)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def wait_for(ask: Callable[[], T | None], what: str, seconds: float = WAIT_S) -> T:
    """Ask until the answer is true, and give it.

    Raises:
        AssertionError: it never is.
    """
    ends_at = time.monotonic() + seconds
    while not (answer := ask()):
        assert time.monotonic() < ends_at, f"waited {seconds:.0f} s for {what}"
        time.sleep(0.05)
    return answer
