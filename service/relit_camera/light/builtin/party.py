"""A party in two colours: magenta from the left, cyan from the right, haze and lights out of focus behind."""

from __future__ import annotations

import numpy as np

from relit_camera.light.builtin.canvas import (
    Canvas,
    angle_from,
    bearings,
    blur,
    colour,
    noise,
    over,
    panel,
    stamp,
    step,
)

MAGENTA, CYAN = "#ff1f9c", "#12c8ff"


def paint() -> Canvas:
    """Radiance (512, 1024, 3) in viewer axes."""
    bearing, elevation = bearings()
    side = np.sin(np.radians(bearing))[..., None]
    haze = np.exp(-0.5 * ((elevation - 4) / 20) ** 2)[..., None] * (
        1 + 0.35 * noise(bearing / 30, elevation / 18, 5)[..., None]
    )
    tint = step(0.75, -0.75, side) * colour(MAGENTA) + step(-0.75, 0.75, side) * colour(CYAN)
    canvas = (colour("#07060d") + 0.16 * haze * tint + 0.05 * haze * colour("#5a30ff")).astype(np.float32)
    canvas = _beams(canvas)
    _lights(canvas)
    canvas = blur(canvas, 0.2, 0.2)
    # The floor is polished: it shows the room again, dimmer and drawn out.
    mirrored = blur(canvas[::-1], 0.8, 3.0) * np.float32(0.3)
    canvas = over(canvas, step(-7, -10, elevation), mirrored)
    canvas = over(canvas, panel(-66, 12, 44, 62, 6), colour(MAGENTA, 6.0))
    canvas = over(canvas, panel(64, 12, 44, 62, 6), colour(CYAN, 4.2))
    return over(canvas, panel(0, 38, 34, 18, 5), colour("#ffe3c8", 1.6))


def _beams(canvas: Canvas) -> Canvas:
    """Spotlights under the ceiling with their cones in the haze."""
    bearing, elevation = bearings()
    for at, lean, code in ((-40, 0.55, MAGENTA), (-17, 0.2, "#7a3cff"), (17, -0.25, "#3a6bff"), (40, -0.6, CYAN)):
        below = 30 - elevation
        off = np.abs(bearing - at - lean * below) / (1.2 + 0.13 * np.maximum(below, 0))
        cone = np.exp(-0.5 * off**2) * step(0, 2, below) * np.exp(-np.maximum(below, 0) / 22)
        canvas = canvas + cone[..., None].astype(np.float32) * colour(code, 0.55)
        lamp = step(1.6, 0.9, angle_from(180 - at, 30))
        canvas = over(canvas, lamp, colour(code, 14.0) + np.float32(4.0))
    return canvas


def _lights(canvas: Canvas) -> None:
    """Small lights out of focus, all round. In place."""
    rng = np.random.default_rng(11)
    for _ in range(90):
        bearing, elevation = rng.uniform(-180, 180), rng.normal(4, 6)
        code = rng.choice([MAGENTA, CYAN, "#7a3cff", "#ffb347", "#ff5fc0"])
        stamp(canvas, bearing, elevation, rng.uniform(0.5, 2.1), colour(str(code), rng.uniform(0.12, 0.7)))
