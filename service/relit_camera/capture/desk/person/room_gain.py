"""The gain by which a desk field is made right in the room's light, as far as that light can be told.

Under the patches alone hair is too dark and fuzzy to be fitted well. One picture in another light, that of the room,
says how bright it is there.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array
from relit_camera.base.images.image_types import LinearImage, Mask
from relit_camera.light.directions import texel_solid_angles
from relit_camera.light.soft_lights import SoftLights, regularized_nnls
from relit_camera.subject.reflectance_field import ExactField, texel_vectors


@dataclass(frozen=True)
class RoomGainTunables:
    """Constants of the gain, from a study of frontal captures.

    Attributes:
        ridge: pull of the room's light toward even light.
        max_pixels: of the skin that are used for its fit.
        floor: summand of both pictures, relative to the relit one's mean: in the dark a ratio says nothing.
        least, most: limits of the gain.
        blur: standard deviation of the gain's blur, as a fraction of the picture's width.
        min_light: mean of the room's picture on the face relative to that under white, below which there is no room.
    """

    ridge: float = 3e-3
    max_pixels: int = 2000
    floor: float = 0.03
    least: float = 0.5
    most: float = 3.0
    blur: float = 0.004
    min_light: float = 0.02


TUNABLES = RoomGainTunables()


def room_gain(field: ExactField, room: LinearImage, skin: NDArray[np.bool_], matte: Mask) -> Float32Array | None:
    """Gain (height · width, 3) of the field, mean about 1 on the skin; None where the skin tells no room light.

    Args:
        field: of the person.
        room: (height, width, 3) linear, aligned to the field's picture, of any exposure.
        skin: (height, width) mask by whose pixels the room's light is told.
        matte: (height, width) alpha of the person.
    """
    inside = np.flatnonzero(matte.ravel() > 0)
    lights = SoftLights().maps() * texel_solid_angles().reshape(-1, 1).astype(np.float32)
    chosen = np.flatnonzero((skin & (matte > 0.9)).ravel())
    chosen = chosen[:: max(1, len(chosen) // TUNABLES.max_pixels)]
    seen = room.reshape(-1, 3)
    level = float(seen[chosen].mean()) if len(chosen) else 0.0
    if level <= 0:
        return None
    relit = np.empty((len(inside), 3), np.float32)
    response = np.tensordot(field.at(texel_vectors(), chosen), lights, axes=([0], [0]))
    amounts = []
    for channel in range(3):
        design = response[:, channel].astype(np.float64)
        even = np.full(design.shape[1], seen[chosen, channel].mean() / max(float(design.sum(axis=1).mean()), 1e-9))
        weight = np.ones(len(chosen), np.float32)
        amounts.append(regularized_nnls(design, seen[chosen, channel].astype(np.float64), weight, even, TUNABLES.ridge))
    light = lights @ np.stack(amounts, axis=1).astype(np.float32)
    step = 2048
    for start in range(0, len(inside), step):
        block = inside[start : start + step]
        relit[start : start + step] = np.einsum("lpc,lc->pc", field.at(texel_vectors(), block), light)
    floor = TUNABLES.floor * relit.mean(axis=0)
    gain = np.ones((matte.size, 3), np.float32)
    gain[inside] = (np.maximum(seen[inside], 0) + floor) / (relit + floor)
    planes = np.log(np.clip(gain, TUNABLES.least, TUNABLES.most)).reshape(*matte.shape, 3)
    soft = cv2.GaussianBlur(planes, (0, 0), max(0.3, TUNABLES.blur * matte.shape[1]))
    return np.asarray(np.exp(soft).reshape(-1, 3), np.float32)
