"""The live room behind the person, out of focus."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from relit_camera.compose.view import BLUR_SIGMA
from relit_camera.space.colour import linear_from_uint8, uint8_from_linear
from relit_camera.space.images import DisplayImage, Mask

_WORKING_SIGMA = 1.5
"""The room is reduced as far as the blur's sigma stays this many pixels."""

_REDUCTIONS = (3, 8)
"""Least and greatest whole factor: less is slow, and more shows when it is enlarged again."""

_LEAST = np.float32(1e-4)


@dataclass(frozen=True)
class LiveRoom:
    """A live picture and where the person is in it.

    Attributes:
        image: uint8 sRGB (height, width, 3).
        person: alpha of the person, (height, width) of the image.
    """

    image: DisplayImage
    person: Mask


def blurred(room: LiveRoom, strength: float) -> DisplayImage:
    """The room without the person, blurred in linear light with a sigma of `strength` tenths of the height; uint8 sRGB.

    Normalised convolution: the person's pixels have no weight, so nothing of them bleeds into the room around them, and
    behind them the room is continued (Knutsson and Westin 1993).
    """
    height, width = room.person.shape
    sigma = BLUR_SIGMA * strength * height
    reduce = int(np.clip(sigma / _WORKING_SIGMA, *_REDUCTIONS))
    size = (max(1, width // reduce), max(1, height // reduce))
    # Averaged as light: of codes, small lamps would come out too dark.
    light = cv2.resize(linear_from_uint8(room.image), size, interpolation=cv2.INTER_AREA)
    # So high a power that a pixel counts only when it is all but surely room.
    weight = ((1 - cv2.resize(room.person, size, interpolation=cv2.INTER_AREA)) ** 16)[..., np.newaxis]
    # Averaging r pixels to one and enlarging linearly blurs too, with a variance of r²/12 + r²/6.
    working_sigma = max((sigma / reduce) ** 2 - 1 / 4, 0.01) ** 0.5
    weighted = cv2.GaussianBlur(np.dstack([light * weight, weight]), (0, 0), working_sigma)
    # Deep behind the person, where no room is near, the constant brings in the room's mean.
    mean = (light * weight).mean(axis=(0, 1)) / max(float(weight.mean()), 1e-6)
    filled = (weighted[..., :3] + _LEAST * mean) / (weighted[..., 3:] + _LEAST)
    enlarged: DisplayImage = cv2.resize(uint8_from_linear(filled), (width, height), interpolation=cv2.INTER_LINEAR)
    return enlarged
