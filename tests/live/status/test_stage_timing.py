import threading
import time

import numpy as np
import pytest

from relit_camera.live.status.stage_timing import DurationWindow, Pacer, RateMeter, StageTimer


def test_percentiles_are_those_of_the_window():
    window = DurationWindow(100)
    for millisecond in range(1, 301):
        window.add(millisecond / 1e3)
    truth = np.percentile(np.arange(201, 301), [50, 95])
    assert window.percentiles().p50 == pytest.approx(truth[0])
    assert window.percentiles().p95 == pytest.approx(truth[1])


def test_an_empty_window_reads_zero():
    assert DurationWindow().percentiles().p95 == 0


def test_stages_are_timed_apart_and_kept_in_order():
    timer = StageTimer()
    for _ in range(3):
        with timer.stage("track"):
            time.sleep(0.1)
        with timer.stage("relight"):
            pass
    assert list(timer.percentiles()) == ["track", "relight"]
    assert timer.percentiles()["track"].p50 >= 95
    assert timer.percentiles()["relight"].p50 < 50
    lap = timer.lap_ms()
    assert list(lap) == ["track", "relight"]
    assert lap["track"] >= 95
    timer.add("relight", 0.001)
    assert timer.lap_ms() == {"relight": 1.0}  # what did not run again is not told again
    assert timer.lap_ms() == {}


def test_a_stage_that_raises_is_not_counted():
    timer = StageTimer()
    with pytest.raises(ValueError, match="no"), timer.stage("track"):
        raise ValueError("no")
    assert timer.percentiles() == {}


def test_stages_may_be_read_while_they_are_timed():
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


def test_rate_is_events_a_second():
    meter = RateMeter(3.0)
    for number in range(200):
        meter.tick(number / 30)
    assert meter.rate(199 / 30) == pytest.approx(30)


def test_events_told_late_and_together_count_for_the_time_in_which_they_came():
    meter = RateMeter(3.0)
    meter.tick(0.0)
    meter.tick(4.0, 120)  # the reader was held up for four seconds
    for number in range(1, 31):
        now = 4 + number / 30
        meter.tick(now)
        assert meter.rate(now) == pytest.approx(30)


def test_rate_falls_when_nothing_comes():
    meter = RateMeter(3.0)
    for number in range(31):
        meter.tick(number / 30)
    assert meter.rate(1.0) == pytest.approx(30)
    # The last tick is a second old; the next one was due a period after it.
    assert meter.rate(2.0) == pytest.approx(30 / (2 - 1 / 30))
    assert meter.rate(10.0) == 0


def test_rate_of_too_few_events_is_zero():
    meter = RateMeter()
    assert meter.rate(0.0) == 0
    meter.tick(0.0)
    assert meter.rate(0.0) == 0


def test_deadlines_do_not_drift():
    pacer = Pacer(30, now=100.0)
    for _ in range(30 * 3600):
        pacer.advance(pacer.deadline + 0.004)
    assert pacer.deadline == pytest.approx(100.0 + 3600, abs=1e-5)


def test_a_hiccup_is_not_made_up_for():
    pacer = Pacer(30, now=0.0)
    for _ in range(30):
        pacer.advance(pacer.deadline)
    pacer.advance(61.0)  # a minute of sleep
    assert pacer.deadline == pytest.approx(61.0 + pacer.period)
    pacer.advance(pacer.deadline + 2 * pacer.period)  # two frames late are made up for
    assert pacer.deadline == pytest.approx(61.0 + 2 * pacer.period)


@pytest.mark.parametrize("phase", [0.0, 0.1, 0.3, 0.5, 0.8, 0.99])
def test_deadlines_settle_just_after_pictures_that_come_at_the_frame_rate(phase):
    pacer, waits = Pacer(30, now=0.0), []
    for _ in range(300):
        waited = (pacer.deadline - phase * pacer.period) % pacer.period
        pacer.advance(pacer.deadline, waited)
        waits.append(waited)
    assert waits[-1] == pytest.approx(Pacer.MARGIN * pacer.period, abs=0.02 * pacer.period)


@pytest.mark.parametrize("picture_fps", [7.3, 15.0, 24.0, 25.0, 29.97, 60.0])
def test_the_long_run_rate_is_kept_whatever_the_pictures_rate(picture_fps):
    pacer, ticks = Pacer(30, now=0.0), 0
    latest = -1
    while pacer.deadline < 60:
        newest = int(pacer.deadline * picture_fps + 0.3)
        arrived = (newest - 0.3) / picture_fps
        pacer.advance(pacer.deadline, pacer.deadline - arrived if newest != latest else None)
        latest, ticks = newest, ticks + 1
    assert ticks == pytest.approx(1800, rel=0.004)
