"""A meadow under an overcast sky: soft neutral light from above, a green bounce from below."""

from __future__ import annotations

import numpy as np

from relit_camera.base.easing import smoothstep
from relit_camera.light.environments.builtin.canvas import (
    Canvas,
    bearings,
    blend_over,
    blur,
    color,
    color_ramp,
    directions,
    fractal_noise,
)


def paint() -> Canvas:
    """Radiance (512, 1024, 3) in viewer axes."""
    bearing, elevation = bearings()
    canvas = _sky(elevation)
    far = 2.6 + 1.3 * fractal_noise(bearing / 24, np.full_like(bearing, 3.0), 21, 3)
    near = 0.8 + 1.1 * fractal_noise(bearing / 13, np.full_like(bearing, 9.0), 22, 5)
    canvas = blend_over(canvas, smoothstep(elevation - far, 0.35, -0.35), color("#8fa0ab", 1.5))
    canvas = blend_over(canvas, smoothstep(elevation - near, 0.3, -0.3), color("#5f7470", 1.2))
    canvas = blend_over(
        canvas,
        _trees(bearing, elevation),
        color("#2e3d2c", 1.1) * (1 + 0.3 * fractal_noise(bearing, elevation, 24)[..., None]),
    )
    return blend_over(canvas, smoothstep(elevation, 0.1, -0.5), _meadow(elevation))


def _sky(elevation: Canvas) -> Canvas:
    # Flatter than the CIE overcast sky, whose zenith is three times as bright as its horizon: thin, even cloud.
    up = np.sin(np.radians(np.maximum(elevation, 0)))
    tint = color_ramp(up, [0, 0.3, 1], [color("#e9edf0"), color("#e3e8ee"), color("#dfe6ee")])
    x, y, z = np.moveaxis(directions(), -1, 0)
    height = np.maximum(y, 0.02) + 0.06
    cloud = fractal_noise(0.8 * x / height, 0.8 * z / height, 20, 6)
    shade = 1 + 0.2 * cloud * smoothstep(elevation, 0, 9) * (1 - 0.3 * up)
    return np.asarray((1.1 * (1 + 0.9 * up) * shade)[..., None] * tint, np.float32)


def _trees(bearing: Canvas, elevation: Canvas) -> Canvas:
    """A row of bushes and trees at the meadow's end, in groups."""
    group = np.clip(0.5 + fractal_noise(bearing / 16, np.full_like(bearing, 1.0), 25, 2), 0, 1.4)
    crown = group * (1.6 + 1.2 * fractal_noise(bearing / 2.6, np.full_like(bearing, 5.0), 26, 4)) - 0.2
    ragged = 0.35 * fractal_noise(bearing * 1.3, elevation * 1.3, 27, 3)
    return smoothstep(elevation - crown - ragged, 0.15, -0.15)


def _meadow(elevation: Canvas) -> Canvas:
    x, y, z = np.moveaxis(directions(), -1, 0)
    depth = 1.6 / np.maximum(-y, 0.006)
    broad = fractal_noise(0.12 * x * depth, 0.12 * z * depth, 28, 4)
    # Blades are finer than a pixel far away: their contrast fades with distance instead of flickering.
    blades = fractal_noise(6 * x * depth, 6 * z * depth, 29, 3) * np.exp(-depth / 14)
    grass = color_ramp(
        np.clip(0.5 + 0.35 * broad, 0, 1), [0, 0.5, 1], [color("#46562c"), color("#66743c"), color("#8b8a52")]
    )
    lit = grass * (1 + 0.35 * blades)[..., None] * np.float32(1.7)
    mist = np.exp(elevation / 2.2)[..., None]
    return blur(np.asarray(np.maximum(lit, 0) * (1 - mist) + mist * color("#7f8b78", 1.5), np.float32), 0.1, 0.1)
