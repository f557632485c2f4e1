"""A street at night: a warm shop front and a neon sign light the face, lamps out of focus lead away over wet ground."""

from __future__ import annotations

import numpy as np

from relit_camera.base.easing import smoothstep
from relit_camera.light.environments.builtin.canvas import (
    Canvas,
    add_bokeh_disc,
    angle_from,
    bearings,
    blend_over,
    blur,
    color,
    color_ramp,
    directions,
    fractal_noise,
    gaussian_glow,
    panel_mask,
)

LAMP, SHOP, NEON_PINK, NEON_TEAL = "#ffb066", "#ffcf94", "#ff2f7d", "#22e0d0"


def paint() -> Canvas:
    """Radiance (512, 1024, 3) in viewer axes."""
    bearing, elevation = bearings()
    canvas = color_ramp(elevation, [-90, 0, 14, 50, 90], [
        color("#120f14"), color("#4a3a40", 0.8), color("#251f33"), color("#10121f"), color("#0a0c16"),
    ])  # fmt: skip
    canvas = _houses(canvas, bearing, elevation)
    _lights(canvas)
    canvas = blur(canvas, 0.2, 0.2)
    canvas = _shops(canvas)
    wet = blur(canvas[::-1], 0.35, 3.2)
    x, y, z = np.moveaxis(directions(), -1, 0)
    depth = 1.6 / np.maximum(-y, 0.01)
    puddles = 0.32 + 0.2 * fractal_noise(0.35 * x * depth, 0.35 * z * depth, 51, 5) * np.exp(-depth / 40)
    mirror = np.clip(puddles, 0.06, 0.6) * (0.25 + 0.75 * (1 - np.abs(y)) ** 3)
    return blend_over(canvas, smoothstep(elevation, 0.2, -0.4), color("#0b0b10") + wet * mirror[..., None])


def _houses(canvas: Canvas, bearing: Canvas, elevation: Canvas) -> Canvas:
    """Two rows of house fronts 6 m to both sides, along the street, and their windows."""
    x, y, z = np.moveaxis(directions(), -1, 0)
    along = 6 * z / np.maximum(np.abs(x), 1e-3)
    up = 1.6 + 6 * y / np.maximum(np.abs(x), 1e-3)
    block = np.floor(along / 9 + 40 * (x > 0)).astype(np.intp)
    rng = np.random.default_rng(50)
    heights, tints = rng.uniform(9, 17, 512), rng.uniform(0.6, 1.4, 512)
    front = (up < heights[block % 512]) & (np.abs(along) < 90)
    lamp_light = np.exp(-np.abs(up - 3.5) / 5) * (0.6 + 0.4 * np.cos(along * 2 * np.pi / 14))
    wall = tints[block % 512][..., None] * (color("#1b171c") + lamp_light[..., None] * color("#5a3a24"))
    fog = np.exp(-np.abs(along) / 45)[..., None]
    canvas = np.where(front[..., None], wall * fog + (1 - fog) * color("#43353c", 0.8), canvas).astype(np.float32)
    column, floor = np.floor(along / 2.2).astype(np.intp), np.floor(up / 3.1).astype(np.intp)
    inside = (np.abs(along / 2.2 - column - 0.5) < 0.26) & (np.abs(up / 3.1 - floor - 0.55) < 0.3) & (floor > 0)
    lit = rng.random((512, 8)) < 0.3
    glass = inside & front & lit[(column + 97 * (x > 0)) % 512, floor % 8] & (np.abs(along) < 70)
    warm = rng.uniform(0.2, 1.0, 512)[(column * 7 + floor) % 512][..., None] * color_ramp(
        rng.random(512)[(column * 3 + floor * 5) % 512],
        [0, 0.7, 1],
        [color("#ffb468"), color("#ffdca8"), color("#a8c8ff")],
    )
    return np.where(glass[..., None], warm * fog, canvas).astype(np.float32)


def _lights(canvas: Canvas) -> None:
    """Street lamps in two rows both ways, and small lights of cars and shops at the street's ends. In place."""
    rng = np.random.default_rng(52)
    for distance in (9, 14, 20, 28, 38, 52):
        for side in (-1, 1):
            for ahead in (1, -1):
                bearing = np.degrees(np.arctan2(side * 4.2, ahead * distance))
                elevation = np.degrees(np.arctan2(3.4, np.hypot(4.2, distance)))
                add_bokeh_disc(canvas, bearing, elevation, 0.7 + 9 / distance, color(LAMP, 6.0))
    for _ in range(70):
        code = str(rng.choice([LAMP, SHOP, "#ff4a3a", "#ffe9c8", NEON_TEAL, NEON_PINK, "#6fa8ff"]))
        bearing = rng.normal(0, 13) + rng.choice([0, 180])
        add_bokeh_disc(
            canvas, bearing, rng.gamma(2.0, 0.9) + 0.2, rng.uniform(0.35, 1.15), color(code, rng.uniform(0.3, 1.6))
        )


def _shops(canvas: Canvas) -> Canvas:
    """What lights the face: a shop front, neon signs, a street lamp overhead."""
    canvas = blend_over(canvas, panel_mask(-52, 6, 58, 34, 1.5), color(SHOP, 2.6))
    for azimuth in (-71, -52, -33):
        canvas = blend_over(canvas, panel_mask(azimuth, 6, 1.2, 36, 0.3), color("#1a1410"))
    canvas = blend_over(canvas, panel_mask(72, 16, 7, 40, 1.0), color(NEON_PINK, 9.0))
    canvas = blend_over(canvas, panel_mask(98, 14, 5, 30, 1.0), color(NEON_TEAL, 7.0))
    canvas = blend_over(canvas, panel_mask(-140, 12, 5, 18, 0.6), color(NEON_TEAL, 4.0))
    canvas = blend_over(canvas, panel_mask(141, 10, 16, 5, 0.6), color(NEON_PINK, 4.0))
    halo = gaussian_glow(72, 16, 14)[..., None] * color(NEON_PINK, 0.5) + gaussian_glow(-140, 12, 9)[..., None] * color(
        NEON_TEAL, 0.2
    )
    halo += gaussian_glow(141, 10, 9)[..., None] * color(NEON_PINK, 0.2)
    return blend_over(canvas + halo, smoothstep(angle_from(20, 52), 4.5, 3.0), color(LAMP, 60.0))
