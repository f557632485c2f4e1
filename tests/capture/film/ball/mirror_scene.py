"""Photographs of a mirror ball in a painted room, traced ray by ray, with a known lamp."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import LinearImage
from relit_camera.capture.film.ball.specular_highlight import Highlight, NoHighlight, find_highlight
from relit_camera.capture.film.ball.sphere_projection import BallOutline, BallView, PinholeView

Vector = NDArray[np.float64]
FINE = 5


def unit(vector: Vector) -> Vector:
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def degrees_between(a: Vector, b: Vector) -> float:
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


@dataclass(frozen=True, eq=False)
class MirrorScene:
    """A ball before a camera at the origin that looks along −Z, camera axes, centimetres."""

    size: tuple[int, int] = (320, 240)
    focal_px: float = 300.0
    center: Vector = field(default_factory=lambda: np.array([12.0, 7.0, -60.0]))
    radius_cm: float = 5.0
    reflectance: float = 0.8
    lamp_radius_cm: float = 4.0
    wall: float = 0.06
    lens_px: float = 0.8
    noise: float = 0.0

    def rays(self, x: Vector, y: Vector) -> Vector:
        return unit(
            np.stack(
                [(x - self.size[0] / 2) / self.focal_px, (self.size[1] / 2 - y) / self.focal_px, -np.ones_like(x)], -1
            )
        )

    def project(self, point: Vector) -> tuple[float, float]:
        scale = self.focal_px / -point[2]
        return self.size[0] / 2 + scale * point[0], self.size[1] / 2 - scale * point[1]

    def hit(self, rays: Vector) -> tuple[NDArray[np.bool_], Vector]:
        """Which rays hit the ball, and where; by the quadratic's nearer root."""
        b = rays @ self.center
        under = b**2 - self.center @ self.center + self.radius_cm**2
        return under > 0, rays * (b - np.sqrt(np.maximum(under, 0)))[..., None]

    def mirror(self, rays: Vector, points: Vector) -> Vector:
        normals = (points - self.center) / self.radius_cm
        return rays - 2 * np.sum(rays * normals, axis=-1, keepdims=True) * normals

    def room(self, directions: Vector) -> Vector:
        """A wall with a dark floor, a white ceiling lamp and a window: smooth enough not to alias."""
        x, y, z = np.moveaxis(directions, -1, 0)
        shade = self.wall * (1 + 0.4 * np.tanh(6 * y + 1.5))
        window = 0.3 * np.exp(-(((x + 0.75) / 0.15) ** 2 + ((y - 0.25) / 0.2) ** 2)) * (z > -0.5)
        return shade + window

    def lamp_seen(self, points: Vector, directions: Vector, lamp: Vector, brightness: float) -> Vector:
        """The lamp's disc, a sphere of its radius, along rays from points."""
        to = lamp - points
        along = np.sum(to * directions, axis=-1)
        off = np.linalg.norm(to - along[..., None] * directions, axis=-1)
        return brightness * (off < self.lamp_radius_cm) * (along > 0)

    def photograph(
        self, lamp: Vector | None = None, seed: int = 0, exposure: float = 1.0, brightness: float = 40.0
    ) -> LinearImage:
        """Linear RGB, clipped to 1 as a camera does."""
        width, height = self.size
        light = self.room(self.rays(*np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)))
        rows, columns = self._box()
        light[rows, columns] = self._ball(rows, columns, lamp, brightness)
        light = light * exposure
        if self.noise:
            light = light + np.random.default_rng(seed).normal(0, self.noise, light.shape)
        return np.repeat(np.clip(light, 0, 1)[..., None], 3, axis=2).astype(np.float32)

    def _box(self) -> tuple[slice, slice]:
        """Rows and columns that the ball and its glare reach."""
        x, y = self.project(self.center)
        reach = 1.25 * self.focal_px * self.radius_cm / -self.center[2] + 6
        return (
            slice(max(0, int(y - reach)), min(self.size[1], int(y + reach))),
            slice(max(0, int(x - reach)), min(self.size[0], int(x + reach))),
        )

    def _ball(self, rows: slice, columns: slice, lamp: Vector | None, brightness: float) -> Vector:
        """The light there, many rays a pixel, blurred by the lens."""
        height, width = rows.stop - rows.start, columns.stop - columns.start
        x, y = np.meshgrid(
            columns.start + (np.arange(width * FINE) + 0.5) / FINE, rows.start + (np.arange(height * FINE) + 0.5) / FINE
        )
        rays = self.rays(x, y)
        seen = self.room(rays)
        hit, points = self.hit(rays)
        mirrored = self.mirror(rays[hit], points[hit])
        ball = self.room(mirrored)
        if lamp is not None:
            ball = ball + self.lamp_seen(points[hit], mirrored, lamp, brightness)
        seen[hit] = self.reflectance * ball
        blurred = cv2.GaussianBlur(seen, (0, 0), self.lens_px * FINE)
        return np.asarray(blurred.reshape(height, FINE, width, FINE).mean(axis=(1, 3)))

    def outline(self) -> tuple[float, float, float]:
        """Centre and radius of the circle of the outline's area, counted out."""
        x0, y0 = self.project(self.center)
        reach = 1.4 * self.focal_px * self.radius_cm / np.linalg.norm(self.center)
        x, y = np.meshgrid(np.linspace(x0 - reach, x0 + reach, 600), np.linspace(y0 - reach, y0 + reach, 600))
        hit, _ = self.hit(self.rays(x, y))
        area = hit.mean() * (2 * reach) ** 2
        return float(x[hit].mean()), float(y[hit].mean()), float(np.sqrt(area / np.pi))


def view_of(scene: MirrorScene) -> PinholeView:
    """The camera's view of the scene's ball."""
    return PinholeView(BallOutline(*scene.outline()), scene.size, scene.focal_px)


def highlight_in(
    photograph: LinearImage, view: BallView, dark: LinearImage | None = None, typical_area_px: float = 0.0
) -> Highlight | NoHighlight:
    """The highlight in a photograph in color, by the mean of its channels."""
    light = photograph.mean(axis=2)
    return find_highlight(light, view, None if dark is None else dark.mean(axis=2), typical_area_px)


def true_normal(scene: MirrorScene, lamp: Vector) -> Vector:
    """The ball's normal at the highlight, where the directions to camera and lamp make equal angles with it."""
    normal = unit(unit(lamp - scene.center) - unit(scene.center))
    for _ in range(50):
        point = scene.center + scene.radius_cm * normal
        normal = unit(unit(lamp - point) - unit(point))
    return normal


def hand_path(count: int, distance_cm: float, about: Vector) -> list[Vector]:
    """Positions of a lamp that moves up and down from left to right, before and beside the head."""
    fraction = (np.arange(count) + 0.5) / count
    azimuth, elevation = np.radians(-65 + 130 * fraction), np.radians(25 + 40 * np.sin(2 * np.pi * 2.5 * fraction))
    way = np.stack([np.sin(azimuth) * np.cos(elevation), np.sin(elevation), np.cos(azimuth) * np.cos(elevation)], -1)
    return list(about + distance_cm * way)
