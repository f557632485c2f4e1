"""The circle about a face, as it is given by the user or found in a film."""

from __future__ import annotations

from typing import NamedTuple


class FaceCircle(NamedTuple):
    """A circle about a face, brow to chin, in pixels of the upright film; pixel centers at integers + ½.

    Attributes:
        x, y: center.
        radius: half the face's height.
    """

    x: float
    y: float
    radius: float

    def scaled(self, factor: float) -> FaceCircle:
        """The circle in the same picture with `factor` times as many pixels along each side."""
        return FaceCircle(self.x * factor, self.y * factor, self.radius * factor)

    def moved(self, x: float, y: float) -> FaceCircle:
        """The circle shifted by pixels to the right and down."""
        return FaceCircle(self.x + x, self.y + y, self.radius)
