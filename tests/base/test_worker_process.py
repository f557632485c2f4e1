"""Work in a process of its own: what it returns, and every way in which it ends early."""

from __future__ import annotations

import multiprocessing.resource_tracker
import multiprocessing.spawn
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import psutil
import pytest

from relit_camera.base.concurrency.worker_process import NICENESS, run_in_worker_process
from relit_camera.base.errors import CaptureError, WorkerError
from tests.base.work import add, count_up, die, fail, refuse, sleep, take_memory
from tests.small_camera import WAIT_S, wait_until

BEFORE = set[psutil.Process]()


@pytest.fixture(autouse=True)
def before() -> None:
    """Workers of other files' tests in the same process, which may take a while to end, are none of ours."""
    BEFORE.clear()
    BEFORE.update(workers())


def workers() -> list[psutil.Process]:
    """The worker processes that this test has started and that run."""
    children = [
        child
        for child in psutil.Process().children()
        if child not in BEFORE and child.status() != psutil.STATUS_ZOMBIE  # nobody has waited for it yet
    ]
    return [child for child in children if "spawn_main" in " ".join(child.cmdline())]


def test_the_result_comes_from_another_process_of_low_priority() -> None:
    total, process, niceness = run_in_worker_process(add, 2, 3, timeout_s=30)
    assert (total, niceness) == (5, min(19, os.nice(0) + NICENESS))
    assert process != os.getpid()


def test_an_error_with_a_cure_arrives_whole() -> None:
    with pytest.raises(CaptureError, match="no face is in the frames; look at the camera"):
        run_in_worker_process(refuse, timeout_s=30)


def test_a_fault_and_a_death_are_errors() -> None:
    with pytest.raises(WorkerError, match="ZeroDivisionError: one"):
        run_in_worker_process(fail, timeout_s=30)
    with pytest.raises(WorkerError, match="exit code 7"):
        run_in_worker_process(die, timeout_s=30)


@pytest.mark.slow
def test_a_worker_that_takes_too_long_is_ended(tmp_path: Path) -> None:
    with pytest.raises(WorkerError, match="more than 1 s"):
        run_in_worker_process(sleep, tmp_path / "process", timeout_s=1)
    assert workers() == []


def test_a_canceled_worker_is_ended_at_once(tmp_path: Path) -> None:
    canceled = threading.Event()
    threading.Timer(0.3, canceled.set).start()
    began = time.monotonic()
    with pytest.raises(WorkerError, match="canceled"):
        run_in_worker_process(sleep, tmp_path / "process", timeout_s=10 * WAIT_S, canceled=canceled)
    assert time.monotonic() - began < WAIT_S
    assert workers() == []


@pytest.mark.skipif(shutil.which("false") is None, reason="no program that only ends")
@pytest.mark.timeout(60)
def test_a_worker_that_dies_at_its_start_does_not_block_large_arguments(monkeypatch: pytest.MonkeyPatch) -> None:
    multiprocessing.resource_tracker.ensure_running()  # it is started with the same program
    monkeypatch.setattr(multiprocessing.spawn, "_python_exe", os.fsencode(shutil.which("false") or ""))
    with pytest.raises(WorkerError, match=r"died \(exit code 1\)"):
        run_in_worker_process(len, bytes(10_000_000), timeout_s=30)


def test_a_worker_ends_with_the_process_that_started_it(tmp_path: Path) -> None:
    file = tmp_path / "process"
    code = (
        "import sys; from pathlib import Path; from tests.base.work import sleep\n"
        "from relit_camera.base.concurrency.worker_process import run_in_worker_process\n"
        "run_in_worker_process(sleep, Path(sys.argv[1]), timeout_s=60)"
    )
    with subprocess.Popen([sys.executable, "-c", code, str(file)]) as parent:
        wait_until(lambda: file.exists() and file.read_text() != "")
        worker = psutil.Process(int(file.read_text()))
        parent.kill()
    wait_until(lambda: not worker.is_running() or worker.status() == psutil.STATUS_ZOMBIE)


def test_progress_is_told_in_order_and_at_once() -> None:
    told: list[tuple[str, int, int | None]] = []
    assert run_in_worker_process(count_up, 3, timeout_s=30, progress=lambda *stage: told.append(stage)) == "done"
    assert told == [("counting", 1, 3), ("counting", 2, 3), ("counting", 3, 3)]


@pytest.mark.skipif(sys.platform != "linux", reason="the limit is Linux's")
def test_a_worker_may_not_take_more_memory_than_it_is_given() -> None:
    assert run_in_worker_process(take_memory, 1 << 20, timeout_s=30, most_bytes=1 << 30) == 1 << 20
    with pytest.raises(WorkerError, match="needs more memory than is free"):
        run_in_worker_process(take_memory, 2 << 30, timeout_s=30, most_bytes=1 << 30)


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="a signal of POSIX systems")
def test_ctrl_c_while_a_worker_starts_is_the_camera_s_alone() -> None:
    """The whole process group gets SIGINT at every moment of its start; nothing is printed, the work is done."""
    code = (
        "import os, signal, threading, time\n"
        "from tests.base.work import add\n"
        "from relit_camera.base.concurrency.worker_process import run_in_worker_process\n"
        "signal.signal(signal.SIGINT, lambda *_: None)\n"
        "stop = threading.Event()\n"
        "def press():\n"
        "    while not stop.wait(0.01): os.killpg(0, signal.SIGINT)\n"
        "presser = threading.Thread(target=press)\n"
        "presser.start()\n"
        "try:\n"
        "    print(run_in_worker_process(add, 2, 3, timeout_s=60)[0])\n"
        "finally:\n"
        "    stop.set(); presser.join()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=100, start_new_session=True
    )
    assert (done.stdout, done.stderr) == ("5\n", "")
