"""The built-in environments by name."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from importlib import import_module

from relit_camera.light.environments.builtin.canvas import Canvas, bearings, directions
from relit_camera.light.environments.environment_panorama import (
    Environment,
    environment_from_panorama,
    panorama_from_radiance,
)
from relit_camera.light.environments.panorama_axes import between_map_and_viewer_axes

BUILTIN_NAMES = ("studio", "window", "sunset", "night-street", "party", "overcast")


@lru_cache(maxsize=len(BUILTIN_NAMES))
def builtin_environment(name: str) -> Environment:
    """The built-in environment of that name, painted on first use (a few tenths of a second).

    Raises:
        KeyError: `name` is none of `BUILTIN_NAMES`.
    """
    if name not in BUILTIN_NAMES:
        raise KeyError(name)
    paint: Callable[[], Canvas] = import_module(
        f"relit_camera.light.environments.builtin.{name.replace('-', '_')}"
    ).paint
    panorama = panorama_from_radiance(between_map_and_viewer_axes(paint()), name)
    for kept in (bearings, directions):
        kept.cache_clear()  # ten megabytes that only painting needs
    return environment_from_panorama(name, panorama)
