"""The canvas on which the built-in environments are painted, and the painting operations they share.

A canvas has viewer axes (`light.environments.panorama_axes`), row 0 up. `bearing` is the angle from its middle to the
right, in degrees; what lights the face from the front is at bearings beyond ±90.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.easing import smoothstep
from relit_camera.base.images.color import rgb_from_hex, srgb_decode
from relit_camera.light.directions import direction_from_degrees

HEIGHT, WIDTH = 512, 1024
Canvas = NDArray[np.float32]
"""(512, 1024, 3) linear RGB radiance, or (512, 1024) of one quantity, in viewer axes."""


@lru_cache(maxsize=1)
def bearings() -> tuple[Canvas, Canvas]:
    """Bearing (512, 1024), −180 to 180, and elevation (512, 1024), 90 to −90, of the pixel centres in degrees."""
    bearing = (np.arange(WIDTH) + 0.5) / WIDTH * 360 - 180
    elevation = 90 - (np.arange(HEIGHT) + 0.5) / HEIGHT * 180
    grid = np.meshgrid(bearing.astype(np.float32), elevation.astype(np.float32))
    return grid[0], grid[1]


@lru_cache(maxsize=1)
def directions() -> Canvas:
    """Unit vectors (512, 1024, 3) toward the pixel centres."""
    bearing, elevation = bearings()
    return direction_from_degrees(180 - bearing[:1], elevation[:, :1]).astype(np.float32)


def color(code: str, strength: float = 1.0) -> NDArray[np.float32]:
    """Linear RGB (3,) of a web colour such as "#ff8800", times `strength`."""
    return srgb_decode(np.array(rgb_from_hex(code), np.float32) / 255) * np.float32(strength)


def color_ramp(value: NDArray, stops: Sequence[float], colors: list[NDArray[np.float32]]) -> Canvas:
    """Colours (..., 3) at `value` (...), linear between rising `stops`."""
    table = np.array(colors)
    ramp = np.empty((*np.shape(value), 3), np.float32)
    for k in range(3):
        ramp[..., k] = np.interp(value, stops, table[:, k])
    return ramp


def blend_over(canvas: Canvas, mask: Canvas, paint: NDArray[np.float32]) -> Canvas:
    """`paint` (3,) or (512, 1024, 3) laid over the canvas where the mask (512, 1024) is 1."""
    covered = canvas.reshape(-1, 3).copy()
    inside = np.flatnonzero(mask)  # a panel covers a twentieth of the canvas
    below = covered[inside]
    over = paint.reshape(-1, 3)[inside] if paint.ndim > 1 else paint
    covered[inside] = below + mask.ravel()[inside][:, None] * (over - below)
    return covered.reshape(canvas.shape)


def angle_from(azimuth_deg: float, elevation_deg: float) -> Canvas:
    """Angle in degrees (512, 1024) from the direction AZ, EL (0 is toward the camera, 90 the picture's right)."""
    cosine = directions() @ direction_from_degrees(azimuth_deg, elevation_deg).astype(np.float32)
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1, 1))), np.float32)


def gaussian_glow(azimuth_deg: float, elevation_deg: float, size_deg: float) -> Canvas:
    """1 toward AZ, EL, falling off as a Gaussian with a sigma of `size_deg`."""
    return np.asarray(np.exp(-0.5 * (angle_from(azimuth_deg, elevation_deg) / size_deg) ** 2), np.float32)


def panel_mask(
    azimuth_deg: float, elevation_deg: float, width_deg: float, height_deg: float, soft_deg: float = 1.5
) -> Canvas:
    """Mask of an upright rectangle of light that faces the head, centred at AZ, EL, of these full angles."""
    facing = direction_from_degrees(azimuth_deg, elevation_deg)
    right = direction_from_degrees(azimuth_deg + 90, 0)
    axes = np.stack([right, np.cross(facing, right), facing]).astype(np.float32)
    outer = np.array([width_deg, height_deg]) / 2 + soft_deg
    # No corner is further from the middle than the diagonal of these two angles.
    near = directions() @ facing.astype(np.float32) > np.cos(np.radians(min(float(np.hypot(*outer)), 90.0)))
    u, v, depth = axes @ directions()[near].T
    covers = [
        smoothstep(np.abs(np.degrees(np.arctan2(offset, np.maximum(depth, 1e-6)))), half, half - 2 * soft_deg)
        for offset, half in ((u, outer[0]), (v, outer[1]))
    ]
    mask = np.zeros((HEIGHT, WIDTH), np.float32)
    mask[near] = covers[0] * covers[1]
    return mask


def fractal_noise(u: NDArray, v: NDArray, seed: int, octaves: int = 5) -> Canvas:
    """Fractal noise, about −1 to 1, of the shape of u and v; its coarsest grain has a size of 1, its period is 64."""
    tile = np.random.default_rng(seed).standard_normal((64, 64)).astype(np.float32)
    total = np.zeros(np.shape(u), np.float32)
    for octave in range(octaves):
        scale = 2.0**octave
        x, y = (_modulo_64(np.asarray(w) * scale + 17.3 * octave).astype(np.float32) for w in (u, v))
        total += cv2.remap(tile, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_WRAP) / np.float32(scale)
    return np.asarray(total / 1.6, np.float32)


def _modulo_64(value: NDArray) -> NDArray:
    """As `np.mod`, to the bit, since 64 is a power of two, in a fifth of the time."""
    return np.asarray(value - 64 * np.floor(value / 64))


def add_bokeh_disc(
    canvas: Canvas, bearing: float, elevation: float, radius_deg: float, light: NDArray[np.float32]
) -> None:
    """Add a disc out of focus, evenly bright with a soft edge and a brighter rim, near the horizon. In place."""
    scale = WIDTH / 360
    x, y, radius = (bearing + 180) * scale - 0.5, (90 - elevation) * scale - 0.5, radius_deg * scale
    reach = int(np.ceil(radius)) + 2
    columns = np.arange(int(x) - reach, int(x) + reach + 1)
    rows = np.arange(max(0, int(y) - reach), min(HEIGHT, int(y) + reach + 1))
    distance = np.hypot(columns - x, rows[:, None] - y)
    disc = np.clip(radius + 0.5 - distance, 0, 1) * (0.8 + 0.4 * np.clip(distance / radius, 0, 1) ** 4)
    canvas[np.ix_(rows, columns % WIDTH)] += disc[..., None] * light


def blur(canvas: Canvas, sigma_x_deg: float, sigma_y_deg: float) -> Canvas:
    """The canvas, blurred by Gaussians of these sigmas at the horizon, wrapping round."""
    scale = WIDTH / 360
    margin = int(3 * sigma_x_deg * scale) + 1
    wrapped = np.concatenate([canvas[:, -margin:], canvas, canvas[:, :margin]], axis=1)
    soft = cv2.GaussianBlur(
        wrapped, (0, 0), sigmaX=max(sigma_x_deg * scale, 0.1), sigmaY=max(sigma_y_deg * scale, 0.1),
        borderType=cv2.BORDER_REPLICATE,
    )  # fmt: skip
    return np.ascontiguousarray(soft[:, margin:-margin], dtype=np.float32)
