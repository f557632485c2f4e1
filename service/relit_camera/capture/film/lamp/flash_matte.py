"""Who is in the picture: what the flash reaches and the room behind is not.

A lamp near the person adds far more to what they reflect of the room's light than to what the wall behind does. This
ratio knows no colour: dark hair has it as light skin has.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import luminance
from relit_camera.base.images.image_types import LinearImage, Mask
from relit_camera.base.threads import worker_pool

_HIGH, _LOW = 92.0, 15.0
"""Percentiles over the lights: what a pixel is at its brightest, and what noise makes of nothing."""
_BLOCK = 64
_DARKEST = 0.004
"""Room light, in the pictures' unit, below which it is noise."""
_LEAST, _MOST = 0.02, 0.35
"""Share of the usual ratio between which the person and the room are told apart."""
_BRIDGE, _EDGE = 0.006, 0.012
"""Radius of bridges that are cut, and reach of the soft edge, as shares of the picture's width."""
_FULL = 0.8
"""Share of the ratio just inside from which a pixel is the person's wholly."""


def estimate_flash_matte(
    pictures: NDArray[np.floating], room: LinearImage, nobody: NDArray[np.bool_] | None = None
) -> Mask:
    """The person's alpha (height, width), float32 0..1: the largest thing that the flash reaches.

    Args:
        pictures: (lights, height, width, 3) linear, of the flash alone.
        room: (height, width, 3) without the flash, in the same unit.
        nobody: (height, width) where nobody can be, as on the mirror ball.
    """
    ratio = flash_ratio(pictures, room)
    if nobody is not None:
        ratio[nobody] = 0
    body = _largest(ratio > _threshold(ratio))
    return _soft_edge(body, ratio) if body.any() else np.zeros(ratio.shape, np.float32)


def flash_ratio(pictures: NDArray[np.floating], room: LinearImage) -> NDArray[np.float32]:
    """Light of the flash over the room's (height, width), by the lights that reach a pixel best."""

    def added_in(top: int) -> NDArray[np.floating]:
        rows = luminance(pictures[:, top : top + _BLOCK].astype(np.float32))
        low, high = np.percentile(rows, [_LOW, _HIGH], axis=0)
        # Noise goes both ways, light only one.
        return np.asarray(np.maximum(high + np.minimum(low, 0), 0))

    with worker_pool() as pool:
        added = np.concatenate(list(pool.map(added_in, range(0, len(room), _BLOCK))))
    return np.asarray(added / (np.maximum(luminance(room), 0) + np.float32(_DARKEST)), np.float32)


def _threshold(ratio: NDArray[np.float32]) -> float:
    """Between the room's ratio and the person's, who is in the middle, by logarithms (Otsu 1979)."""
    third = [slice(side // 3, 2 * side // 3) for side in ratio.shape]
    usual = max(float(np.median(ratio[third[0], third[1]])), 1e-6)
    shares = np.log(np.clip(ratio / usual, _LEAST / 10, 1))
    codes = cv2.normalize(shares, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)
    code, _ = cv2.threshold(codes, 0, 255, cv2.THRESH_OTSU)
    between = np.exp(shares.min() + code / 255 * np.ptp(shares))
    return usual * float(np.clip(between, _LEAST, _MOST))


def _largest(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The largest connected part, thin bridges cut, holes filled."""
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, _disc(_BRIDGE * mask.shape[1]))
    contours, _ = cv2.findContours(opened, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = np.zeros(mask.shape, np.uint8)
    if contours:
        cv2.drawContours(filled, [max(contours, key=cv2.contourArea)], -1, 1, cv2.FILLED)
    return filled > 0


def _soft_edge(body: NDArray[np.bool_], ratio: NDArray[np.float32]) -> Mask:
    """Alpha: at the body's edge the share of the light that the flash adds just inside of it."""
    reach = _EDGE * body.shape[1]
    inner = cv2.erode(body.astype(np.uint8), _disc(reach), borderValue=1).astype(np.float32)
    near = cv2.dilate(body.astype(np.uint8), _disc(reach)) > 0
    weight = cv2.GaussianBlur(inner, (0, 0), reach) + np.float32(1e-6)
    inside = cv2.GaussianBlur(ratio * inner, (0, 0), reach) / weight
    share = np.clip(ratio / np.maximum(_FULL * inside, 1e-6), 0, 1)
    return np.where(inner > 0, np.float32(1), np.where(near, share, np.float32(0))).astype(np.float32)


def _disc(radius: float) -> NDArray[np.uint8]:
    reach = max(1, round(radius))
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1)), np.uint8)
