"""A square about the face, seen as if the face had not moved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.face_circle import Circle
from relit_camera.capture.stabilise.rigid import Rigid, Size, warp


@dataclass(frozen=True)
class Window:
    """A square of whole pixels in the reference picture.

    Attributes:
        left, top: its corner.
        side: in pixels.
        size: of the whole picture.
    """

    left: int
    top: int
    side: int
    size: Size

    @classmethod
    def about(cls, circle: Circle, reach: float, size: Size) -> Window:
        """The square about a circle so many times as large."""
        side = 2 * round(circle.radius * reach)
        return cls(round(circle.x) - side // 2, round(circle.y) - side // 2, side, size)

    def cut(self, picture: NDArray[np.float32], transform: Rigid) -> NDArray[np.float32]:
        """The square (side, side) out of a frame's picture (height, width) after its transform to the reference."""
        matrix = transform.matrix(self.size)
        matrix[:, 2] -= self.left, self.top
        return warp(picture, matrix, (self.side, self.side))

    def disc(self, circle: Circle, share: float) -> NDArray[np.float32]:
        """Weights (side, side): 1 in a share of the circle's radius, falling to 0 over the next tenth of it."""
        place = np.arange(self.side) + 0.5
        distance = np.hypot(place + self.left - circle.x, place[:, None] + self.top - circle.y) / circle.radius
        return np.asarray(np.clip((share + 0.1 - distance) / 0.1, 0, 1), np.float32)

    def in_picture(self, transform: Rigid) -> Rigid:
        """A transform about the square's centre as one about the picture's."""
        centre = np.array(self.size) / 2
        middle = np.array([self.left, self.top]) + self.side / 2
        turn = Rigid(transform.rotation_deg).matrix((0, 0))[:, :2]
        x, y = middle - centre - turn @ (middle - centre) + (transform.x, transform.y)
        return Rigid(transform.rotation_deg, float(x), float(y))

    def in_window(self, transform: Rigid) -> Rigid:
        """A transform about the picture's centre as one about the square's."""
        nothing = self.in_picture(Rigid(transform.rotation_deg))
        return Rigid(transform.rotation_deg, transform.x - nothing.x, transform.y - nothing.y)
