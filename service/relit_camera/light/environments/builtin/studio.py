"""A photographer's studio: a large key light from the front left, a weak fill, two strips behind, lit grey paper."""

from __future__ import annotations

import numpy as np

from relit_camera.base.easing import smoothstep
from relit_camera.light.environments.builtin.canvas import (
    Canvas,
    angle_from,
    bearings,
    blend_over,
    color,
    color_ramp,
    gaussian_glow,
    panel_mask,
)


def paint() -> Canvas:
    """Radiance (512, 1024, 3) in viewer axes."""
    bearing, elevation = bearings()
    paper_roll = color_ramp(elevation, [-90, -30, -14, 10, 90], [
        color("#1a1b20"), color("#34373e"), color("#4b4f58"), color("#3a3e47"), color("#101115"),
    ])  # fmt: skip
    spot = np.exp(-0.5 * ((bearing / 17) ** 2 + ((elevation - 2) / 11) ** 2))[..., None]
    falloff = 0.35 + 0.65 * smoothstep(np.abs(bearing), 150, 40)[..., None]
    canvas = np.asarray(paper_roll * falloff + spot * color("#a9b4c6", 1.5), np.float32)
    # The paper sweeps from wall to floor: a soft, brighter band where it bends, a pool of light on the floor.
    canvas += (smoothstep(elevation, -34, -20) * smoothstep(elevation, -8, -18) * smoothstep(np.abs(bearing), 100, 30))[
        ..., None
    ] * color("#5a606b", 0.2)
    canvas += gaussian_glow(0, -90, 35)[..., None] * color("#4a4d55", 0.5)

    canvas = _softbox(canvas, -42, 32, 52, 52, color("#fff4e4", 9.0))
    canvas = _softbox(canvas, 62, 8, 30, 58, color("#dfeaff", 1.3))
    canvas = _softbox(canvas, -128, 34, 14, 56, color("#eef4ff", 7.0))
    return _softbox(canvas, 130, 30, 14, 56, color("#fff1dc", 5.0))


def _softbox(
    canvas: Canvas, azimuth: float, elevation: float, width: float, height: float, light: np.ndarray
) -> Canvas:
    canvas = blend_over(canvas, panel_mask(azimuth, elevation, width + 5, height + 5, 0.7), color("#08080a"))
    # Brightest in the middle, where the tube is; the cloth loses half of it toward the corners.
    fall = 0.5 + 0.5 * np.exp(-((angle_from(azimuth, elevation) / (0.45 * max(width, height))) ** 2))
    cloth = (fall[..., None] * light).astype(np.float32)
    return blend_over(canvas, panel_mask(azimuth, elevation, width, height, 0.9), cloth)
