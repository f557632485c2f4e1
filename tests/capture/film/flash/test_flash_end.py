"""The end of the flashes: found where some seconds in constant light follow, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relit_camera.capture.film.flash.flash_end import count_flashing_frames
from relit_camera.capture.film.flash.flash_signal import BrightnessGrid
from tests.capture.film.blinking_film import Blinking, film


def followed_by(scene: Blinking, seconds: float, light: float) -> tuple[BrightnessGrid, int]:
    """A film whose lamp stops, while the room has that much light, and somebody moves in it; and the last flash."""
    flashing, _ = film(scene)
    count = round(seconds * scene.fps)
    rng = np.random.default_rng(1)
    times = np.arange(count) / scene.fps
    still = np.full((count, *flashing.cells.shape[1:]), light, np.float32)
    still[:, 8:24, 6:18] *= (1 + 0.4 * np.sin(2 * np.pi * 0.4 * times))[:, None, None]  # a head that turns
    still *= 1 + rng.normal(0, 0.01, (count, 1, 1))
    cells = np.concatenate([flashing.cells, still.astype(np.float32)])
    after = flashing.times_s[-1] + (np.arange(count) + 1) / scene.fps
    return replace(flashing, cells=cells, times_s=np.concatenate([flashing.times_s, after])), len(flashing.times_s)


@pytest.mark.parametrize("light", [0.03, 0.06, 0.4])
@pytest.mark.parametrize("scene", [Blinking(), Blinking(hz=2.5, fps=60), Blinking(jitter_s=0.01, seconds=20)])
def test_what_follows_in_constant_light_is_cut_off(scene: Blinking, light: float) -> None:
    brightness, last = followed_by(scene, 12, light)
    assert count_flashing_frames(brightness) == pytest.approx(last, abs=scene.fps / 2)


@pytest.mark.parametrize(
    "scene",
    [Blinking(), Blinking(hz=2.5), Blinking(hunting=0.4, wall=False), Blinking(seconds=30, lapses=(26.0, 27.0, 28.0))],
)
def test_a_film_that_ends_with_the_flashes_is_whole(scene: Blinking) -> None:
    brightness, _ = film(scene)
    assert count_flashing_frames(brightness) == len(brightness.times_s)


def test_a_second_or_two_after_the_flashes_are_no_coda() -> None:
    brightness, _ = followed_by(Blinking(), 3, 0.06)
    assert count_flashing_frames(brightness) == len(brightness.times_s)


def test_a_film_without_flashes_is_left_to_those_who_refuse_it() -> None:
    brightness, last = followed_by(Blinking(), 20, 0.2)
    steady = replace(brightness, cells=brightness.cells[last:], times_s=brightness.times_s[last:])
    assert count_flashing_frames(steady) == len(steady.times_s)
