"""Simulated brightness of a scene under a blinking light with a rolling shutter, integrated over many moments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relit_camera.capture.film.flash.flash_signal import BrightnessGrid

ROWS, COLUMNS = 32, 24
_MOMENTS = 120


LIT_ROWS, LIT_COLUMNS = slice(8, 32), slice(4, 28)
"""Of the 32 rows or columns, those in which the light shows."""


@dataclass(frozen=True)
class Blinking:
    """A video of a person under a blinking light.

    Attributes:
        fps, seconds, hz, duty, exposure_s, readout_s: as their names say; readout by columns if `sideways`.
        phase: fraction of a period that has passed at the beginning.
        jitter_s: standard deviation of each flash's start.
        uneven_s: standard deviation of each frame's time.
        hunting: how much the gain swings (logarithm); `wall` whether something that the light does not reach shows it.
        ambient: light without the flash.
        lapses: times at which the light points elsewhere.
    """

    fps: float = 30.0
    seconds: float = 8.0
    hz: float = 5.0
    duty: float = 0.5
    exposure_s: float = 1 / 60
    readout_s: float = 0.018
    sideways: bool = False
    phase: float = 0.3
    jitter_s: float = 0.0
    uneven_s: float = 0.0
    hunting: float = 0.2
    wall: bool = True
    ambient: float = 0.06
    lapses: tuple[float, ...] = ()
    seed: int = 0


def film(scene: Blinking) -> tuple[BrightnessGrid, np.ndarray]:
    """The brightness, and the lit fraction (frames, 32) of each row, or column."""
    rng = np.random.default_rng(scene.seed)
    frames = round(scene.fps * scene.seconds)
    times = np.arange(frames) / scene.fps + np.abs(rng.normal(0, scene.uneven_s, frames))
    times -= times[0]
    flashes = int(scene.seconds * scene.hz) + 4
    starts = (np.arange(flashes) - 1 - scene.phase) / scene.hz + rng.normal(0, scene.jitter_s, flashes)
    places = (np.arange(32) + 0.5) / 32
    moments = (np.arange(_MOMENTS) + 0.5) / _MOMENTS * scene.exposure_s
    clock = times[:, None, None] + scene.readout_s * places[:, None] + moments
    since = clock - starts[np.clip(np.searchsorted(starts, clock) - 1, 0, flashes - 1)]
    fractions = ((since >= 0) & (since < scene.duty / scene.hz)).mean(axis=2)
    person = np.zeros((ROWS, COLUMNS))
    person[8:, 6:18] = 1 + 0.3 * rng.random((ROWS - 8, 12))
    person[24:, 2:22] = 0.8
    # The light goes about: now one side is nearer to it, now the other.
    side = np.linspace(-1, 1, COLUMNS) * np.sin(0.9 * times)[:, None] * 0.5 + 0.8
    strength = 1 - 0.85 * sum(np.exp(-(((times - lapse) / 0.25) ** 2)) for lapse in scene.lapses)
    lit = fractions[:, None, np.arange(COLUMNS) * 32 // COLUMNS] if scene.sideways else fractions[:, :, None]
    flash = 0.5 * person * side[:, None, :] * np.broadcast_to(strength, frames)[:, None, None] * lit
    ambient = scene.ambient * np.where(person > 0, 0.5 * person, 1.0 if scene.wall else 0.02)
    gain = np.exp(scene.hunting * np.sin(2.1 * times) - 0.05 * fractions.mean(axis=1) * (scene.hunting > 0))
    noise = rng.normal(0, 0.0006, (frames, ROWS, COLUMNS))
    cells = np.maximum((ambient + flash) * gain[:, None, None] + noise, 0)
    return BrightnessGrid(cells.astype(np.float32), times, (540, 720), np.zeros((32, 24, 3), np.uint8)), fractions
