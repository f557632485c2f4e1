"""A room with tall windows on the left: soft daylight from the side, a wooden floor, a lamp in the corner behind."""

from __future__ import annotations

import numpy as np

from relit_camera.base.easing import smoothstep
from relit_camera.light.environments.builtin.canvas import (
    Canvas,
    blend_over,
    blur,
    color,
    color_ramp,
    directions,
    fractal_noise,
)

LEFT, RIGHT, BACK, FRONT, FLOOR, CEILING = -2.3, 2.9, -4.6, 3.4, -1.25, 1.75
"""Walls of the room in metres from the head, in the project's axes."""
SIDE_WINDOWS = ((-2.6, -1.2), (-0.2, 1.2), (1.6, 3.0))
"""From and to along z on the left wall."""
BACK_WINDOW = (-1.9, -0.75)
"""From and to along x on the wall behind."""
SILL, LINTEL = -0.55, 1.45
DAYLIGHT = 7.0
LAMP = np.array([2.25, 0.15, -4.1], np.float32)
_SOFT = 0.015
"""Metres over which edges fade: about half a pixel at the wall behind."""


def paint() -> Canvas:
    """Radiance (512, 1024, 3) in viewer axes."""
    direction = directions()
    low, high = np.array([LEFT, FLOOR, BACK], np.float32), np.array([RIGHT, CEILING, FRONT], np.float32)
    with np.errstate(divide="ignore"):
        reach = np.where(direction < 0, low, high) / direction
    wall = np.argmin(reach, axis=-1)
    point = (direction * np.min(reach, axis=-1, keepdims=True)).astype(np.float32)
    back = (wall == 2) & (direction[..., 2] < 0)
    canvas = _surfaces(point, wall, back) * _daylight(point, wall)[..., None] * color("#f2f5ff")
    canvas = canvas + _lamp_light(point, wall)
    x, y, z = np.moveaxis(point, -1, 0)
    for span in SIDE_WINDOWS:
        canvas = _window(canvas, (wall == 0) & (x < 0), z, y, span)
    canvas = _window(canvas, back, x, y, BACK_WINDOW)
    return _lamp(blur(canvas, 0.12, 0.12))


def _daylight(point: Canvas, wall: np.ndarray) -> Canvas:
    """Irradiance over π (512, 1024) from the windows, as two patches each, and once more off the walls."""
    height, middle = LINTEL - SILL, (LINTEL + SILL) / 2
    patches = [((LEFT, middle + dy, (low + high) / 2), 0, (high - low) * height / 2)
               for low, high in SIDE_WINDOWS for dy in (-height / 4, height / 4)]  # fmt: skip
    patches.append(((sum(BACK_WINDOW) / 2, middle, BACK), 2, (BACK_WINDOW[1] - BACK_WINDOW[0]) * height))
    total = np.zeros(wall.shape, np.float32)
    for center, axis, area in patches:
        toward = np.array(center, np.float32) - point
        # Walls face inward and points lie inside, so both cosines are lengths along an axis.
        received = np.abs(np.take_along_axis(toward, wall[..., None], axis=-1)[..., 0]) * np.abs(toward[..., axis])
        total += np.float32(area / np.pi) * received / ((toward**2).sum(axis=-1) + np.float32(area / 2)) ** 2
    # Light off the other walls: about even, a little less in the corners.
    corner = np.full(wall.shape, 9, np.float32)
    for axis, (low, high) in enumerate(((LEFT, RIGHT), (FLOOR, CEILING), (BACK, FRONT))):
        distance = np.minimum(point[..., axis] - low, high - point[..., axis])
        corner = np.where(wall == axis, corner, np.minimum(corner, distance))
    bounce = 0.075 * (1 - 0.55 * np.exp(-corner / 0.5))
    return np.asarray(DAYLIGHT * (total + bounce), np.float32)


def _surfaces(point: Canvas, wall: np.ndarray, back: np.ndarray) -> Canvas:
    """Albedo (512, 1024, 3) of walls, ceiling, planks, rug, skirting and the picture."""
    x, y, z = np.moveaxis(point, -1, 0)
    paint = np.where(back[..., None], color("#c3cbc9"), color("#d9cfc1"))
    paint = paint * (1 + 0.02 * fractal_noise(3 * (x + z), 3 * y, 60, 3))[..., None]
    paint = blend_over(paint, smoothstep(y, FLOOR + 0.13, FLOOR + 0.11), color("#e8e4dc"))
    paint = _picture(paint, back, x, y)
    flat = wall == 1
    paint = np.where((flat & (y > 0))[..., None], color("#ece8e0"), paint)
    plank = np.floor(x / 0.16).astype(np.intp)
    shade = np.random.default_rng(62).uniform(-0.5, 0.5, 64)[plank % 64] + 0.35 * fractal_noise(
        14 * x, 1.2 * z + 5 * plank, 61, 4
    )
    seam = 1 - 0.5 * smoothstep(np.abs(x / 0.16 - plank - 0.5), 0.44, 0.5).astype(np.float32)
    wood = color_ramp(shade, [-1, 0, 1], [color("#6e4a2e"), color("#94683f"), color("#b98a58")]) * seam[..., None]
    from_middle = np.hypot(x - 0.3, z + 2.4)
    rug = color("#8f4b3a") * (1 + 0.15 * np.tanh(4 * np.sin(from_middle * 14)))[..., None]
    wood = blend_over(wood, smoothstep(from_middle, 1.32, 1.28), rug)
    return np.where((flat & (y < 0))[..., None], wood, paint).astype(np.float32)


def _picture(paint: Canvas, back: np.ndarray, x: Canvas, y: Canvas) -> Canvas:
    """A framed landscape on the wall behind."""
    across, up = (x - 1.35) / 0.55, (y - 0.5) / 0.42
    hills = color_ramp(up + 0.35 * fractal_noise(1.5 * across, 0.3 * up, 63, 4), [-1, -0.3, 0, 0.35, 1], [
        color("#23415a"), color("#2f6d7c"), color("#d98a53"), color("#eec591"), color("#a9c6cf"),
    ])  # fmt: skip
    for size, layer in ((1.12, color("#2b2320")), (1.04, color("#f1ede4")), (0.84, hills)):
        edge = np.maximum(np.abs(x - 1.35) - 0.55 * size, np.abs(y - 0.5) - 0.42 * size)
        paint = blend_over(paint, back * smoothstep(edge, _SOFT, -_SOFT), layer)
    return paint


def _window(canvas: Canvas, wall: np.ndarray, along: Canvas, up: Canvas, span: tuple[float, float]) -> Canvas:
    """A window let into a wall: frame, mullions, and the bright world outside."""
    middle, half = (span[0] + span[1]) / 2, (span[1] - span[0]) / 2
    height = (up - SILL) / (LINTEL - SILL)
    edge = np.maximum(np.abs(along - middle) - half, np.abs(up - (SILL + LINTEL) / 2) - (LINTEL - SILL) / 2)
    to_bar = np.minimum.reduce([
        np.abs(along - middle), np.abs(np.abs(along - middle) - half),
        np.abs(np.mod(height * 3 + 0.5, 1) - 0.5) * (LINTEL - SILL) / 3,
    ])  # fmt: skip
    outside = color_ramp(height + 0.10 * fractal_noise(5 * along, 4 * up, 64, 4), [0, 0.22, 0.34, 0.5, 1], [
        color("#5d7a4a", 0.3), color("#86a06c", 0.4), color("#d5e2e6", 0.8), color("#e9f2fb", 1.0),
        color("#dcebff", 1.1),
    ])  # fmt: skip
    view = blend_over(
        outside * np.float32(DAYLIGHT), smoothstep(to_bar, 0.025 + _SOFT, 0.025 - _SOFT), color("#e9e6df", 0.45)
    )
    canvas = blend_over(canvas, wall * smoothstep(edge, 0.09 + _SOFT, 0.09 - _SOFT), color("#f4f1ea", 0.7))
    return blend_over(canvas, wall * smoothstep(edge, _SOFT, -_SOFT), view)


def _lamp_light(point: Canvas, wall: np.ndarray) -> Canvas:
    """Warm light on the walls from the lamp in the corner, behind on the right."""
    squared = ((point - LAMP) ** 2).sum(axis=-1)
    warm = np.where(wall == 2, 0.10 / (0.12 + squared), 0.05 / (0.2 + squared))
    return np.asarray(warm[..., None] * color("#ffb56b", 1.6), np.float32)


def _lamp(canvas: Canvas) -> Canvas:
    """The lamp's cloth shade, wider below, on its pole."""
    direction = directions()
    depth = LAMP[2] / np.minimum(direction[..., 2], -1e-3)
    across, up = direction[..., 0] * depth - LAMP[0], direction[..., 1] * depth - LAMP[1]
    ahead = direction[..., 2] < -0.1
    pole = ahead * smoothstep(np.abs(across), 0.02 + _SOFT, 0.02 - _SOFT) * (up < 0) * (up > FLOOR - LAMP[1])
    canvas = blend_over(canvas, pole.astype(np.float32), color("#1e1a18"))
    half = 0.24 - 0.25 * up
    edge = np.maximum(np.abs(across) - half, np.abs(up) - 0.18)
    inner = 1.0 + 0.8 * np.exp(-((up / 0.1) ** 2) - (across / 0.15) ** 2)
    return blend_over(
        canvas, ahead * smoothstep(edge, _SOFT, -_SOFT), (inner[..., None] * color("#ffc98a", 2.2)).astype(np.float32)
    )
