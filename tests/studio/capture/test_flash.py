"""The blinking torch before a rolling shutter, against a sum over time."""

from __future__ import annotations

import numpy as np
import pytest

from relit_studio.capture.flash.flash_timing import FlashSchedule, RollingShutter, flash_state

SCHEDULE = FlashSchedule(frequency_hz=5.07, duty=0.45, phase_s=0.031)
SHUTTER = RollingShutter(fps=30.0, exposure_s=1 / 50, readout_s=0.021, height=60)


def lit_at(times: np.ndarray) -> np.ndarray:
    return np.mod((times - 0.031) * 5.07, 1.0) < 0.45


@pytest.mark.parametrize("index", [0, 1, 2, 5, 9, 40, 171])
def test_fraction_of_each_row_is_the_time_lit_in_its_exposure(index: int) -> None:
    start = index / 30 + 0.021 * (np.arange(60) + 0.5) / 60
    moments = (np.arange(20000) + 0.5) / 20000 / 50
    expected = [lit_at(row + moments).mean() for row in start]
    np.testing.assert_allclose(SHUTTER.lit_fraction(SCHEDULE, index), expected, atol=2e-4)


def test_knots_say_the_same_exactly() -> None:
    heights = np.arange(60) + 0.5
    for index in range(60):
        y, fraction = np.array(SHUTTER.lit_knots(SCHEDULE, index)).T
        np.testing.assert_allclose(np.interp(heights, y, fraction), SHUTTER.lit_fraction(SCHEDULE, index), atol=1e-9)
        assert (np.diff(y) > 0).all()


def test_long_run_is_lit_for_the_duty() -> None:
    assert SCHEDULE.lit_seconds(0.0, 1000.0) / 1000 == pytest.approx(0.45, abs=1e-3)


def test_all_kinds_of_frames_happen_and_bands_move() -> None:
    fractions = [SHUTTER.lit_fraction(SCHEDULE, index) for index in range(120)]
    states = [flash_state(fraction) for fraction in fractions]
    assert {"bright", "dark", "partial"} == set(states)
    bands = [fraction for fraction in fractions if fraction.min() < 0.02 and fraction.max() > 0.98]
    assert bands, "a band is seen where some rows are wholly lit and others not at all"


def test_global_shutter_lights_all_rows_alike() -> None:
    shutter = RollingShutter(fps=30.0, exposure_s=1 / 50, readout_s=0.0, height=60)
    for index in range(12):
        assert np.ptp(shutter.lit_fraction(SCHEDULE, index)) < 1e-9
        assert [y for y, _ in shutter.lit_knots(SCHEDULE, index)] == [0.0, 60.0]
