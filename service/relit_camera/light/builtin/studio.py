"""A photographer's studio: a large key from the front left, a weak fill, two strips behind, a lit grey backdrop."""

from __future__ import annotations

import numpy as np

from relit_camera.light.builtin.canvas import Canvas, angle_from, bearings, colour, glow, over, panel, ramp, step


def paint() -> Canvas:
    """Radiance (512, 1024, 3) in viewer axes."""
    bearing, elevation = bearings()
    backdrop = ramp(elevation, [-90, -30, -14, 10, 90], [
        colour("#1a1b20"), colour("#34373e"), colour("#4b4f58"), colour("#3a3e47"), colour("#101115"),
    ])  # fmt: skip
    spot = np.exp(-0.5 * ((bearing / 17) ** 2 + ((elevation - 2) / 11) ** 2))[..., None]
    canvas = backdrop * (0.35 + 0.65 * step(150, 40, np.abs(bearing)))[..., None] + spot * colour("#a9b4c6", 1.5)
    canvas = canvas.astype(np.float32)
    # The paper sweeps from wall to floor: a soft, brighter band where it bends, a pool of light on the floor.
    canvas += (step(-34, -20, elevation) * step(-8, -18, elevation) * step(100, 30, np.abs(bearing)))[
        ..., None
    ] * colour("#5a606b", 0.2)
    canvas += glow(0, -90, 35)[..., None] * colour("#4a4d55", 0.5)

    canvas = _softbox(canvas, -42, 32, 52, 52, colour("#fff4e4", 9.0))
    canvas = _softbox(canvas, 62, 8, 30, 58, colour("#dfeaff", 1.3))
    canvas = _softbox(canvas, -128, 34, 14, 56, colour("#eef4ff", 7.0))
    return _softbox(canvas, 130, 30, 14, 56, colour("#fff1dc", 5.0))


def _softbox(
    canvas: Canvas, azimuth: float, elevation: float, width: float, height: float, light: np.ndarray
) -> Canvas:
    canvas = over(canvas, panel(azimuth, elevation, width + 5, height + 5, 0.7), colour("#08080a"))
    # Brightest in the middle, where the tube is; the cloth loses half of it toward the corners.
    fall = 0.5 + 0.5 * np.exp(-((angle_from(azimuth, elevation) / (0.45 * max(width, height))) ** 2))
    cloth = (fall[..., None] * light).astype(np.float32)
    return over(canvas, panel(azimuth, elevation, width, height, 0.9), cloth)
