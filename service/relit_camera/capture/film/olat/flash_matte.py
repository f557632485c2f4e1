"""The person's matte: what the flash reaches and the room behind is not.

A lamp near the person adds far more to the room's light that they reflect than to that which the wall behind reflects.
This ratio does not depend on color: dark hair has the same as light skin.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.concurrency.threads import worker_pool
from relit_camera.base.errors import CaptureError
from relit_camera.base.images.color import luminance
from relit_camera.base.images.image_types import LinearImage, Mask


@dataclass(frozen=True)
class MatteTunables:
    """What counts as the person; `relit evaluate field` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        high, low: percentiles over the lights that stand for a pixel's largest value, and for noise about zero.
        block_rows: rows of the pictures that are processed at once.
        min_room: room light below which there is only noise, in the pictures' unit.
        min_threshold, max_threshold: limits of the threshold between person and room, relative to the person's ratio.
        bridge: radius of the opening that cuts bridges between the person and other things, as a fraction of the
            picture's width.
        edge: reach of the soft edge, as a fraction of the picture's width.
        opaque: fraction of the ratio just inside from which a pixel of the edge is opaque.
        min_face: least fraction of the face that must belong to the person.
    """

    high: float = 92.0
    low: float = 15.0
    block_rows: int = 64
    min_room: float = 0.004
    min_threshold: float = 0.02
    max_threshold: float = 0.35
    bridge: float = 0.006
    edge: float = 0.012
    opaque: float = 0.8
    min_face: float = 0.5


_TUNABLES = MatteTunables()


def estimate_flash_matte(
    pictures: NDArray[np.floating], room: LinearImage, excluded: NDArray[np.bool_] | None = None
) -> Mask:
    """The person's alpha (height, width), float32 0..1: the largest region that the flash reaches.

    Args:
        pictures: (lights, height, width, 3) linear RGB of the flash alone.
        room: (height, width, 3) linear RGB without the flash, in the same unit.
        excluded: (height, width) mask of places where the person cannot be, as on the mirror ball.
    """
    ratio = flash_ratio(pictures, room)
    if excluded is not None:
        ratio[excluded] = 0
    body = _largest_region(ratio > _threshold(ratio))
    return _soft_edge(body, ratio) if body.any() else np.zeros(ratio.shape, np.float32)


def require_face_in_matte(matte: Mask, face: NDArray[np.bool_]) -> None:
    """Check that the matte contains the face.

    Args:
        matte: (height, width).
        face: (height, width) mask of the face's circle.

    Raises:
        CaptureError: it does not: the flash lights the person hardly more than the room does.
    """
    fraction = matte[face].mean()
    if fraction < _TUNABLES.min_face:
        raise CaptureError(
            f"the flash lights {fraction:.0%} of the face: the person cannot be told from the room",
            "make the room darker, or hold the lamp nearer, about a metre from the face",
        )


def flash_ratio(pictures: NDArray[np.floating], room: LinearImage) -> NDArray[np.float32]:
    """Ratio (height, width) of the flash's light to the room's, by the lights that reach a pixel best.

    Arguments as in `estimate_flash_matte`.
    """

    def added_in(top: int) -> NDArray[np.floating]:
        rows = luminance(pictures[:, top : top + _TUNABLES.block_rows].astype(np.float32))
        low, high = np.percentile(rows, [_TUNABLES.low, _TUNABLES.high], axis=0)
        # Noise is symmetric, light is positive: the low percentile shows how much of the high one is noise.
        return np.asarray(np.maximum(high + np.minimum(low, 0), 0))

    with worker_pool() as pool:
        added = np.concatenate(list(pool.map(added_in, range(0, len(room), _TUNABLES.block_rows))))
    return np.asarray(added / (np.maximum(luminance(room), 0) + np.float32(_TUNABLES.min_room)), np.float32)


def _threshold(ratio: NDArray[np.float32]) -> float:
    """Threshold between the room's ratio and that of the person in the middle, on a log scale (Otsu 1979)."""
    third = [slice(side // 3, 2 * side // 3) for side in ratio.shape]
    of_person = max(float(np.median(ratio[third[0], third[1]])), 1e-6)
    fractions = np.log(np.clip(ratio / of_person, _TUNABLES.min_threshold / 10, 1))
    codes = cv2.normalize(fractions, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)
    code, _ = cv2.threshold(codes, 0, 255, cv2.THRESH_OTSU)
    between = np.exp(fractions.min() + code / 255 * np.ptp(fractions))
    return of_person * float(np.clip(between, _TUNABLES.min_threshold, _TUNABLES.max_threshold))


def _largest_region(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The largest connected region of a mask (height, width), thin bridges cut, holes filled."""
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, _ellipse(_TUNABLES.bridge * mask.shape[1]))
    contours, _ = cv2.findContours(opened, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = np.zeros(mask.shape, np.uint8)
    if contours:
        cv2.drawContours(filled, [max(contours, key=cv2.contourArea)], -1, 1, cv2.FILLED)
    return filled > 0


def _soft_edge(body: NDArray[np.bool_], ratio: NDArray[np.float32]) -> Mask:
    """Alpha (height, width): within reach of the body's edge, the ratio relative to that just inside the body."""
    reach = _TUNABLES.edge * body.shape[1]
    inner = cv2.erode(body.astype(np.uint8), _ellipse(reach), borderValue=1).astype(np.float32)
    near = cv2.dilate(body.astype(np.uint8), _ellipse(reach)) > 0
    weight = cv2.GaussianBlur(inner, (0, 0), reach) + np.float32(1e-6)
    inside = cv2.GaussianBlur(ratio * inner, (0, 0), reach) / weight
    fraction = np.clip(ratio / np.maximum(_TUNABLES.opaque * inside, 1e-6), 0, 1)
    return np.where(inner > 0, np.float32(1), np.where(near, fraction, np.float32(0))).astype(np.float32)


def _ellipse(radius: float) -> NDArray[np.uint8]:
    """Round structuring element of a radius in pixels, at least 1."""
    reach = max(1, round(radius))
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1)), np.uint8)
