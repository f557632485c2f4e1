"""Relighters: what one is (subject, light → picture), and how one is opened by name.

The picture is O[p] = Σ_l R[p, l] · E[l] · ω_l, per colour channel (thesis 6.1): R the reflectance of pixel p for light
from texel l, E the radiance of that texel of the light map, ω its solid angle.

A plug-in is an entry point of the group `relit_camera.relighters`: called with a `Subject` and `RelighterOptions`, it
gives a `Relighter`.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.base.plugin_groups import PluginGroup
from relit_camera.light.directions import texel_solid_angles
from relit_camera.subject.reflectance_field import TEXELS
from relit_camera.subject.subject import Subject

log = logging.getLogger(__name__)


class Relighter(Protocol):
    """Relights one subject. Holds its data in the form that its arithmetic wants. Thread-safe."""

    @property
    def name(self) -> str:
        """As settings name it, for the status."""
        ...

    @property
    def provider(self) -> str:
        """What runs it, for the status: `numpy`, or the execution provider that is proven to, such as `cuda`."""
        ...

    def relight(self, light_maps: NDArray[np.float32]) -> NDArray[np.float32]:
        """The subject under each of some light maps (count, 32, 64, 3): float32 linear (count, height, width, 3).

        Unscaled and unclipped, black where the matte is 0. Together, because what most of the time is spent on, reading
        the field, is then done once.
        """
        ...


@dataclass(frozen=True)
class RelighterOptions:
    """What every relighter is opened with, beside the subject.

    Attributes:
        session: how to run its networks.
        argument: what follows the colon in `NAME:ARGUMENT`.
    """

    session: SessionOptions = field(default_factory=SessionOptions)
    argument: str = ""


RELIGHTERS: PluginGroup[Callable[[Subject, RelighterOptions], Relighter]] = PluginGroup(
    "relit_camera.relighters", "relighter"
)


def open_relighter(name: str, subject: Subject, session: SessionOptions | None = None) -> Relighter:
    """Open the relighter `NAME` or `NAME:ARGUMENT` for `subject`.

    Raises:
        NotFoundError: none of that name is installed.
        ConfigError: the plug-in cannot be loaded.
        DeviceError: the session's provider is strict, and cannot run it.
    """
    factory, argument = RELIGHTERS.load(name)
    relighter = factory(subject, RelighterOptions(session or SessionOptions(), argument))
    usual = relighter.provider in ("numpy", "cpu")
    log.log(
        logging.DEBUG if usual else logging.INFO, "the subject is relit by %s on %s", relighter.name, relighter.provider
    )
    return relighter


def weighted_light(light_maps: NDArray[np.float32]) -> NDArray[np.float32]:
    """E[l] · ω_l of light maps (..., 32, 64, 3) as float32 (..., 2048, 3): the right-hand side of the product."""
    omega = texel_solid_angles().astype(np.float32)
    weighted = (light_maps * omega[..., None]).reshape(*light_maps.shape[:-3], TEXELS, 3)
    return np.ascontiguousarray(weighted, np.float32)
