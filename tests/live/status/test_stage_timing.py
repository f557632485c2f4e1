import threading
import time

import numpy as np
import pytest

from relit_camera.live.status.stage_timing import DurationWindow, RateMeter, StageTimer
from tests.virtual_clock import VirtualClock


def test_percentiles_are_those_of_the_window() -> None:
    window = DurationWindow(100)
    for millisecond in range(1, 301):
        window.add(millisecond / 1e3)
    truth = np.percentile(np.arange(201, 301), [50, 95])
    assert window.percentiles().p50 == pytest.approx(truth[0])
    assert window.percentiles().p95 == pytest.approx(truth[1])


def test_an_empty_window_reads_zero() -> None:
    assert DurationWindow().percentiles().p95 == 0


def test_stages_are_timed_apart_and_kept_in_order() -> None:
    clock = VirtualClock()
    timer = StageTimer(now=clock.now)
    for _ in range(3):
        with timer.stage("track"):
            clock.sleep(0.1)
        with timer.stage("relight"):
            clock.sleep(0.02)
    assert list(timer.percentiles()) == ["track", "relight"]
    assert timer.percentiles()["track"].p50 == pytest.approx(100)
    assert timer.percentiles()["relight"].p50 == pytest.approx(20)
    assert timer.lap_ms() == pytest.approx({"track": 100, "relight": 20})
    timer.add("relight", 0.001)
    assert timer.lap_ms() == {"relight": 1.0}  # a stage that did not run again is left out
    assert timer.lap_ms() == {}


def burn(seconds: float) -> None:
    end = time.thread_time() + seconds
    while time.thread_time() < end:
        pass


def test_processor_time_is_that_of_the_stage_alone() -> None:
    used_s = [3.0]

    def use(seconds: float) -> None:
        used_s[0] += seconds

    timer = StageTimer(processor_now=lambda: used_s[0])
    with timer.stage("compose"):
        use(0.02)
        with timer.stage("matte"):
            use(0.04)
        use(0.005)
    with timer.stage("matte"):
        use(0.01)
    assert timer.processor_s() == pytest.approx({"compose": 0.025, "matte": 0.05}, abs=1e-9)


def test_processor_time_of_other_threads_is_theirs() -> None:
    """Nor is waiting for them processor time."""
    timer = StageTimer()
    with timer.stage("light"):
        other = threading.Thread(target=burn, args=(0.05,))
        other.start()
        other.join()
    assert timer.processor_s()["light"] < 0.02


def test_a_stage_that_raises_is_not_counted() -> None:
    timer = StageTimer()
    with pytest.raises(ValueError, match="no"), timer.stage("track"):
        raise ValueError("no")
    assert timer.percentiles() == {}


def test_running_stages_are_listed_in_the_order_they_began() -> None:
    timer = StageTimer()
    with timer.stage("follow"), timer.stage("relight"):
        assert timer.running() == ["follow", "relight"]
    assert timer.running() == []


def test_stages_may_be_read_while_they_are_timed() -> None:
    timer = StageTimer(50)
    done = threading.Event()

    def work() -> None:
        for number in range(3000):
            timer.add(f"stage {number % 7}", 0.001)
        done.set()

    thread = threading.Thread(target=work)
    thread.start()
    while not done.is_set():
        assert all(percentiles.p50 == pytest.approx(1.0) for percentiles in timer.percentiles().values())
    thread.join(5)
    assert len(timer.percentiles()) == 7


def test_rate_is_events_a_second() -> None:
    meter = RateMeter(3.0)
    for number in range(200):
        meter.tick(number / 30)
    assert meter.rate(199 / 30) == pytest.approx(30)


def test_events_counted_late_and_together_count_for_the_time_in_which_they_came() -> None:
    meter = RateMeter(3.0)
    meter.tick(0.0)
    meter.tick(4.0, 120)  # the reader was held up for four seconds
    for number in range(1, 31):
        now = 4 + number / 30
        meter.tick(now)
        assert meter.rate(now) == pytest.approx(30)


def test_rate_falls_when_nothing_comes() -> None:
    meter = RateMeter(3.0)
    for number in range(31):
        meter.tick(number / 30)
    assert meter.rate(1.0) == pytest.approx(30)
    # The last tick is a second old; the next one was due a period after it.
    assert meter.rate(2.0) == pytest.approx(30 / (2 - 1 / 30))
    assert meter.rate(10.0) == 0


def test_rate_of_too_few_events_is_zero() -> None:
    meter = RateMeter()
    assert meter.rate(0.0) == 0
    meter.tick(0.0)
    assert meter.rate(0.0) == 0
