"""A mirror ball's outline in the picture, and the camera's view of the ball: surface normals and reflected rays.

Everything is in camera axes (x right, y up, the camera looking along -z) and in radii of the ball, since a picture of a
ball does not show its size.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Vectors = NDArray[np.float64]

_MAX_ITERATIONS = 30
"""Fixed-point iterations from an outline to its cone of rays."""


@dataclass(frozen=True)
class BallOutline:
    """A ball's outline in the picture, in pixels, pixel centers at integers + ½.

    A ball beside the camera's axis has an ellipse for its outline, elongated toward the picture's middle.

    Attributes:
        x, y: center of the outline, which is not exactly the projection of the ball's center.
        radius: of the circle whose area the outline has.
    """

    x: float
    y: float
    radius: float

    def moved(self, dx: float, dy: float) -> BallOutline:
        """The outline shifted by pixels to the right and down."""
        return BallOutline(self.x + dx, self.y + dy, self.radius)

    def scaled(self, factor: float) -> BallOutline:
        """The outline in the same picture with `factor` times as many pixels along each side."""
        return BallOutline(self.x * factor, self.y * factor, self.radius * factor)

    def overlaps(self, other: BallOutline) -> bool:
        """Whether the circles of two outlines overlap or touch."""
        return bool(np.hypot(self.x - other.x, self.y - other.y) <= self.radius + other.radius)

    def pixels_within(self, fraction: float, size: tuple[int, int]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Rows and columns (count,) of the pixels whose centers are less than `fraction` radii from the center.

        Args:
            fraction: reach in radii.
            size: width and height of the picture.
        """
        reach = self.radius * fraction
        rows, columns = (
            np.arange(max(0, int(middle - reach)), min(side, int(middle + reach) + 2), dtype=np.intp)
            for middle, side in ((self.y, size[1]), (self.x, size[0]))
        )
        inside = np.hypot(columns[None] + 0.5 - self.x, rows[:, None] + 0.5 - self.y) < reach
        place = np.nonzero(inside)
        return rows[place[0]], columns[place[1]]


class BallView(Protocol):
    """A camera's view of a mirror ball."""

    @property
    def outline(self) -> BallOutline:
        """The ball's outline."""
        ...

    def normals(self, x: NDArray, y: NDArray) -> Vectors:
        """Outward unit normals (..., 3) of the surface at picture positions (...) in pixels; NaN beside the ball."""
        ...

    def reflect(self, normals: Vectors) -> Vectors:
        """Unit vectors (..., 3): the camera's rays after reflection where the surface has these normals."""
        ...

    def project(self, normals: Vectors) -> tuple[NDArray, NDArray]:
        """Pixel positions x and y (...) of the places where the surface has these normals (..., 3)."""
        ...


@dataclass(frozen=True)
class DistantView:
    """Orthographic view from far away: all rays are parallel to the axis (thesis 4.3.4; Mudge et al. 2006)."""

    outline: BallOutline

    def normals(self, x: NDArray, y: NDArray) -> Vectors:
        """See `BallView.normals`."""
        across = (np.asarray(x, np.float64) - self.outline.x) / self.outline.radius
        up = (self.outline.y - np.asarray(y, np.float64)) / self.outline.radius
        squared = 1 - across**2 - up**2
        inside = np.where(squared > 0, 1.0, np.nan)
        return np.stack([across * inside, up * inside, np.sqrt(squared * inside)], axis=-1)

    def reflect(self, normals: Vectors) -> Vectors:
        """See `BallView.reflect`: the normal's angle from the axis, doubled."""
        return np.asarray(2 * normals[..., 2:] * normals - [0.0, 0.0, 1.0])

    def project(self, normals: Vectors) -> tuple[NDArray, NDArray]:
        """See `BallView.project`."""
        return (
            self.outline.x + self.outline.radius * normals[..., 0],
            self.outline.y - self.outline.radius * normals[..., 1],
        )


class PinholeView:
    """Perspective view from a pinhole at the origin, its axis through the picture's middle.

    Attributes:
        outline: the ball's outline.
        size: width and height of the picture.
        focal_px: focal length in pixels.
        off_axis: angle in radians between the axis and the ball's center.
        half_angle: angle in radians that the ball's radius subtends.
        center: (3,) center of the ball, in radii of the ball.
    """

    def __init__(self, outline: BallOutline, size: tuple[int, int], focal_px: float) -> None:
        """Place a ball of radius 1 so that it has this outline.

        Args:
            outline: in pixels.
            size: width and height of the picture.
            focal_px: focal length in pixels.
        """
        self.outline, self.size, self.focal_px = outline, size, focal_px
        across, up = outline.x - size[0] / 2, size[1] / 2 - outline.y
        away = float(np.hypot(across, up))
        self.off_axis, self.half_angle = _cone(away, outline.radius, focal_px)
        side = np.array([across, up]) / max(away, 1e-12)
        sin = np.sin(self.off_axis)
        toward = [sin * side[0], sin * side[1], -np.cos(self.off_axis)]
        self.center: Vectors = np.array(toward) / np.sin(self.half_angle)

    def with_outline(self, outline: BallOutline) -> PinholeView:
        """The same camera's view of a ball with another outline."""
        return self if outline == self.outline else PinholeView(outline, self.size, self.focal_px)

    @property
    def elongation(self) -> float:
        """Ratio of the outline's long axis, which points to the picture's middle, to its short one."""
        return _elongation(self.off_axis, self.half_angle)

    def rays(self, x: NDArray, y: NDArray) -> Vectors:
        """Unit vectors (..., 3) from the camera through picture positions (...)."""
        across = (np.asarray(x, np.float64) - self.size[0] / 2) / self.focal_px
        up = (self.size[1] / 2 - np.asarray(y, np.float64)) / self.focal_px
        ray = np.stack(np.broadcast_arrays(across, up, np.float64(-1)), axis=-1)
        return np.asarray(ray / np.linalg.norm(ray, axis=-1, keepdims=True))

    def normals(self, x: NDArray, y: NDArray) -> Vectors:
        """See `BallView.normals`: of the first place where the ray meets the ball."""
        rays = self.rays(x, y)
        along = rays @ self.center
        squared = along**2 - (self.center @ self.center - 1)
        distance = along - np.sqrt(np.where(squared > 0, squared, np.nan))
        return np.asarray(distance[..., None] * rays - self.center)

    def reflect(self, normals: Vectors) -> Vectors:
        """See `BallView.reflect`."""
        points = self.center + normals
        rays = points / np.linalg.norm(points, axis=-1, keepdims=True)
        return np.asarray(rays - 2 * np.sum(rays * normals, axis=-1, keepdims=True) * normals)

    def project(self, normals: Vectors) -> tuple[NDArray, NDArray]:
        """See `BallView.project`."""
        points = self.center + normals
        scale = self.focal_px / -points[..., 2]
        return self.size[0] / 2 + scale * points[..., 0], self.size[1] / 2 - scale * points[..., 1]


class CroppedView:
    """A view of the ball in pixels of a downscaled crop of the picture; see `BallView`."""

    def __init__(self, view: PinholeView, corner: tuple[int, int], step: tuple[float, float]) -> None:
        """Convert to pixels of the crop.

        Args:
            view: in pixels of the picture.
            corner: x and y of the crop in the picture.
            step: pixels of the picture per pixel of the crop, along x and y.
        """
        self._view, self._corner, self._step = view, corner, step
        x, y = self._to_crop(view.outline.x, view.outline.y)
        self.outline = BallOutline(float(x), float(y), view.outline.radius / step[0])

    def to_picture(self, x: NDArray | float, y: NDArray | float) -> tuple[NDArray, NDArray]:
        """Position in the picture of a position in the crop."""
        return np.asarray(x) * self._step[0] + self._corner[0], np.asarray(y) * self._step[1] + self._corner[1]

    def _to_crop(self, x: NDArray | float, y: NDArray | float) -> tuple[NDArray, NDArray]:
        return (np.asarray(x) - self._corner[0]) / self._step[0], (np.asarray(y) - self._corner[1]) / self._step[1]

    def normals(self, x: NDArray, y: NDArray) -> Vectors:
        """See `BallView.normals`."""
        return self._view.normals(*self.to_picture(x, y))

    def reflect(self, normals: Vectors) -> Vectors:
        """See `BallView.reflect`."""
        return self._view.reflect(normals)

    def project(self, normals: Vectors) -> tuple[NDArray, NDArray]:
        """See `BallView.project`."""
        return self._to_crop(*self._view.project(normals))


def _elongation(off_axis: float, half_angle: float) -> float:
    """Ratio of the axes of the ellipse in which the cone of rays tangent to the ball cuts the image plane."""
    return float(np.cos(half_angle) / np.sqrt(np.cos(half_angle) ** 2 - np.sin(off_axis) ** 2))


def _cone(away: float, radius: float, focal_px: float) -> tuple[float, float]:
    """Angles in radians, off the axis and half across the ball, of an outline `away` from the picture's middle."""
    stretch = 1.0
    for _ in range(_MAX_ITERATIONS):
        along = radius * np.sqrt(stretch)
        outer, inner = np.arctan((away + along) / focal_px), np.arctan((away - along) / focal_px)
        off_axis, half_angle = float(outer + inner) / 2, float(outer - inner) / 2
        before, stretch = stretch, _elongation(off_axis, half_angle)
        if abs(stretch - before) < 1e-9:
            break
    return off_axis, half_angle
