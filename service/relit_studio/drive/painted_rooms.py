"""Painted rooms for driving videos: one room, lit in five ways."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from relit_camera.base.easing import smoothstep
from relit_camera.light.environments.builtin import window
from relit_camera.light.environments.builtin.canvas import Canvas, bearings, blend_over, color, panel_mask
from relit_camera.light.environments.environment_panorama import (
    Environment,
    environment_from_panorama,
    panorama_from_radiance,
)
from relit_camera.light.environments.panorama_axes import between_map_and_viewer_axes


def _soft() -> Canvas:
    """Day: a large window behind the webcam, at its left, and a desk lamp that gives the eyes a highlight."""
    canvas = blend_over(window.paint() * np.float32(0.75), panel_mask(-38, 14, 58, 52, 6), color("#eef4ff", 3.2))
    return blend_over(canvas, panel_mask(34, 26, 7, 7, 1.5), color("#ffe2bd", 26.0))


def _side_window() -> Canvas:
    """Evening: one window at the picture's left; the other half of the face is lit by the walls only."""
    return blend_over(window.paint() * np.float32(0.1), panel_mask(-82, 12, 44, 58, 3), color("#e9f1ff", 9.0))


def _ceiling() -> Canvas:
    """Office: two rows of ceiling panels only, so that the eye sockets are in shadow."""
    canvas = window.paint() * np.float32(0.12)
    for azimuth in (0, 180):
        canvas = blend_over(canvas, panel_mask(azimuth, 66, 70, 12, 1), color("#f3fff6", 16.0))
    return canvas


def _lamp() -> Canvas:
    """The day of `soft`, and a warm lamp at the picture's right, which a person may switch on."""
    return blend_over(_soft(), panel_mask(62, 24, 26, 26, 4), color("#ffd3a1", 9.0))


def _screen() -> Canvas:
    """Night: the screen alone, and its light on the walls near it."""
    bearing, _ = bearings()
    near = 0.004 + 0.02 * smoothstep(np.abs(bearing), 60, 180)[..., None] * color("#9fbdf5")
    return blend_over(
        np.asarray(window.paint() * near, np.float32), panel_mask(0, -9, 48, 28, 1), color("#c3d7ff", 2.4)
    )


_ROOMS: dict[str, Callable[[], Canvas]] = {
    "soft": _soft,
    "side-window": _side_window,
    "ceiling": _ceiling,
    "screen": _screen,
    "lamp": _lamp,
}
ROOMS = tuple(_ROOMS)


def paint_room(name: str) -> Environment:
    """Paint the room of a name.

    Raises:
        KeyError: `name` is none of `ROOMS`.
    """
    return environment_from_panorama(name, panorama_from_radiance(between_map_and_viewer_axes(_ROOMS[name]()), name))
