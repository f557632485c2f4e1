"""The sea at sunset: a low golden sun from the right front, a graded sky, pink clouds, a lit path on the water."""

from __future__ import annotations

import numpy as np

from relit_camera.base.easing import smoothstep
from relit_camera.light.environments.builtin.canvas import (
    Canvas,
    angle_from,
    bearings,
    blend_over,
    blur,
    color,
    color_ramp,
    directions,
    fractal_noise,
)

SUN_AZIMUTH, SUN_ELEVATION = 62.0, 11.0


def paint() -> Canvas:
    """Radiance (512, 1024, 3) in viewer axes."""
    _, elevation = bearings()
    sky = _sky(elevation)
    canvas = blend_over(sky, smoothstep(elevation, 0.12, -0.12), _sea(sky))
    return blend_over(canvas, smoothstep(angle_from(SUN_AZIMUTH, SUN_ELEVATION), 3.2, 2.6), color("#ffb45e", 420.0))


def _sky(elevation: Canvas) -> Canvas:
    away = angle_from(SUN_AZIMUTH, 2)
    toward = color_ramp(elevation, [0, 6, 16, 35, 90], [
        color("#ff8f40", 1.9), color("#ffa35c", 1.6), color("#f0a584", 1.1), color("#9496ba", 0.8),
        color("#3f588f", 0.6),
    ])  # fmt: skip
    # Away from the sun: the earth's blue shadow on the horizon and the pink belt of Venus above it.
    opposite = color_ramp(elevation, [0, 2.5, 7, 12, 22, 90], [
        color("#f0b49a", 1.25), color("#f2b8a0", 1.35), color("#eeb4b4", 1.35), color("#c9a9c8", 1.15),
        color("#8fa0cf", 0.95), color("#3a5594", 0.6),
    ])  # fmt: skip
    sky = blend_over(opposite, smoothstep(away, 150, 25), toward)
    sky += (3.2 * np.exp(-away / 13))[..., None] * color("#ffa04c")
    # Clouds lie in a plane: they crowd toward the horizon, and their undersides catch the sun.
    x, y, z = np.moveaxis(directions(), -1, 0)
    height = np.maximum(y, 0.0) + 0.10
    field = fractal_noise(0.45 * x / height, 1.3 * z / height, 43, 6)
    cover = smoothstep(field, -0.1, 0.9) * smoothstep(elevation, 1.2, 7)
    lit = color_ramp(away, [0, 50, 110, 180], [
        color("#ffc27a", 2.8), color("#ff9a78", 1.9), color("#ff9f9a", 1.6), color("#e8a3b4", 1.3),
    ])  # fmt: skip
    thickness = 1.15 - 0.6 * smoothstep(field, 0.3, 1.5)[..., None]
    return blend_over(sky, np.asarray(0.8 * cover, np.float32), lit * thickness)


def _sea(sky: Canvas) -> Canvas:
    x, y, z = np.moveaxis(directions(), -1, 0)
    depth = 1.6 / np.maximum(-y, 0.004)
    waves = fractal_noise(0.5 * x * depth, 1.5 * z * depth, 41, 5) * np.exp(-depth / 60)
    # Fresnel (Schlick 1994). Waves far out turn their faces to the viewer: even there the sea is darker than the sky.
    mirror = 0.02 + 0.75 * (1 - np.abs(y)) ** 6
    reflected = blur(sky[::-1], 1.5, 3.0)
    glint = np.clip(0.85 + 0.45 * waves, 0.2, 2)
    water = (mirror * glint)[..., None] * reflected + (1 - mirror)[..., None] * color("#1d4a66", 0.7)
    aside = np.degrees(np.abs(np.angle(np.exp(1j * (np.arctan2(x, z) - np.radians(SUN_AZIMUTH))))))
    path = np.exp(-0.5 * (aside / 7) ** 2) * smoothstep(y, -1.0, -0.02) * np.clip(1 + 1.3 * waves, 0, 3)
    return np.asarray(water + path[..., None] * color("#ffa652", 3.0), np.float32)
