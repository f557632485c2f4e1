"""Noticing that a picture is suddenly another where the face was: a jump, a cut, a file that begins anew."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.face.crop import Crop, bounds
from relit_camera.space.images import DisplayImage, Points

_SIDE = 24
_SAME_CORRELATION = 0.65
"""Between frames of talking and turning people the correlation stays above 0.67 but for 12 frames a second with quick
turns (0.60); after a jump of half an eye distance it is under 0.65 nearly always."""


class Glimpse:
    """Where the face was in one frame, and how the picture looked there.

    Attributes:
        points: (count, 2) float32 landmarks.
    """

    def __init__(self, image: DisplayImage, points: Points) -> None:
        """Look at the upright box around the landmarks."""
        self.points = points
        x, y, width, height = bounds(points)
        self._crop = Crop((x + width / 2, y + height / 2), max(width, 1.0), max(height, 1.0))
        self._pixels = self._look(image)

    def still_there(self, image: DisplayImage) -> bool:
        """Whether the next frame looks alike at the same place."""
        norms = float(np.linalg.norm(self._pixels) * np.linalg.norm(now := self._look(image)))
        return float(self._pixels @ now) >= _SAME_CORRELATION * norms

    def _look(self, image: DisplayImage) -> NDArray[np.float32]:
        """The thumbnail's luma without its mean."""
        luma = self._crop.cut(image, _SIDE, _SIDE).astype(np.float32).mean(axis=2).ravel()
        return np.asarray(luma - luma.mean(), dtype=np.float32)
