"""Measures of picture quality: PSNR of linear pictures and SSIM of sRGB ones, inside a matte."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import DisplayImage, LinearImage, Mask

PEAK_PERCENT = 99.5
"""Percentile of a picture's values that is called its peak."""


def psnr(picture: LinearImage, truth: LinearImage, matte: Mask | None = None, peak: float | None = None) -> float:
    """PSNR in dB of a linear picture against the truth, both (height, width, 3).

    Inside the matte (alpha > ½); the truth is scaled so that its 99.5th percentile there is 1 (or by `peak` where it
    is given), the picture by the same factor, both clipped to [0, 1], peak 1. Infinite for equal pictures.

    Raises:
        ValueError: the shapes differ, or the matte is empty.
    """
    if picture.shape != truth.shape:
        raise ValueError(f"picture {picture.shape} and truth {truth.shape} differ in shape")
    inside = np.ones(truth.shape[:2], bool) if matte is None else matte > 0.5
    if not inside.any():
        raise ValueError("the matte is empty")
    expected, seen = truth[inside].astype(np.float64), picture[inside].astype(np.float64)
    scale = peak if peak is not None else float(np.percentile(expected, PEAK_PERCENT))
    scale = scale if scale > 0 else 1.0
    error = np.mean((np.clip(expected / scale, 0, 1) - np.clip(seen / scale, 0, 1)) ** 2)
    return float(-10 * np.log10(error)) if error > 0 else float("inf")


def ssim(picture: DisplayImage, truth: DisplayImage, matte: Mask | None = None) -> float:
    """Mean SSIM of sRGB luma of two uint8 pictures (Wang et al. 2004: Gaussian window, sigma 1.5), inside the matte."""
    x, y = (cv2.cvtColor(p, cv2.COLOR_RGB2GRAY).astype(np.float32) for p in (picture, truth))

    def blur(image: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.asarray(cv2.GaussianBlur(image, (11, 11), 1.5), dtype=np.float32)

    mean_x, mean_y = blur(x), blur(y)
    var_x, var_y = blur(x * x) - mean_x**2, blur(y * y) - mean_y**2
    covariance = blur(x * y) - mean_x * mean_y
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    numerator = (2 * mean_x * mean_y + c1) * (2 * covariance + c2)
    value = numerator / ((mean_x**2 + mean_y**2 + c1) * (var_x + var_y + c2))
    return float(value[matte > 0.5].mean() if matte is not None else value.mean())
