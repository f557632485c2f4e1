"""Waiting for a processor: a thread that shares one with others has waited, one that sleeps has not."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from relit_camera.base.concurrency.run_delay import run_delay_s

needs_linux = pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="Linux tells")


def test_of_a_thread_that_is_not_there_nothing_is_told() -> None:
    assert run_delay_s(2**22 + 1) == 0.0


@pytest.mark.slow
@needs_linux
def test_a_thread_that_shares_a_processor_waits_for_it_and_one_that_sleeps_does_not() -> None:
    processor = min(os.sched_getaffinity(0))
    others = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(3)]
    waited: list[float] = []

    def work() -> None:
        os.sched_setaffinity(0, {processor})  # of this thread
        before, until = run_delay_s(threading.get_native_id()), time.monotonic() + 1.0
        while time.monotonic() < until:
            pass
        waited.append(run_delay_s(threading.get_native_id()) - before)

    asleep, woken = threading.Event(), threading.Event()

    def sleep() -> None:
        asleep.set()
        woken.wait(60)

    sleeper = threading.Thread(target=sleep, daemon=True)
    try:
        for other in others:
            os.sched_setaffinity(other.pid, {processor})
        sleeper.start()
        asleep.wait(60)
        assert sleeper.native_id is not None
        time.sleep(0.1)
        before = run_delay_s(sleeper.native_id)
        worker = threading.Thread(target=work)
        worker.start()
        worker.join()
        assert 0.2 < waited[0] < 60
        assert run_delay_s(sleeper.native_id) == before
    finally:
        woken.set()
        for other in others:
            other.kill()
            other.wait()
