"""The sea at sunset: a low golden sun from the right front, a graded sky, pink clouds, a lit path on the water."""

from __future__ import annotations

import numpy as np

from relit_camera.light.builtin.canvas import (
    Canvas,
    angle_from,
    bearings,
    blur,
    colour,
    directions,
    noise,
    over,
    ramp,
    step,
)

SUN_AZIMUTH, SUN_ELEVATION = 62.0, 11.0


def paint() -> Canvas:
    """Radiance (512, 1024, 3) in viewer axes."""
    _, elevation = bearings()
    sky = _sky(elevation)
    canvas = over(sky, step(0.12, -0.12, elevation), _sea(sky))
    return over(canvas, step(3.2, 2.6, angle_from(SUN_AZIMUTH, SUN_ELEVATION)), colour("#ffb45e", 420.0))


def _sky(elevation: Canvas) -> Canvas:
    away = angle_from(SUN_AZIMUTH, 2)
    toward = ramp(elevation, [0, 6, 16, 35, 90], [
        colour("#ff8f40", 1.9), colour("#ffa35c", 1.6), colour("#f0a584", 1.1), colour("#9496ba", 0.8),
        colour("#3f588f", 0.6),
    ])  # fmt: skip
    # Away from the sun: the earth's blue shadow on the horizon and the pink belt of Venus above it.
    opposite = ramp(elevation, [0, 2.5, 7, 12, 22, 90], [
        colour("#f0b49a", 1.25), colour("#f2b8a0", 1.35), colour("#eeb4b4", 1.35), colour("#c9a9c8", 1.15),
        colour("#8fa0cf", 0.95), colour("#3a5594", 0.6),
    ])  # fmt: skip
    sky = over(opposite, step(150, 25, away), toward)
    sky += (3.2 * np.exp(-away / 13))[..., None] * colour("#ffa04c")
    # Clouds lie in a plane: they crowd toward the horizon, and their undersides catch the sun.
    x, y, z = np.moveaxis(directions(), -1, 0)
    height = np.maximum(y, 0.0) + 0.10
    field = noise(0.45 * x / height, 1.3 * z / height, 43, 6)
    cover = step(-0.1, 0.9, field) * step(1.2, 7, elevation)
    lit = ramp(away, [0, 50, 110, 180], [
        colour("#ffc27a", 2.8), colour("#ff9a78", 1.9), colour("#ff9f9a", 1.6), colour("#e8a3b4", 1.3),
    ])  # fmt: skip
    return over(sky, 0.8 * cover, lit * (1.15 - 0.6 * step(0.3, 1.5, field))[..., None])


def _sea(sky: Canvas) -> Canvas:
    x, y, z = np.moveaxis(directions(), -1, 0)
    depth = 1.6 / np.maximum(-y, 0.004)
    waves = noise(0.5 * x * depth, 1.5 * z * depth, 41, 5) * np.exp(-depth / 60)
    # Fresnel (Schlick 1994). Waves far out turn their faces to the viewer: even there the sea is darker than the sky.
    mirror = 0.02 + 0.75 * (1 - np.abs(y)) ** 6
    reflected = blur(sky[::-1], 1.5, 3.0)
    glint = np.clip(0.85 + 0.45 * waves, 0.2, 2)
    water = (mirror * glint)[..., None] * reflected + (1 - mirror)[..., None] * colour("#1d4a66", 0.7)
    aside = np.degrees(np.abs(np.angle(np.exp(1j * (np.arctan2(x, z) - np.radians(SUN_AZIMUTH))))))
    path = np.exp(-0.5 * (aside / 7) ** 2) * step(-1.0, -0.02, y) * np.clip(1 + 1.3 * waves, 0, 3)
    return np.asarray(water + path[..., None] * colour("#ffa652", 3.0), np.float32)
