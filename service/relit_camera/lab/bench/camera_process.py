"""`relit run` in a process of its own, and what can be seen of it from outside."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections import defaultdict
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import psutil

from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.errors import RelitError

START_TIMEOUT_S = 60.0
STOP_TIMEOUT_S = 5.0
POLL_S = 0.02
HTTP_TIMEOUT_S = 10.0

RELIT = """
import sys
from relit_camera.lab.bench.named_threads import name_threads
name_threads()
sys.argv[0] = "relit"
from relit_camera.cli.main import run
run()
"""
"""The program `relit` with named threads."""


class CameraProcess:
    """A running camera. Use it as a context manager: it is stopped at the end.

    Attributes:
        first_picture_s: from the start of the process to its first picture.
    """

    def __init__(self, settings: RelitSettings) -> None:
        """Start a camera with these settings, and wait for its first picture.

        Only the address is not theirs: any free port, which this process alone is told.

        Raises:
            RelitError: it ends, or makes no picture within `START_TIMEOUT_S`; with its own last line.
        """
        self._folder = tempfile.TemporaryDirectory(prefix="relit-bench.")
        config, self._log = Path(self._folder.name, "config.yaml"), Path(self._folder.name, "log.txt")
        # JSON is YAML; the environment must not change what it says.
        config.write_text(settings.model_dump_json(exclude={"server"}))
        kept = {name: value for name, value in os.environ.items() if not name.startswith("RELIT_")}
        models = {name: value for name, value in os.environ.items() if name == "RELIT_MODELS_DIR"}
        command = [sys.executable, "-c", RELIT]
        began = time.monotonic()
        with self._log.open("w") as log:
            self._process = subprocess.Popen(  # noqa: S603 - our own command
                [*command, "--config", str(config), "run", "--port", "0"],
                env=kept | models,
                stdout=subprocess.PIPE,
                stderr=log,
                text=True,
            )
        try:
            assert self._process.stdout is not None
            self._url = self._process.stdout.readline().rpartition(" ")[2].strip()
            while not self._has_picture():
                if time.monotonic() - began > START_TIMEOUT_S:
                    raise self._failure("makes no picture")
                time.sleep(POLL_S)
            self.first_picture_s = time.monotonic() - began
            self._seen = psutil.Process(self._process.pid)
        except BaseException:
            self.stop()
            raise

    def status(self) -> dict[str, Any]:
        """The answer of GET /api/v1/status.

        Raises:
            RelitError: the camera has ended.
        """
        try:
            with urllib.request.urlopen(f"{self._url}api/v1/status", timeout=HTTP_TIMEOUT_S) as answer:  # noqa: S310
                status: dict[str, Any] = json.load(answer)
                return status
        except (OSError, ValueError) as error:
            raise self._failure("ended") from error

    @property
    def processor_s(self) -> float:
        """Processor time that the process has used so far, by itself and in the kernel, of all its threads."""
        times = self._seen.cpu_times()
        return float(times.user + times.system)

    @property
    def resident_mb(self) -> float:
        """Memory of the process that is resident now, in units of 10^6 bytes."""
        return float(self._seen.memory_info().rss / 1e6)

    @property
    def thread_s(self) -> dict[str, float]:
        """Processor time that the threads have used so far, by name; nothing where names cannot be seen.

        Threads of a library have the name of the thread that began them.
        """
        used: defaultdict[str, float] = defaultdict(float)
        for thread in self._seen.threads():
            with suppress(OSError):
                name = Path(f"/proc/{self._process.pid}/task/{thread.id}/comm").read_text().strip()
                used["main" if thread.id == self._process.pid else name] += thread.user_time + thread.system_time
        return used

    def stop(self) -> None:
        """End the camera; harmless when repeated."""
        self._process.terminate()
        try:
            self._process.communicate(timeout=STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()
        self._folder.cleanup()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def _has_picture(self) -> bool:
        return bool(self.status()["frames"]["composed"])

    def _failure(self, what: str) -> RelitError:
        lines = self._log.read_text().splitlines() or ["it says nothing"]
        return RelitError(f"the camera to be measured {what}: {lines[-1].removeprefix('relit: ')}", "see `relit run`")
