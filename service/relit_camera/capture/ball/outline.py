"""A ball's outline in the picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Outline:
    """Where a ball is in the picture, in pixels, pixel centres at integers + ½.

    A ball beside the camera's axis has an ellipse for its outline, drawn out away from the picture's middle.

    Attributes:
        x, y: the outline's centre, which is not quite the picture of the ball's centre.
        radius: of the circle of the outline's area.
    """

    x: float
    y: float
    radius: float

    def moved(self, dx: float, dy: float) -> Outline:
        """The same elsewhere."""
        return Outline(self.x + dx, self.y + dy, self.radius)

    def scaled(self, factor: float) -> Outline:
        """The same in a picture of `factor` times as many pixels along each side."""
        return Outline(self.x * factor, self.y * factor, self.radius * factor)

    def pixels_within(self, share: float, size: tuple[int, int]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Rows and columns (count,) of a picture's pixels whose centres are within so many radii of the centre."""
        reach = self.radius * share
        rows, columns = (
            np.arange(max(0, int(middle - reach)), min(side, int(middle + reach) + 2), dtype=np.intp)
            for middle, side in ((self.y, size[1]), (self.x, size[0]))
        )
        inside = np.hypot(columns[None] + 0.5 - self.x, rows[:, None] + 0.5 - self.y) < reach
        place = np.nonzero(inside)
        return rows[place[0]], columns[place[1]]
