"""Pictures of the mannequin: visibility is computed once a posture, then lit by any lights."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from relit_camera.base.images.image_types import LinearImage, Mask
from relit_studio.mannequin.rendering.distant_lights import DistantLights
from relit_studio.mannequin.rendering.mannequin_camera import Camera
from relit_studio.mannequin.rendering.rasterizer import rasterize
from relit_studio.mannequin.rendering.shading import ShadowMap, Surface, Values, reflected
from relit_studio.mannequin.shape.figure import Figure, Posture, mannequin

SUPERSAMPLING = 2
"""Samples a pixel along each side."""
_FINE_SHADOW, _SOFT_SHADOW = 640, 112
"""Texels along a shadow map's side: for a single lamp, and for one of the many lamps of a soft light."""


class View:
    """View of the mannequin in one posture from one camera. Pictures are linear, premultiplied over black."""

    def __init__(self, posture: Posture, camera: Camera) -> None:
        """Pose the figure and find the visible surface of each sample."""
        self.posture, self.camera = posture, camera
        self._figure: Figure = mannequin()
        self._vertices = self._figure.vertices(posture)
        self._normals = self._figure.normals(self._vertices)
        self._samples = camera.size * SUPERSAMPLING
        projected = Camera(self._samples).project(self._vertices).astype(np.float32)
        self._hits = rasterize(projected, self._figure.triangles, self._samples, self._samples)
        material = self._hits.interpolate(np.concatenate([self._figure.color, self._figure.paint], axis=1))
        self._albedo = self._figure.albedo(material[:, :3], material[:, 3:])
        self._surface: Surface | None = None

    def matte(self) -> Mask:
        """Straight alpha (size, size) float32."""
        matte: Mask = self._picture(np.ones((len(self._hits.pixels), 1), np.float32))
        return matte

    def under_light(self, direction: ArrayLike) -> LinearImage:
        """The picture under a distant light of unit irradiance from `direction` (3,), with sharp shadows."""
        surface = self._seen_surface()
        shadow = ShadowMap(self._vertices, self._figure.triangles, direction, _FINE_SHADOW)
        cosine, gloss = reflected(surface, direction)
        lit = shadow.lit(surface.positions, surface.normals)
        return self._picture(self._albedo * (cosine * lit)[:, None] + (gloss * lit)[:, None])

    def under_lights(self, lights: DistantLights) -> LinearImage:
        """The picture under the many lights of a soft light: lit at the vertices, with coarser shadows."""
        used = np.unique(self._hits.corners)
        seen = Surface(
            positions=self._vertices[used],
            normals=self._normals[used],
            views=self.camera.towards(self._vertices[used]),
            shine=self._figure.shine[used],
            exponent=self._figure.exponent[used],
        )
        received = np.zeros((len(used), 6), np.float32)
        for direction, irradiance in zip(lights.directions, lights.irradiance.astype(np.float32), strict=True):
            shadow = ShadowMap(self._vertices, self._figure.casters, direction, _SOFT_SHADOW)
            lit = shadow.lit(seen.positions, seen.normals)
            for part, reflectance in zip((received[:, :3], received[:, 3:]), reflected(seen, direction), strict=True):
                part += (reflectance * lit)[:, None] * irradiance
        everywhere = np.zeros((len(self._vertices), 6), np.float32)
        everywhere[used] = received
        at_samples = self._hits.interpolate(everywhere)
        return self._picture(self._albedo * at_samples[:, :3] + at_samples[:, 3:])

    def normals(self) -> NDArray[np.float32]:
        """Unit normals (size, size, 3), room axes; zero where there is nothing."""
        summed = self._picture(self._seen_surface().normals)
        return np.asarray(summed / np.maximum(np.linalg.norm(summed, axis=2, keepdims=True), 1e-6))

    def albedo(self) -> LinearImage:
        """Linear albedo (size, size, 3)."""
        return self._picture(self._albedo)

    def depth(self) -> NDArray[np.float32]:
        """Centimeters toward the camera (size, size) from the canonical face's origin; zero where there is nothing."""
        depth = self._picture(self._seen_surface().positions[:, 2:])
        return np.asarray(depth / np.maximum(self.matte(), 1e-6))

    def _seen_surface(self) -> Surface:
        if self._surface is None:
            hits, figure = self._hits, self._figure
            positions = hits.interpolate(self._vertices)
            normals = hits.interpolate(self._normals)
            normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-6)
            finish = hits.interpolate(np.stack([figure.shine, figure.exponent], axis=1))
            self._surface = Surface(positions, normals, self.camera.towards(positions), finish[:, 0], finish[:, 1])
        return self._surface

    def _picture(self, values: Values) -> NDArray[np.float32]:
        """Values (samples, k) at the hits, averaged to pixels (size, size, k), or (size, size) for one channel."""
        samples = np.zeros((self._samples**2, values.shape[1]), np.float32)
        samples[self._hits.pixels] = values
        fine = samples.reshape(self._samples, self._samples, -1)
        side = (self.camera.size, self.camera.size)
        return np.asarray(cv2.resize(fine, side, interpolation=cv2.INTER_AREA), np.float32)
