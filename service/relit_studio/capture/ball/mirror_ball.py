"""Geometry of the mirror ball: its outline in the picture, and the reflection point of the torch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from relit_studio.cameras.pinhole import Pinhole

Vectors = NDArray[np.float64]


@dataclass(frozen=True)
class Outline:
    """Outline of a ball in the picture: an ellipse, elongated away from the picture's center.

    Attributes:
        x, y: its center in pixels.
        radius: of the circle of the same area, pixels.
        semi_radial, semi_tangential: half axes in pixels, along the line from the picture's middle and across it.
    """

    x: float
    y: float
    radius: float
    semi_radial: float
    semi_tangential: float


@dataclass(frozen=True, eq=False)
class MirrorBall:
    """Mirror ball of polished metal.

    Attributes:
        center: (3,) camera axes, centimeters.
        radius_cm: of the ball.
        reflectance: fraction of the light that it mirrors, linear RGB (3,).
    """

    center: Vectors
    radius_cm: float
    reflectance: NDArray[np.float32]

    def outline(self, camera: Pinhole) -> Outline:
        """Exact outline, from the cone of rays tangent to the ball."""
        distance = float(np.linalg.norm(self.center))
        off_axis = np.arccos(-self.center[2] / distance)
        half_angle = np.arcsin(self.radius_cm / distance)
        # The cone of half angle γ about an axis α off the camera's cuts the picture plane in this ellipse.
        common = np.cos(half_angle) ** 2 - np.sin(off_axis) ** 2
        semi_radial = camera.focal_px * np.sin(half_angle) * np.cos(half_angle) / common
        semi_tangential = camera.focal_px * np.sin(half_angle) / np.sqrt(common)
        away = camera.focal_px * np.sin(off_axis) * np.cos(off_axis) / common
        direction = self.center[:2] / max(float(np.linalg.norm(self.center[:2])), 1e-12)
        return Outline(
            x=float(camera.width / 2 + away * direction[0]),
            y=float(camera.height / 2 - away * direction[1]),
            radius=float(np.sqrt(semi_radial * semi_tangential)),
            semi_radial=float(semi_radial),
            semi_tangential=float(semi_tangential),
        )

    def reflect(self, rays: Vectors) -> tuple[NDArray[np.bool_], Vectors, Vectors]:
        """Trace unit rays (count, 3) from the camera.

        Returns:
            Which of them hit (count,); of those the points hit (hits, 3) and the unit mirrored rays (hits, 3).
        """
        along = rays @ self.center
        under_root = along**2 - (self.center @ self.center - self.radius_cm**2)
        hit = (under_root > 0) & (along > 0)
        ray = rays[hit]
        points = ray * (along[hit] - np.sqrt(under_root[hit]))[:, None]
        normals = (points - self.center) / self.radius_cm
        mirrored = ray - 2 * np.einsum("ij,ij->i", ray, normals)[:, None] * normals
        return hit, points, mirrored

    def reflection_point(self, light: ArrayLike) -> Vectors:
        """The point (3,) of the surface at which the camera sees a light at (3,): Alhazen's problem.

        It lies in the plane of camera, center and light, where the normal halves the angle between the ways to both.

        Raises:
            ValueError: the light is inside the ball.
        """
        way = np.asarray(light, np.float64) - self.center
        if np.linalg.norm(way) <= self.radius_cm:
            raise ValueError("the light is inside the ball")
        to_camera = -self.center / np.linalg.norm(self.center)
        aside = way - (way @ to_camera) * to_camera
        length = np.linalg.norm(aside)
        if length < 1e-9:
            return np.asarray(self.center + self.radius_cm * to_camera)
        aside /= length
        span = float(np.arctan2(length, way @ to_camera))

        def imbalance(turn: float) -> float:
            normal = np.cos(turn) * to_camera + np.sin(turn) * aside
            point = self.center + self.radius_cm * normal
            return _angle(normal, -point) - _angle(normal, way - self.radius_cm * normal)

        turn = float(brentq(imbalance, 0.0, span, xtol=1e-13))
        return np.asarray(self.center + self.radius_cm * (np.cos(turn) * to_camera + np.sin(turn) * aside))


def _angle(a: Vectors, b: Vectors) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
