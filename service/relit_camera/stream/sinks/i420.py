"""From pictures to I420, the layout that every reader of a virtual camera understands."""

from __future__ import annotations

import cv2
import numpy as np

from relit_camera.space.images import DisplayImage

# ITU-R BT.601, limited range: U and V of R, G, B from 0 to 255.
CHROMA = np.array(
    [[-37.797, -74.203, 112.0, 128 * 255], [112.0, -93.786, -18.214, 128 * 255]], dtype=np.float32
) / np.float32(255)


def i420(image: DisplayImage) -> np.ndarray:
    """Convert uint8 sRGB RGB (height, width, 3), both even, to uint8 (height · width · 3/2,): planes Y, U, V.

    Colour is the mean of each two by two pixels: OpenCV's own conversion takes every second pixel's, which frays edges.
    """
    height, width = image.shape[:2]
    planes: np.ndarray = cv2.cvtColor(image, cv2.COLOR_RGB2YUV_I420).reshape(-1)
    half = cv2.resize(image, (width // 2, height // 2), interpolation=cv2.INTER_AREA)
    chroma = cv2.transform(half, CHROMA)
    planes[height * width :].reshape(2, height // 2, width // 2)[:] = chroma.transpose(2, 0, 1)
    return planes
