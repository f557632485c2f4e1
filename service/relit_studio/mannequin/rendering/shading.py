"""Distant lights on surfaces: Lambert, a little gloss, shadows."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from relit_studio.mannequin.rendering.rasterizer import nearness_buffer
from relit_studio.mannequin.shape.mesh import Triangles

Values = NDArray[np.float32]

FRESNEL = 0.35
"""Fraction of Schlick's rise toward grazing light that remains on rough cloth, skin and hair."""

LIFT = 1.6
"""Texels by which points are lifted off their surface before the test: the four texels about a point lie up to √2 of
them aside, where a slanted surface is nearer to the light."""


@dataclass(frozen=True, eq=False)
class Surface:
    """Points to be lit.

    Attributes:
        positions, normals, views: (count, 3) float32; unit normals, unit vectors to the camera.
        shine, exponent: (count,) float32 of the Blinn-Phong gloss.
    """

    positions: Values
    normals: Values
    views: Values
    shine: Values
    exponent: Values


class ShadowMap:
    """Shadow map of a distant light: depth along its direction (Williams 1978)."""

    def __init__(self, vertices: Values, triangles: Triangles, direction: ArrayLike, size: int) -> None:
        """See `vertices` (count, 3) from `direction` (3,), a unit vector toward the light, at size x size texels."""
        self._axes = axes_along(direction)
        # One row a coordinate: numpy reduces along contiguous memory many times faster.
        seen = self._axes @ vertices.T
        low, high = seen[:2].min(axis=1), seen[:2].max(axis=1)
        self._texel = float((high - low).max()) / (size - 2)
        self._origin = np.append(low - self._texel, 0).astype(np.float32)[:, None]
        self._scale = np.array([1 / self._texel, 1 / self._texel, 1], np.float32)[:, None]
        self._depth = nearness_buffer(((seen - self._origin) * self._scale).T, triangles, size, size)

    def lit(self, positions: Values, normals: Values) -> Values:
        """Share 0..1 (count,) of the light that reaches points with unit normals (count, 3)."""
        lifted = self._axes @ (positions + normals * np.float32(LIFT * self._texel)).T
        x, y, depth = (lifted - self._origin) * self._scale
        return lit_fraction(self._depth, x, y, depth)


def axes_along(direction: ArrayLike) -> Values:
    """Right, down and toward the light, rows of (3, 3), of a picture taken from `direction` (3,), a unit vector."""
    toward = np.asarray(direction, np.float64)
    aside = np.cross([0.0, 1.0, 0.0] if abs(toward[1]) < 0.9 else [1.0, 0.0, 0.0], toward)
    aside /= np.linalg.norm(aside)
    return np.stack([aside, -np.cross(toward, aside), toward]).astype(np.float32)


def lit_fraction(buffer: Values, x: Values, y: Values, nearness: Values) -> Values:
    """Share 0..1 (count,) of the four texels about each point that hold nothing nearer, weighed by how near they are.

    Args:
        buffer: what the light sees, as `nearness_buffer` gives it, square.
        x: of the points (count,) in texels, centers at integers + ½.
        y: likewise, down.
        nearness: of the points (count,), in the buffer's measure.
    """
    x, y = x - np.float32(0.5), y - np.float32(0.5)
    left, top = np.floor(x).astype(np.int32), np.floor(y).astype(np.int32)
    right_fraction, down_fraction = x - left, y - top
    limit = np.int32(buffer.shape[0] - 2)
    at = np.clip(top, 0, limit) * (limit + 2) + np.clip(left, 0, limit)
    flat = buffer.ravel()
    free = [(flat[at + step] <= nearness).astype(np.float32) for step in (0, 1, limit + 2, limit + 3)]
    upper = free[0] + (free[1] - free[0]) * right_fraction
    lower = free[2] + (free[3] - free[2]) * right_fraction
    return np.asarray(upper + (lower - upper) * down_fraction)


def reflected(surface: Surface, direction: ArrayLike) -> tuple[Values, Values]:
    """Light reflected from unit irradiance, without shadows: Lambert's cosine (count,) and gloss (count,).

    `direction` is toward it: one (3,) of a distant light, or one a point (count, 3).

    A white Lambert surface that faces the light reads 1, so the gloss is the normalized Blinn-Phong reflectance
    (n + 8) / 8 · (n·h)^n times the cosine, with Schlick's rise at grazing angles.
    """
    toward = np.asarray(direction, np.float32)
    cosine = np.maximum(_dot(surface.normals, toward), 0)
    half = surface.views + toward
    half /= np.maximum(np.sqrt(np.einsum("ij,ij->i", half, half)), 1e-6)[:, None]
    aligned = np.maximum(np.einsum("ij,ij->i", surface.normals, half), 1e-6)
    grazing = 1 - np.minimum(_dot(half, toward), 1)
    grazing2 = grazing * grazing
    shine = surface.shine + (FRESNEL * (1 - surface.shine)) * grazing2 * grazing2 * grazing
    lobe = cv2.exp(surface.exponent * np.log(aligned)).ravel()
    return cosine, shine * ((surface.exponent + 8) / 8) * lobe * cosine


def _dot(vectors: Values, direction: Values) -> Values:
    return np.asarray(vectors @ direction if direction.ndim == 1 else np.einsum("ij,ij->i", vectors, direction))
