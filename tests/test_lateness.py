"""Gaps are told from what a busy machine makes any thread wait."""

from __future__ import annotations

import subprocess
import sys
import time

import psutil
import pytest

from tests.lateness import Lateness, spinning
from tests.small_camera import wait_until

STOPPED = """
import sys, time
from tests.lateness import Lateness
with Lateness() as lateness:
    began = time.monotonic()
    print(flush=True)
    sys.stdin.readline()
    ended = time.monotonic()
    print(ended - began - lateness.unexplained_s(began, ended))
"""


def test_of_a_gap_what_the_machine_explains_is_left_out() -> None:
    lateness = Lateness()
    lateness._late += [(0.0, 1.0), (2.5, 3.0), (9.0, 9.5)]
    assert lateness.unexplained_s(0.5, 4.0) == pytest.approx(2.5)
    assert lateness.unexplained_s(4.0, 5.0) == pytest.approx(1.0)
    assert lateness.longest_gap_s([0.0, 1.1, 3.1, 4.0]) == pytest.approx(1.5)


def test_what_only_sleeps_is_not_explained() -> None:
    def is_not_explained() -> bool:
        began = time.monotonic()
        time.sleep(0.3)
        return lateness.unexplained_s(began, began + 0.3) > 0.25

    with Lateness() as lateness:
        wait_until(is_not_explained)  # a busy machine explains some of it, but not each time


def test_what_a_stopped_process_waits_is_explained() -> None:
    command = [sys.executable, "-c", STOPPED]
    with psutil.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        process.stdout.readline()
        process.suspend()
        time.sleep(0.5)
        process.resume()
        assert float(process.communicate("\n")[0]) > 0.45


def test_a_process_that_only_computes_gets_the_time_that_there_is() -> None:
    with spinning() as spun_s:
        before_s, began = spun_s(), time.monotonic()
        wait_until(lambda: spun_s() - before_s > 0.2)
        assert spun_s() - before_s < time.monotonic() - began + 0.05  # processor time is told in hundredths
