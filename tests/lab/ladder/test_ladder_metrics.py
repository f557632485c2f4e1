"""Figures of the ladder: what counts as an error, and what does not."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.images.tone_mapping import display_from_linear
from relit_camera.lab.evaluate.field.relighting_metrics import MAX_DB
from relit_camera.lab.evaluate.ladder.ladder_metrics import brightness_ev, field_figures, shown_psnr, tinted

ALL = np.ones((8, 8), bool)


def some_light(seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0.05, 0.7, (8, 8, 3)).astype(np.float32)


def test_brightness_alone_is_no_error_of_what_is_shown() -> None:
    truth = some_light()
    assert shown_psnr(display_from_linear(truth), truth, ALL) > 55
    assert shown_psnr(display_from_linear(truth * np.float32(0.5)), truth, ALL) > 45
    tint = np.array([1.3, 1.0, 0.7], np.float32)
    assert shown_psnr(display_from_linear(truth * tint), truth, ALL) < 30


def test_brightness_is_told_in_stops() -> None:
    truth, darker = (np.asarray(some_light() / divisor, np.float32) for divisor in (2, 4))
    assert brightness_ev(display_from_linear(truth), truth, ALL) == pytest.approx(0, abs=0.01)
    assert brightness_ev(display_from_linear(darker), truth, ALL) == pytest.approx(-1, abs=0.02)


def test_the_shown_figure_is_psnr_of_codes() -> None:
    truth = np.full((8, 8, 3), 0.3, np.float32)
    shown = display_from_linear(truth)
    shown[:4] += 10
    shown[4:] -= 10
    assert shown_psnr(shown, truth, ALL) == pytest.approx(20 * np.log10(255 / 10), abs=0.3)
    half = ALL.copy()
    half[4:] = False
    assert shown_psnr(shown, truth, half) > 50  # one gain makes up for it


def test_a_field_is_compared_as_it_is_and_white_balanced() -> None:
    truth = np.stack([some_light(1), 3 * some_light(2)])
    gain = np.array([1.2, 1.0, 0.8], np.float32)
    figures = field_figures(truth * gain, truth, ALL)
    peak = np.percentile(truth[0], 99.5)
    error = np.mean(((truth[0] * (gain - 1)) / peak) ** 2)
    assert figures.as_is_db[0] == pytest.approx(-10 * np.log10(error), abs=1e-3)
    assert figures.white_balanced_db.min() > 90
    assert field_figures(truth, truth, ALL).as_is_db.tolist() == [MAX_DB, MAX_DB]


def test_one_balance_serves_all_environments() -> None:
    truth = np.stack([some_light(1), some_light(2)])
    seen = truth * np.array([[1.2], [0.8]], np.float32)[..., None, None]
    assert field_figures(seen, truth, ALL).white_balanced_db.max() < 30


def test_a_tint_gives_the_mean_color_of_what_counts() -> None:
    picture, truth = some_light(1), some_light(2)
    counted = ALL.copy()
    counted[:, :3] = False
    np.testing.assert_allclose(
        tinted(picture, truth, counted)[counted].mean(axis=0), truth[counted].mean(axis=0), rtol=1e-5
    )
