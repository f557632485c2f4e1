"""Normal completion: unreliable normals are replaced by those of their neighbours and of the person's outline."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array
from relit_camera.base.images.image_types import Mask


@dataclass(frozen=True)
class NormalCompletionTunables:
    """Constants of the completion, chosen by `relit evaluate field` on rendered heads (docs/reflectance.md).

    Attributes:
        outline_confidence: of the normals that follow from the outline.
        outline_slope: z of a normal at the outline over its length across: half a pixel inside, a round body has turned
            that far.
        outline_blur_px: standard deviation of the blur of the matte whose gradient points out of the body.
        min_facing: least z of a normal: visible surface faces the camera.
    """

    outline_confidence: float = 0.3
    outline_slope: float = 0.4
    outline_blur_px: float = 1.5
    min_facing: float = 0.03


TUNABLES = NormalCompletionTunables()


def complete_normals(normals: Float32Array, confidence: Mask, matte: Mask) -> Float32Array:
    """Unit normals (height, width, 3): unchanged where `confidence` (height, width) is 1, filled in where it is 0.

    A body's surface turns away from the camera at its outline, so there the matte's gradient gives the normal (Ikeuchi
    and Horn 1981). The picture's own border is no outline. Outside the matte normals are (0, 0, 1).
    """
    outline, edge = _outline(matte)
    reliability = np.where(matte > 0, confidence, 0).astype(np.float32)
    guess = (TUNABLES.outline_confidence * edge * (1 - reliability)).astype(np.float32)
    weight = reliability + guess
    mean = (normals * reliability[..., None] + outline * guess[..., None]) / np.maximum(weight, 1e-6)[..., None]
    filled = pull_push_fill(mean, weight)
    filled[..., 2] = np.maximum(filled[..., 2], TUNABLES.min_facing)
    filled[matte <= 0] = (0, 0, 1)
    return np.asarray(filled / np.linalg.norm(filled, axis=2, keepdims=True), np.float32)


def pull_push_fill(values: Float32Array, weight: Mask) -> Float32Array:
    """Values (height, width, channels), interpolated from their surroundings where `weight` (height, width) is below 1.

    Pull-push on a pyramid (Gortler et al. 1996): weighted means go to coarser levels and fill finer ones where weight
    is missing.
    """
    height, width = weight.shape
    if max(height, width) == 1:
        return values
    half = (max(1, (width + 1) // 2), max(1, (height + 1) // 2))
    summed = cv2.resize(values * weight[..., None], half, interpolation=cv2.INTER_AREA).reshape(half[1], half[0], -1)
    fraction = cv2.resize(weight, half, interpolation=cv2.INTER_AREA).reshape(half[1], half[0])
    coarse = pull_push_fill(summed / np.maximum(fraction, 1e-9)[..., None], np.minimum(4 * fraction, 1))
    around = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR).reshape(values.shape)
    known = np.minimum(weight, 1)[..., None]
    return np.asarray(values * known + around * (1 - known), np.float32)


def _outline(matte: Mask) -> tuple[Float32Array, NDArray[np.bool_]]:
    """Normals (height, width, 3) from the matte's gradient, and the mask (height, width) of pixels at its edge."""
    body = (matte > 0.5).astype(np.float32)
    soft = cv2.GaussianBlur(body, (0, 0), TUNABLES.outline_blur_px, borderType=cv2.BORDER_REPLICATE)
    # Right and up, out of the body.
    right = -cv2.Sobel(soft, cv2.CV_32F, 1, 0, borderType=cv2.BORDER_REPLICATE)
    up = cv2.Sobel(soft, cv2.CV_32F, 0, 1, borderType=cv2.BORDER_REPLICATE)
    steep = np.hypot(right, up)
    normals = np.stack([right, up, TUNABLES.outline_slope * steep + 1e-6], axis=-1)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    inner = cv2.erode(body, np.ones((3, 3)), borderType=cv2.BORDER_REPLICATE)
    return normals.astype(np.float32), (matte > 0) & (inner < 0.5) & (steep > 1e-4)
