"""A ball's outline in the picture.

How the camera sees a mirror ball: the surface and the mirrored ray at a place in the picture.

Everything is in camera axes and in radii of the ball: what a picture of a ball shows does not tell its size.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class BallOutline:
    """Where a ball is in the picture, in pixels, pixel centres at integers + ½.

    A ball beside the camera's axis has an ellipse for its outline, drawn out away from the picture's middle.

    Attributes:
        x, y: the outline's centre, which is not quite the picture of the ball's centre.
        radius: of the circle of the outline's area.
    """

    x: float
    y: float
    radius: float

    def moved(self, dx: float, dy: float) -> BallOutline:
        """The same elsewhere."""
        return BallOutline(self.x + dx, self.y + dy, self.radius)

    def scaled(self, factor: float) -> BallOutline:
        """The same in a picture of `factor` times as many pixels along each side."""
        return BallOutline(self.x * factor, self.y * factor, self.radius * factor)

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


Vectors = NDArray[np.float64]

_ROUNDS = 30


class BallView(Protocol):
    """A camera's view of a ball."""

    @property
    def outline(self) -> BallOutline:
        """The ball's outline."""
        ...

    def normals(self, x: NDArray, y: NDArray) -> Vectors:
        """Outward unit normals (..., 3) at picture positions (...) in pixels; NaN beside the ball."""
        ...

    def mirrored(self, normals: Vectors) -> Vectors:
        """Unit vectors (..., 3) into which the camera's rays are mirrored where the surface has these normals."""
        ...

    def picture(self, normals: Vectors) -> tuple[NDArray, NDArray]:
        """Pixels x and y (...) at which the surface with these normals (..., 3) is seen."""
        ...


@dataclass(frozen=True)
class DistantView:
    """From far away: all rays are parallel to the axis (thesis 4.3.4; Mudge et al. 2006)."""

    outline: BallOutline

    def normals(self, x: NDArray, y: NDArray) -> Vectors:
        """See `BallView.normals`."""
        across = (np.asarray(x, np.float64) - self.outline.x) / self.outline.radius
        up = (self.outline.y - np.asarray(y, np.float64)) / self.outline.radius
        squared = 1 - across**2 - up**2
        inside = np.where(squared > 0, 1.0, np.nan)
        return np.stack([across * inside, up * inside, np.sqrt(squared * inside)], axis=-1)

    def mirrored(self, normals: Vectors) -> Vectors:
        """See `BallView.mirrored`: the normal's angle from the axis, doubled."""
        return np.asarray(2 * normals[..., 2:] * normals - [0.0, 0.0, 1.0])

    def picture(self, normals: Vectors) -> tuple[NDArray, NDArray]:
        """See `BallView.picture`."""
        return (
            self.outline.x + self.outline.radius * normals[..., 0],
            self.outline.y - self.outline.radius * normals[..., 1],
        )


class PinholeView:
    """From a pinhole at the origin, its axis through the picture's middle.

    Attributes:
        outline: as given.
        size: width and height of the picture.
        focal_px: focal length in pixels.
        off_axis, half_angle: angles (radians) between the axis and the ball's centre, and across half the ball.
        center: (3,) the ball's centre in radii of the ball.
    """

    def __init__(self, outline: BallOutline, size: tuple[int, int], focal_px: float) -> None:
        """Place a ball of radius 1 so that its outline is this."""
        self.outline, self.size, self.focal_px = outline, size, focal_px
        across, up = outline.x - size[0] / 2, size[1] / 2 - outline.y
        away = float(np.hypot(across, up))
        self.off_axis, self.half_angle = _cone(away, outline.radius, focal_px)
        side = np.array([across, up]) / max(away, 1e-12)
        sin = np.sin(self.off_axis)
        toward = [sin * side[0], sin * side[1], -np.cos(self.off_axis)]
        self.center: Vectors = np.array(toward) / np.sin(self.half_angle)

    @property
    def elongation(self) -> float:
        """Long over short axis of the outline's ellipse, whose long axis points to the picture's middle."""
        return _elongation(self.off_axis, self.half_angle)

    def rays(self, x: NDArray, y: NDArray) -> Vectors:
        """Unit vectors (..., 3) from the camera through picture positions (...)."""
        across = (np.asarray(x, np.float64) - self.size[0] / 2) / self.focal_px
        up = (self.size[1] / 2 - np.asarray(y, np.float64)) / self.focal_px
        ray = np.stack(np.broadcast_arrays(across, up, np.float64(-1)), axis=-1)
        return np.asarray(ray / np.linalg.norm(ray, axis=-1, keepdims=True))

    def normals(self, x: NDArray, y: NDArray) -> Vectors:
        """See `BallView.normals`: where the ray meets the ball first."""
        rays = self.rays(x, y)
        along = rays @ self.center
        squared = along**2 - (self.center @ self.center - 1)
        distance = along - np.sqrt(np.where(squared > 0, squared, np.nan))
        return np.asarray(distance[..., None] * rays - self.center)

    def mirrored(self, normals: Vectors) -> Vectors:
        """See `BallView.mirrored`."""
        points = self.center + normals
        rays = points / np.linalg.norm(points, axis=-1, keepdims=True)
        return np.asarray(rays - 2 * np.sum(rays * normals, axis=-1, keepdims=True) * normals)

    def picture(self, normals: Vectors) -> tuple[NDArray, NDArray]:
        """See `BallView.picture`."""
        points = self.center + normals
        scale = self.focal_px / -points[..., 2]
        return self.size[0] / 2 + scale * points[..., 0], self.size[1] / 2 - scale * points[..., 1]


def _elongation(off_axis: float, half_angle: float) -> float:
    """Of the ellipse in which the cone of rays that touch the ball cuts the picture's plane."""
    return float(np.cos(half_angle) / np.sqrt(np.cos(half_angle) ** 2 - np.sin(off_axis) ** 2))


def _cone(away: float, radius: float, focal_px: float) -> tuple[float, float]:
    """Angles (radians) off the axis and across half the ball, of an outline `away` from the picture's middle."""
    stretch = 1.0
    for _ in range(_ROUNDS):
        along = radius * np.sqrt(stretch)
        outer, inner = np.arctan((away + along) / focal_px), np.arctan((away - along) / focal_px)
        off_axis, half_angle = float(outer + inner) / 2, float(outer - inner) / 2
        before, stretch = stretch, _elongation(off_axis, half_angle)
        if abs(stretch - before) < 1e-9:
            break
    return off_axis, half_angle
