"""Gaps are told from what a busy machine makes any thread wait."""

from __future__ import annotations

import time

import pytest

from tests.lateness import Lateness


def test_of_a_gap_what_the_machine_explains_is_left_out() -> None:
    lateness = Lateness()
    lateness._late += [(0.0, 1.0), (2.5, 3.0), (9.0, 9.5)]
    assert lateness.unexplained_s(0.5, 4.0) == pytest.approx(2.5)
    assert lateness.unexplained_s(4.0, 5.0) == pytest.approx(1.0)
    assert lateness.longest_gap_s([0.0, 1.1, 3.1, 4.0]) == pytest.approx(1.5)


def test_a_gap_while_the_thread_runs_is_not_explained() -> None:
    with Lateness() as lateness:
        began = time.monotonic()
        time.sleep(0.3)
        ended = time.monotonic()
    waited = sum(until - since for since, until in lateness._late)
    assert ended - began - waited <= lateness.unexplained_s(began, ended) <= ended - began
