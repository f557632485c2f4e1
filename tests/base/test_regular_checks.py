"""What is looked at once a second: when, until when, and once more at the end."""

from __future__ import annotations

import threading

from relit_camera.base.concurrency.regular_checks import PERIOD_S, check_until, checking_regularly
from tests.virtual_clock import VirtualClock


class StepClock:
    """Lets a period pass when the test says so."""

    def __init__(self) -> None:
        self.waited: list[float] = []
        self.is_waiting = threading.Event()
        self.steps = threading.Semaphore(0)

    def now(self) -> float:
        raise AssertionError

    def wait(self, event: threading.Event, timeout_s: float) -> bool:
        self.waited.append(timeout_s)
        self.is_waiting.set()
        while not self.steps.acquire(timeout=0.01):
            if event.is_set():
                return True
        return False

    def wait_for(self, condition: object, predicate: object, timeout_s: float) -> bool:
        raise AssertionError


def test_it_is_looked_at_once_a_second_until_the_end() -> None:
    clock, stopping, looks = VirtualClock(), threading.Event(), []
    began = clock.now()
    clock.at(4.5, stopping.set)
    check_until(stopping, lambda: looks.append(clock.now() - began), clock)
    assert looks == [1.0, 2.0, 3.0, 4.0]
    assert clock.now() - began == 4.5  # the end is not waited for


def test_a_look_that_takes_long_is_followed_by_a_whole_pause() -> None:
    clock, stopping, looks = VirtualClock(), threading.Event(), []
    began = clock.now()

    def look() -> None:
        looks.append(clock.now() - began)
        clock.sleep(5.0)

    clock.at(13.5, stopping.set)
    check_until(stopping, look, clock)
    assert looks == [1.0, 7.0, 13.0]


def _threads() -> list[str]:
    return [thread.name for thread in threading.enumerate() if thread.name == "looks"]


def test_a_thread_looks_until_the_block_ends() -> None:
    clock, looked = StepClock(), threading.Event()
    with checking_regularly("looks", looked.set, clock=clock):
        assert clock.is_waiting.wait(30)
        assert not looked.is_set()
        assert _threads() == ["looks"]
        clock.steps.release()
        assert looked.wait(30)
        looked.clear()
    assert _threads() == []
    assert not looked.is_set()
    assert set(clock.waited) == {PERIOD_S}


def test_it_is_looked_at_once_more_at_the_end() -> None:
    looks: list[str] = []
    with checking_regularly("looks", lambda: looks.append(threading.current_thread().name), True, StepClock()):
        assert looks == []
    assert looks == [threading.current_thread().name]
