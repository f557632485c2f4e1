"""Deadlines of the publisher: no drift, no catching up, settling just after the pictures."""

from __future__ import annotations

import pytest

from relit_camera.live.publishing.pacing import Pacer


def test_deadlines_do_not_drift() -> None:
    pacer = Pacer(30, now=100.0)
    for _ in range(30 * 3600):
        pacer.advance(pacer.deadline + 0.004)
    assert pacer.deadline == pytest.approx(100.0 + 3600, abs=1e-5)


def test_a_hiccup_is_not_made_up_for() -> None:
    pacer = Pacer(30, now=0.0)
    for _ in range(30):
        pacer.advance(pacer.deadline)
    pacer.advance(61.0)  # a minute of sleep
    assert pacer.deadline == pytest.approx(61.0 + pacer.period)
    pacer.advance(pacer.deadline + 2 * pacer.period)  # two frames late are made up for
    assert pacer.deadline == pytest.approx(61.0 + 2 * pacer.period)


@pytest.mark.parametrize("phase", [0.0, 0.1, 0.3, 0.5, 0.8, 0.99])
def test_deadlines_settle_just_after_pictures_that_come_at_the_frame_rate(phase: float) -> None:
    pacer = Pacer(30, now=0.0)
    waits: list[float] = []
    for _ in range(300):
        waited = (pacer.deadline - phase * pacer.period) % pacer.period
        pacer.advance(pacer.deadline, waited)
        waits.append(waited)
    assert waits[-1] == pytest.approx(Pacer.MARGIN * pacer.period, abs=0.02 * pacer.period)


@pytest.mark.parametrize("picture_fps", [7.3, 15.0, 24.0, 25.0, 29.97, 60.0])
def test_the_long_run_rate_is_kept_whatever_the_pictures_rate(picture_fps: float) -> None:
    pacer, ticks = Pacer(30, now=0.0), 0
    latest = -1
    while pacer.deadline < 60:
        newest = int(pacer.deadline * picture_fps + 0.3)
        arrived = (newest - 0.3) / picture_fps
        pacer.advance(pacer.deadline, pacer.deadline - arrived if newest != latest else None)
        latest, ticks = newest, ticks + 1
    assert ticks == pytest.approx(1800, rel=0.004)
