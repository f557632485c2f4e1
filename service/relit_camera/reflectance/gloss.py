"""What neighbours say of a pixel's highlights: a cheek's rim shows its own only under light that no capture has."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.reflectance.appearance import LOBES, Gloss
from relit_camera.space.images import Mask

Floats = NDArray[np.float32]

REACH = 0.12
"""Standard deviation of a neighbour's say, as a share of the picture's larger side."""
BRIGHT = 90
"""Percentile of the person's amounts of a highlight by which one pixel is expected to differ from its neighbours."""
ALIKE = 10
"""Lights whose errors are alike, so that they count as one: they are neighbours, and the law holds only nearly."""
WHOLE = 1e-3
"""Weight of the whole person's mean beside the neighbours'."""


def expected_gloss(found: Gloss, inside: NDArray[np.intp], matte: Mask) -> Gloss:
    """What is to be expected of each pixel's highlights before its own pictures are asked (empirical Bayes).

    A mean over the neighbours, those that tell theirs well counting most.

    Args:
        found: by each pixel's own pictures, of row-major pixels `inside`.
        inside: (pixels,) of the person.
        matte: (height, width).
    """
    height, width = matte.shape
    usual = np.percentile(found.amounts, BRIGHT, axis=0).astype(np.float32)
    sure = ALIKE / np.maximum(usual, 1e-6) ** 2
    trust = found.told / (found.told + sure) * (matte.ravel()[inside, None] > 0.5)
    sums, weights = np.zeros((2, height * width, len(LOBES)), np.float32)
    sums[inside], weights[inside] = trust * found.amounts, trust
    blurred = (
        cv2.GaussianBlur(each.reshape(height, width, -1), (0, 0), REACH * max(height, width)).reshape(-1, len(LOBES))
        for each in (sums, weights)
    )
    near, say = (each[inside] for each in blurred)
    whole = (trust * found.amounts).sum(axis=0) / np.maximum(trust.sum(axis=0), 1e-6)
    mean = (near + WHOLE * whole) / (say + WHOLE)
    return Gloss(mean.astype(np.float32), np.broadcast_to(sure, mean.shape).astype(np.float32))
