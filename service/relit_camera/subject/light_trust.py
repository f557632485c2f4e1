"""How far a subject is to be trusted in a light, by where that light comes from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relit_camera.light.directions import texel_directions
from relit_camera.light.light_map import LightMap
from relit_camera.subject.measured_light import share_of_light
from relit_camera.subject.rungs import SOFT_FROM_DEG
from relit_camera.subject.subject import Subject


@dataclass(frozen=True)
class LightTrust:
    """Shares 0..1 of a light's energy, for a head that looks ahead."""

    measured: float
    """From directions in which the subject was measured; for the rest it is modelled."""
    behind: float
    """From behind the face, where the subject was not measured: a guess."""
    softened: float
    """From directions from which the subject shows light softer than it is."""


def light_trust(subject: Subject, light_map: LightMap) -> LightTrust:
    """What of a light map (32, 64, 3) the subject was measured in, what it guesses and what it softens."""
    toward, measured = texel_directions()[..., 2], subject.measured_texels
    soft = (toward < np.cos(np.radians(SOFT_FROM_DEG))) & (subject.metadata.rung == "instant")
    parts = measured, (toward < 0) & ~measured, soft
    return LightTrust(*(round(share_of_light(light_map, texels), 3) for texels in parts))
