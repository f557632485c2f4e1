"""Affine maps of pictures: between points with pixel centres at integers + ½ and OpenCV's, which are at integers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def opencv_affine(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """The (2, 3) map for `cv2.warpAffine` that does what `matrix` (2, 3) does to points (x, y, 1).

    The project counts pixel centres at integers + ½, OpenCV at integers: points shift by ½ before the map and by −½
    after it.
    """
    shifted = matrix.copy()
    shifted[:, 2] += matrix[:, :2] @ (0.5, 0.5) - 0.5
    return shifted
