"""An environment: light from all sides under a name."""

from __future__ import annotations

from dataclasses import dataclass

from relit_camera.light.maps import LightMap, resample
from relit_camera.light.panorama import Panorama


@dataclass(frozen=True)
class Environment:
    """Light from all sides.

    Attributes:
        name: what it is stored as, or the path it was read from.
        panorama: at the file's resolution, to be seen as a background.
        light_map: the same, resampled to (32, 64, 3), to light with.
        notes: what a person should know about it, one sentence each.
    """

    name: str
    panorama: Panorama
    light_map: LightMap
    notes: tuple[str, ...] = ()


def environment_from_panorama(name: str, panorama: Panorama) -> Environment:
    """The environment that a panorama shows, with the panorama's notes."""
    return Environment(name, panorama, resample(panorama.radiance), panorama.notes)
