"""The built-in environments by name."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

from relit_camera.light.environments.builtin.canvas import Canvas, bearings, directions
from relit_camera.light.environments.environment_panorama import (
    Environment,
    environment_from_panorama,
    panorama_from_radiance,
)
from relit_camera.light.environments.panorama_axes import between_map_and_viewer_axes
from relit_camera.light.environments.recent_environments import RecentEnvironments

BUILTIN_NAMES = ("studio", "window", "sunset", "night-street", "party", "overcast")


MOST_KEPT_BYTES = 32 << 20
"""More than all of them take: 3 MB each."""
_RECENT = RecentEnvironments(MOST_KEPT_BYTES)


def builtin_environment(name: str) -> Environment:
    """The built-in environment of that name, painted on first use (a few tenths of a second).

    The same object while it is in use.

    Raises:
        KeyError: `name` is none of `BUILTIN_NAMES`.
    """
    if name not in BUILTIN_NAMES:
        raise KeyError(name)
    return _RECENT.get(name, lambda: _painted(name))


def _painted(name: str) -> Environment:
    paint: Callable[[], Canvas] = import_module(
        f"relit_camera.light.environments.builtin.{name.replace('-', '_')}"
    ).paint
    panorama = panorama_from_radiance(between_map_and_viewer_axes(paint()), name)
    for kept in (bearings, directions):
        kept.cache_clear()  # ten megabytes that only painting needs
    return environment_from_panorama(name, panorama)
