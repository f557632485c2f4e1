"""The albedo of a person in a picture whose light is known: what is left when shading and gloss are taken out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import luminance
from relit_camera.base.images.image_types import LinearImage


@dataclass(frozen=True)
class AlbedoTunables:
    """Constants of the albedo, chosen by looking at people under lamps from all sides.

    Attributes:
        gloss_share: share of the expected gloss that is taken out: its place is a guess.
        least_share: of a pixel that stays, however much gloss is expected.
        floor: share of the skin's typical shading that is added to all: no albedo is made of hardly any light.
        reached: share of the typical shading that counts as reached by the room's light; below half of it is dark.
        limits: of an albedo; a shirt or a hand in brighter light than the face has one above 1.
    """

    gloss_share: float = 0.7
    least_share: float = 0.2
    floor: float = 0.15
    reached: float = 0.45
    limits: tuple[float, float] = (0.003, 4.0)


TUNABLES = AlbedoTunables()


@dataclass(frozen=True)
class AlbedoEstimate:
    """An albedo, and how much of it the room's light shows.

    Attributes:
        albedo: (height, width, 3) float32.
        dark_fraction: share of the skin that hardly any of the room's light reaches: a harsh room.
    """

    albedo: LinearImage
    dark_fraction: float


def estimate_albedo(
    picture: LinearImage,
    shading: LinearImage,
    gloss: LinearImage,
    skin: NDArray[np.bool_],
) -> AlbedoEstimate:
    """Albedo = (picture − gloss) / shading, with a floor.

    Args:
        picture: (height, width, 3) linear.
        shading: a white person in the room's light, without gloss.
        gloss: the gloss alone.
        skin: where the face is skin.
    """
    typical = np.median(shading[skin], axis=0)
    floor = TUNABLES.floor * typical
    bare = np.maximum(picture - TUNABLES.gloss_share * gloss, TUNABLES.least_share * picture)
    # The floor leaves an albedo as it is where the shading is typical.
    own = bare / (shading + floor) * (1 + TUNABLES.floor)
    level = luminance(shading) / max(float(luminance(typical[None, None])[0, 0]), 1e-9)
    belief = np.clip(level / TUNABLES.reached, 0, 1)
    return AlbedoEstimate(np.clip(own, *TUNABLES.limits).astype(np.float32), float((belief[skin] < 0.5).mean()))
