"""A party in two colours: magenta from the left, cyan from the right, haze and lights out of focus behind."""

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
    fractal_noise,
    panel_mask,
)

MAGENTA, CYAN = "#ff1f9c", "#12c8ff"


def paint() -> Canvas:
    """Radiance (512, 1024, 3) in viewer axes."""
    bearing, elevation = bearings()
    side = np.sin(np.radians(bearing))[..., None]
    haze = np.exp(-0.5 * ((elevation - 4) / 20) ** 2)[..., None] * (
        1 + 0.35 * fractal_noise(bearing / 30, elevation / 18, 5)[..., None]
    )
    tint = smoothstep(side, 0.75, -0.75) * color(MAGENTA) + smoothstep(side, -0.75, 0.75) * color(CYAN)
    canvas = (color("#07060d") + 0.16 * haze * tint + 0.05 * haze * color("#5a30ff")).astype(np.float32)
    canvas = _beams(canvas)
    _lights(canvas)
    canvas = blur(canvas, 0.2, 0.2)
    # The floor is polished: it shows the room again, dimmer and drawn out.
    mirrored = blur(canvas[::-1], 0.8, 3.0) * np.float32(0.3)
    canvas = blend_over(canvas, smoothstep(elevation, -7, -10), mirrored)
    canvas = blend_over(canvas, panel_mask(-66, 12, 44, 62, 6), color(MAGENTA, 6.0))
    canvas = blend_over(canvas, panel_mask(64, 12, 44, 62, 6), color(CYAN, 4.2))
    return blend_over(canvas, panel_mask(0, 38, 34, 18, 5), color("#ffe3c8", 1.6))


def _beams(canvas: Canvas) -> Canvas:
    """Spotlights under the ceiling with their cones in the haze."""
    bearing, elevation = bearings()
    for at, lean, code in ((-40, 0.55, MAGENTA), (-17, 0.2, "#7a3cff"), (17, -0.25, "#3a6bff"), (40, -0.6, CYAN)):
        below = 30 - elevation
        off = np.abs(bearing - at - lean * below) / (1.2 + 0.13 * np.maximum(below, 0))
        cone = np.exp(-0.5 * off**2) * smoothstep(below, 0, 2) * np.exp(-np.maximum(below, 0) / 22)
        canvas = canvas + cone[..., None].astype(np.float32) * color(code, 0.55)
        lamp = smoothstep(angle_from(180 - at, 30), 1.6, 0.9)
        canvas = blend_over(canvas, lamp, color(code, 14.0) + np.float32(4.0))
    return canvas


def _lights(canvas: Canvas) -> None:
    """Small lights out of focus, all round. In place."""
    rng = np.random.default_rng(11)
    for _ in range(90):
        bearing, elevation = rng.uniform(-180, 180), rng.normal(4, 6)
        code = rng.choice([MAGENTA, CYAN, "#7a3cff", "#ffb347", "#ff5fc0"])
        add_bokeh_disc(canvas, bearing, elevation, rng.uniform(0.5, 2.1), color(str(code), rng.uniform(0.12, 0.7)))
