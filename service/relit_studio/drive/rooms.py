"""Rooms that people sit in before their webcam: one place, lit in four ways."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from relit_camera.light.builtin import window
from relit_camera.light.builtin.canvas import Canvas, bearings, colour, map_axes, over, panel, step
from relit_camera.light.environment import Environment, environment_from_panorama
from relit_camera.light.panorama import panorama_from_radiance


def _soft() -> Canvas:
    """By day: a large window behind the webcam, at its left, and a lamp on the desk that gives the eyes their spark."""
    canvas = over(window.paint() * np.float32(0.75), panel(-38, 14, 58, 52, 6), colour("#eef4ff", 3.2))
    return over(canvas, panel(34, 26, 7, 7, 1.5), colour("#ffe2bd", 26.0))


def _side_window() -> Canvas:
    """Late in the day: one window, at the picture's left; the other half of the face has only what the walls return."""
    return over(window.paint() * np.float32(0.1), panel(-82, 12, 44, 58, 3), colour("#e9f1ff", 9.0))


def _ceiling() -> Canvas:
    """An office: two rows of panels overhead, nothing else. Eye sockets lie in shade."""
    canvas = window.paint() * np.float32(0.12)
    for azimuth in (0, 180):
        canvas = over(canvas, panel(azimuth, 66, 70, 12, 1), colour("#f3fff6", 16.0))
    return canvas


def _screen() -> Canvas:
    """At night: the screen alone, and what it throws on the walls near it."""
    bearing, _ = bearings()
    near = 0.004 + 0.02 * step(60, 180, np.abs(bearing))[..., None] * colour("#9fbdf5")
    return over(window.paint() * near, panel(0, -9, 48, 28, 1), colour("#c3d7ff", 2.4))


_ROOMS: dict[str, Callable[[], Canvas]] = {
    "soft": _soft,
    "side-window": _side_window,
    "ceiling": _ceiling,
    "screen": _screen,
}
ROOMS = tuple(_ROOMS)


def paint_room(name: str) -> Environment:
    """The room of that name.

    Raises:
        KeyError: `name` is none of `ROOMS`.
    """
    return environment_from_panorama(name, panorama_from_radiance(map_axes(_ROOMS[name]()), name))
