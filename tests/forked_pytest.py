"""A process that runs pytest again and again, each time in a fork of itself: libraries are imported once for all.

It reads a request a line, JSON with the arguments of pytest, the test files in their order and the seconds they may
take, and answers with a line: the exit status of pytest (None: it took too long), the number of tests that passed,
those that failed, and the seconds that it took. It imports nothing of the program.
"""

from __future__ import annotations

import importlib
import json
import os
import resource
import select
import signal
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import pytest

LIBRARIES = (
    "numpy", "scipy", "cv2", "av", "onnx", "onnxruntime", "fastapi", "httpx", "pydantic", "rich", "typer", "yaml",
    "hypothesis", "schemathesis", "xdist",
)  # fmt: skip
MEMORY_BYTES = 12 << 30


class _Noted:
    """A plug-in of pytest: keeps the order of files, and notes how many tests pass and which fail."""

    def __init__(self, files: Sequence[str]) -> None:
        self._files = files
        self.passed = 0
        self.failed: list[str] = []

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        items.sort(key=lambda item: self._files.index(item.nodeid.partition("::")[0]))

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        self.failed += [report.nodeid] if report.failed else []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.passed += report.when == "call" and report.passed
        self.failed += [report.nodeid] if report.failed else []


def serve() -> None:
    """Answer requests, one a line: run pytest in a forked process, whose imports of libraries are made already."""
    sys.path.insert(0, str(Path.cwd()))
    for name in LIBRARIES:
        with suppress(ImportError):
            importlib.import_module(name)
    answer = Path("../answer.json").resolve()
    for line in sys.stdin:
        request, began = json.loads(line), time.monotonic()
        answer.unlink(missing_ok=True)
        pid = os.fork()
        if pid == 0:
            try:
                _test(request["arguments"], request["files"], answer)
            finally:
                os._exit(0)
        ended, _, _ = select.select([os.pidfd_open(pid)], [], [], request["timeout_s"])
        with suppress(ProcessLookupError):
            os.killpg(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        crashed = {"status": -1, "passed": 0, "failed": ["the process"]}
        found = {"status": None} if not ended else json.loads(answer.read_text()) if answer.exists() else crashed
        print(json.dumps({**found, "seconds": round(time.monotonic() - began, 1)}), flush=True)


def _test(arguments: Sequence[str], files: Sequence[str], answer: Path) -> None:
    os.setsid()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    output = os.open(answer.with_name("output.txt"), os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    for standard in (1, 2):
        os.dup2(output, standard)
    noted = _Noted(files)
    status = pytest.main([*arguments, *files], plugins=[noted])
    answer.write_text(json.dumps({"status": int(status), "passed": noted.passed, "failed": noted.failed}))


if __name__ == "__main__":
    serve()
