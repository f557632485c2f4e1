"""A normal for every pixel of the person: what is known badly is taken from its neighbours and from the outline."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import Mask

Floats = NDArray[np.float32]

OUTLINE_TRUST = 0.3
"""Confidence of the normals that the outline tells."""
OUTLINE_SLOPE = 0.4
"""z over the part across of a normal at the outline: half a pixel inside, a round body has turned that far."""
OUTLINE_BLUR = 1.5
"""Standard deviation, pixels, of the matte's blur whose slope is the way out."""
MIN_FACING = 0.03
"""Least z: what is seen faces the camera."""


def complete_normals(normals: Floats, confidence: Mask, matte: Mask) -> Floats:
    """Unit normals (height, width, 3): as they are where `confidence` (height, width) is 1, filled in where it is 0.

    A body's surface turns away from the camera at its outline, so there the matte's slope tells the normal (Ikeuchi and
    Horn 1981). The picture's own border is no outline. Outside of the matte it is (0, 0, 1).
    """
    outline, edge = _outline(matte)
    trust = np.where(matte > 0, confidence, 0).astype(np.float32)
    guess = (OUTLINE_TRUST * edge * (1 - trust)).astype(np.float32)
    weight = trust + guess
    mean = (normals * trust[..., None] + outline * guess[..., None]) / np.maximum(weight, 1e-6)[..., None]
    filled = pull_push_fill(mean, weight)
    filled[..., 2] = np.maximum(filled[..., 2], MIN_FACING)
    filled[matte <= 0] = (0, 0, 1)
    return np.asarray(filled / np.linalg.norm(filled, axis=2, keepdims=True), np.float32)


def pull_push_fill(values: Floats, weight: Mask) -> Floats:
    """Values (height, width, channels) mixed with their surroundings where `weight` (height, width) is below 1.

    Pull and push on a pyramid (Gortler et al. 1996): weighted means go up, and come down where trust is missing.
    """
    height, width = weight.shape
    if max(height, width) == 1:
        return values
    half = (max(1, (width + 1) // 2), max(1, (height + 1) // 2))
    summed = cv2.resize(values * weight[..., None], half, interpolation=cv2.INTER_AREA).reshape(half[1], half[0], -1)
    share = cv2.resize(weight, half, interpolation=cv2.INTER_AREA).reshape(half[1], half[0])
    coarse = pull_push_fill(summed / np.maximum(share, 1e-9)[..., None], np.minimum(4 * share, 1))
    around = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR).reshape(values.shape)
    known = np.minimum(weight, 1)[..., None]
    return np.asarray(values * known + around * (1 - known), np.float32)


def _outline(matte: Mask) -> tuple[Floats, NDArray[np.bool_]]:
    """Normals (height, width, 3) by the matte's slope, and the pixels (height, width) that lie at its edge."""
    body = (matte > 0.5).astype(np.float32)
    soft = cv2.GaussianBlur(body, (0, 0), OUTLINE_BLUR, borderType=cv2.BORDER_REPLICATE)
    # Right and up, out of the body.
    right = -cv2.Sobel(soft, cv2.CV_32F, 1, 0, borderType=cv2.BORDER_REPLICATE)
    up = cv2.Sobel(soft, cv2.CV_32F, 0, 1, borderType=cv2.BORDER_REPLICATE)
    steep = np.hypot(right, up)
    normals = np.stack([right, up, OUTLINE_SLOPE * steep + 1e-6], axis=-1)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    inner = cv2.erode(body, np.ones((3, 3)), borderType=cv2.BORDER_REPLICATE)
    return normals.astype(np.float32), (matte > 0) & (inner < 0.5) & (steep > 1e-4)
