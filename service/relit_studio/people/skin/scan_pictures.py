"""The scan's textures prepared for all people: without brows, stubble and moles, and with pores as relief.

All outlines are pixels of the 1024 x 1024 color map, found by eye.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import ImageError
from relit_camera.base.images.image_files import read_display
from relit_camera.base.images.image_types import DisplayImage

Picture = NDArray[np.float32]

SIDE = 1024
_EYE_DOTS = (((452, 292), (476, 292), (476, 314), (452, 314)), ((548, 292), (572, 292), (572, 314), (548, 314)))
_BROWS = (
    ((358, 300), (385, 258), (440, 236), (500, 250), (512, 290), (470, 286), (430, 278), (385, 305)),
    ((508, 290), (515, 250), (580, 238), (640, 256), (655, 290), (610, 284), (560, 278)),
)
_BEARD = (
    (300, 330), (330, 340), (380, 410), (420, 445), (440, 432), (468, 420), (560, 418), (590, 432), (605, 450),
    (660, 410), (700, 325), (745, 330), (740, 470), (700, 620), (630, 770), (420, 770), (330, 620), (292, 470),
)  # fmt: skip
_MOUTH = ((448, 478), (480, 460), (512, 456), (550, 460), (578, 478), (550, 500), (480, 500))
_LIPS = ((448, 478), (480, 458), (513, 462), (548, 458), (578, 478), (550, 500), (480, 500))
_SHAVED_SCALP = (
    (0, 0), (1023, 0), (1023, 620), (760, 620), (690, 250), (640, 130), (400, 130), (340, 250), (260, 620), (0, 620),
)  # fmt: skip
_EYES_AND_NOSE = ((395, 280), (630, 280), (640, 330), (560, 345), (565, 430), (465, 430), (465, 345), (385, 330))
_FOREHEAD = (slice(100, 230), slice(400, 630))
"""Where pores are copied from to cover removed features."""
_MOLE_DEPTH = 0.045
"""Least difference of a mole from its brighter surroundings, in sRGB code values of 0..1."""


@dataclass(frozen=True, eq=False)
class ScanPictures:
    """Pictures in the scan's texture space.

    Attributes:
        stubble: sRGB albedo (1024, 1024, 3) with shaved beard, without brows and moles.
        clean: the same without the beard.
        pores: gray relief (2048, 2048), 128 is level.
    """

    stubble: DisplayImage
    clean: DisplayImage
    pores: NDArray[np.uint8]


def outline(points: Sequence[tuple[int, int]], feather: float, side: int = SIDE) -> Picture:
    """A soft mask (side, side) 0..1 of a polygon given in pixels of 1024 x 1024; `feather` is in those, too."""
    mask = np.zeros((SIDE, SIDE), np.float32)
    cv2.fillPoly(mask, [np.array(points, np.int32)], (1.0,))
    blurred = cv2.GaussianBlur(mask, (0, 0), feather)
    return np.asarray(blurred if side == SIDE else cv2.resize(blurred, (side, side)), np.float32)


def lips_mask(side: int) -> Picture:
    """Mask (side, side) of the lips."""
    return outline(_LIPS, 3, side)


def scalp_mask(side: int) -> Picture:
    """Mask (side, side) of the shaved scalp, whose gray would be visible at the temples."""
    return outline(_SHAVED_SCALP, 30, side)


def clean_pictures(color: Path, displacement: Path) -> ScanPictures:
    """Prepare the scan's color map and displacement map.

    Raises:
        ImageError: one cannot be read, or the color map is not 1024 pixels wide.
    """
    photo: Picture = read_display(color).astype(np.float32) / np.float32(255)
    if photo.shape[:2] != (SIDE, SIDE):
        raise ImageError(f"{color} is {photo.shape[1]}x{photo.shape[0]}, not {SIDE}x{SIDE}", "fetch it again")
    photo = _without_moles(photo)
    dots = np.maximum(*(outline(each, 3) for each in _EYE_DOTS))
    brows = np.maximum(*(outline(each, 6) for each in _BROWS))
    covered = np.clip(1.3 * np.maximum(dots, brows), 0, 1)[..., None]
    fine = photo - cv2.GaussianBlur(photo, (0, 0), 9)
    pores = _tiled(fine[_FOREHEAD])
    blended = photo * (1 - covered) + (_membrane(photo, np.maximum(dots, brows)) + pores) * covered
    stubble = np.asarray(blended, np.float32)

    mouth, beard = outline(_MOUTH, 5), outline(_BEARD, 12)
    shaved = (beard * (1 - np.clip(1.5 * mouth, 0, 1)))[..., None]
    smooth = _membrane(stubble, np.maximum(beard, cv2.dilate(mouth, np.ones((15, 15))).astype(np.float32)))
    skin = cv2.GaussianBlur(smooth, (0, 0), 6) + pores + 0.25 * np.clip(fine, -0.03, 0.03)
    clean = stubble * (1 - shaved) + skin * shaved

    height = read_display(displacement)[..., 0].astype(np.float32) / 255
    height = cv2.resize(height, (2 * SIDE, 2 * SIDE), interpolation=cv2.INTER_AREA)
    relief = height - cv2.GaussianBlur(height, (0, 0), 12)
    relief *= 1 - 0.9 * cv2.resize(brows, (2 * SIDE, 2 * SIDE))
    levels = np.clip(128 + relief / (8 * relief.std()) * 127, 0, 255).astype(np.uint8)
    return ScanPictures(_coded(stubble), _coded(clean.astype(np.float32)), levels)


def _without_moles(photo: Picture) -> Picture:
    """The photo with moles removed: dark spots of a few pixels are filled from their surroundings."""
    gray = cv2.GaussianBlur(photo.mean(axis=2), (0, 0), 1.5)
    spots = (cv2.GaussianBlur(gray, (0, 0), 9) - gray) > _MOLE_DEPTH
    features = np.maximum.reduce([outline(each, 4) for each in (*_EYE_DOTS, *_BROWS, _MOUTH, _EYES_AND_NOSE)])
    spots &= features < 0.05
    count, labels, stats, _ = cv2.connectedComponentsWithStats(spots.astype(np.uint8))
    wide = stats[:, cv2.CC_STAT_WIDTH] / np.maximum(stats[:, cv2.CC_STAT_HEIGHT], 1)
    area = stats[:, cv2.CC_STAT_AREA]
    moles = (area >= 6) & (area <= 160) & (wide > 0.4) & (wide < 2.5) & (np.arange(count) > 0)
    mask = cv2.dilate(moles[labels].astype(np.uint8), np.ones((7, 7)))
    filled = cv2.inpaint(_coded(photo), mask, 5, cv2.INPAINT_TELEA).astype(np.float32) / 255
    return np.where(mask[..., None] > 0, filled, photo).astype(np.float32)


def _membrane(photo: Picture, mask: Picture, steps: int = 1200) -> Picture:
    """The photo with the masked part replaced by a smooth membrane between its edges."""
    small = cv2.resize(photo, (128, 128), interpolation=cv2.INTER_AREA)
    inside = cv2.resize(mask, (128, 128))[..., None] > 0.02
    filled = np.where(inside, small[~inside[..., 0]].mean(axis=0), small).astype(np.float32)
    for _ in range(steps):
        filled = np.where(inside, cv2.blur(filled, (3, 3)), small).astype(np.float32)
    return np.asarray(cv2.resize(filled, (SIDE, SIDE), interpolation=cv2.INTER_CUBIC), np.float32)


def _tiled(patch: Picture) -> Picture:
    """A patch repeated with mirroring, (1024, 1024, 3)."""
    row = np.hstack([patch, patch[:, ::-1]])
    tiled = np.tile(np.vstack([row, row[::-1]]), (5, 3, 1))
    return np.asarray(tiled[:SIDE, :SIDE], np.float32)


def _coded(picture: Picture) -> DisplayImage:
    return np.clip(picture * 255, 0, 255).astype(np.uint8)
