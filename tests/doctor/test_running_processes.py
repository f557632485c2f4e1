"""Other Relit Cameras."""

from __future__ import annotations

import os
from types import SimpleNamespace

import psutil
import pytest

from relit_camera.doctor.report import Severity
from relit_camera.doctor.running_processes import check_running
from tests.doctor.fake_host import expect

Processes = list[tuple[int, list[str] | None]]
PROCESSES: Processes = [
    (1, ["/sbin/init"]),
    (10, ["/v/bin/python", "/v/bin/relit", "run", "--port", "0"]),
    (11, ["vim", "relit", "run"]),
    (12, ["/v/bin/python", "/v/bin/relit", "doctor"]),
    (13, None),
]


@pytest.fixture
def processes(monkeypatch: pytest.MonkeyPatch) -> Processes:
    found = list(PROCESSES)
    monkeypatch.setattr(
        psutil,
        "process_iter",
        lambda fields: [SimpleNamespace(pid=pid, info={"cmdline": command}) for pid, command in found],
    )
    return found


def test_the_one_that_runs_is_named(processes: Processes) -> None:
    processes.remove(PROCESSES[2])
    expect(check_running(), Severity.OK, "process 10")


def test_two_are_one_too_many(processes: Processes) -> None:
    processes[:] = [PROCESSES[1], (20, ["relit", "--log-level", "debug", "demo"])]
    expect(check_running(), Severity.WARNING, "processes 10, 20", "kill 20")


def test_none_and_oneself_do_not_count(processes: Processes) -> None:
    processes[:] = [PROCESSES[0], (os.getpid(), ["relit", "run"])]
    expect(check_running(), Severity.OK, "no Relit Camera")
