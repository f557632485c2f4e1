"""The placeholder: a picture for when there is no other, with a line that says why."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from relit_camera.base.images.color import uint8_from_linear
from relit_camera.base.images.image_files import read_display
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.images.resize import letterbox

TITLE = "Relit Camera"
BACKGROUND_COLOR = np.array([0.010, 0.012, 0.015], np.float32)
KEY_COLOR, RIM_COLOR = np.array([1.00, 0.80, 0.58], np.float32), np.array([0.10, 0.16, 0.28], np.float32)
KEY_DIRECTION, RIM_DIRECTION = np.array([-0.62, 0.55, 0.56]), np.array([0.93, -0.1, -0.35])
"""Directions in the picture's axes: the key light from the left above, the rim light from the right behind."""

TITLE_COLOR, REASON_COLOR = (222, 224, 228), (138, 144, 152)
FONT = cv2.FONT_HERSHEY_SIMPLEX


class Placeholder:
    """A placeholder that is drawn when it is shown, and kept only as long as somebody shows it. Of one thread."""

    def __init__(self, draw: Callable[[], DisplayImage]) -> None:
        """`draw` makes the picture, uint8 sRGB RGB (height, width, 3)."""
        self._draw = draw
        self._drawn: weakref.ref[DisplayImage] = weakref.ref(np.empty((0, 0, 3), np.uint8))

    @property
    def image(self) -> DisplayImage:
        """The picture; the same object again while it is held."""
        image = self._drawn()
        if image is None:
            image = self._draw()
            self._drawn = weakref.ref(image)
        return image


def placeholder(size: tuple[int, int], reason: str = "", picture: Path | None = None) -> DisplayImage:
    """Draw the placeholder, or fit the user's own picture.

    Args:
        size: width and height in pixels.
        reason: one line under the drawing; characters beyond ASCII are shown as `?`.
        picture: a picture file to show in place of the drawing, fitted whole into the size, without title or reason.

    Returns:
        uint8 sRGB RGB (height, width, 3).

    Raises:
        ImageError: the picture file cannot be read.
    """
    if picture is None:
        return _draw(size, reason)
    red, green, blue = uint8_from_linear(BACKGROUND_COLOR).tolist()
    return letterbox(read_display(picture), size, (red, green, blue), cv2.INTER_CUBIC)


def _draw(size: tuple[int, int], reason: str) -> DisplayImage:
    """Draw a ball under a warm key light and a cool rim light, with title and reason below it."""
    width, height = size
    unit = min(width * 9 / 16, height)
    middle = height * 0.40
    canvas = _ball(width, height, (width / 2, middle), unit * 0.13)
    _write(canvas, TITLE, middle + unit * 0.255, unit * 0.052, TITLE_COLOR)
    _write(canvas, reason.encode("ascii", "replace").decode(), middle + unit * 0.345, unit * 0.028, REASON_COLOR)
    return canvas


def _ball(width: int, height: int, center: tuple[float, float], radius: float) -> DisplayImage:
    """The picture without text."""
    x = (np.arange(width, dtype=np.float32) + np.float32(0.5 - center[0])) / np.float32(radius)
    y = (np.float32(center[1] - 0.5) - np.arange(height, dtype=np.float32)) / np.float32(radius)
    glow = np.float32(0.035) * np.outer(np.exp(y**2 / -9), np.exp(x**2 / -9))
    image = np.empty((height, width, 3), np.uint8)
    for channel, (background, key) in enumerate(zip(BACKGROUND_COLOR, KEY_COLOR, strict=True)):
        image[..., channel] = uint8_from_linear(background + glow * key)
    # The ball's own square: one pixel more than its diameter.
    columns, rows = (slice(*np.searchsorted(np.sort(axis), (-1 - 1 / radius, 1 + 1 / radius))) for axis in (x, y))
    rows = slice(height - rows.stop, height - rows.start)  # y falls
    x, y = x[columns], y[rows]
    squared = x[None, :] ** 2 + y[:, None] ** 2
    normals = np.stack([*np.broadcast_arrays(x[None, :], y[:, None]), np.sqrt(np.maximum(1 - squared, 0))], axis=-1)
    key_light = np.maximum(normals @ (KEY_DIRECTION / np.linalg.norm(KEY_DIRECTION)), 0)[..., None] * KEY_COLOR
    rim_light = np.maximum(normals @ (RIM_DIRECTION / np.linalg.norm(RIM_DIRECTION)), 0)[..., None] * RIM_COLOR
    covered = np.clip((1 - np.sqrt(squared)) * radius + 0.5, 0, 1)[..., None]
    behind = BACKGROUND_COLOR + glow[rows, columns, None] * KEY_COLOR
    ball = behind + covered * (0.006 + 0.62 * key_light + 1.2 * rim_light - behind)
    image[rows, columns] = uint8_from_linear(ball.astype(np.float32))
    return image


def _write(canvas: DisplayImage, text: str, baseline: float, cap_height: float, ink: tuple[int, int, int]) -> None:
    """Write one centered line, scaled down where it would not fit."""
    thickness = max(1, round(cap_height / 20))
    scale = cv2.getFontScaleFromHeight(FONT, max(1, round(cap_height)), thickness)
    (text_width, _), _ = cv2.getTextSize(text, FONT, scale, thickness)
    max_width = canvas.shape[1] * 0.9
    if text_width > max_width:
        scale, text_width = scale * max_width / text_width, int(max_width)
    origin = (int((canvas.shape[1] - text_width) / 2), round(baseline))
    cv2.putText(canvas, text, origin, FONT, scale, ink, thickness, cv2.LINE_AA)
