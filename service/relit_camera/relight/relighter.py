"""The seam between light and picture: O[p] = Σ_l R[p, l] · E[l] · ω_l, per colour channel (thesis 6.1)."""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from relit_camera.errors import NotFoundError
from relit_camera.light.maps import LightMap
from relit_camera.space.directions import texel_solid_angles
from relit_camera.space.images import LinearImage
from relit_camera.subject.field import TEXELS
from relit_camera.subject.subject import Subject

GROUP = "relit_camera.relighters"


class Relighter(Protocol):
    """Relights one subject. Holds its data in the form that its arithmetic wants. Thread-safe."""

    def relight(self, light_map: LightMap) -> LinearImage:
        """The subject under a light map (32, 64, 3): float32 linear (height, width, 3), unscaled and unclipped.

        Black where the matte is 0.
        """
        ...


def weighted_light(light_map: LightMap) -> NDArray[np.float32]:
    """E[l] · ω_l as float32 (2048, 3): the right-hand side of the relighting product."""
    omega = texel_solid_angles().astype(np.float32)
    return np.ascontiguousarray((light_map * omega[..., None]).reshape(TEXELS, 3))


def open_relighter(name: str, subject: Subject) -> Relighter:
    """A relighter of that name for `subject`.

    Raises:
        NotFoundError: none of that name is installed.
    """
    for point in entry_points(group=GROUP, name=name):
        relighter: Relighter = point.load()(subject)
        return relighter
    known = ", ".join(sorted(point.name for point in entry_points(group=GROUP)))
    raise NotFoundError(f"no relighter '{name}'", f"there are: {known}")
