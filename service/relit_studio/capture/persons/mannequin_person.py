"""The mannequin in front of the phone, rendered for every frame under room light and a torch nearby."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from relit_camera.base.images.image_types import LinearImage
from relit_camera.light.light_map import LightMap
from relit_studio.cameras.pinhole import Pinhole
from relit_studio.capture.flash.point_shadow import PointShadow
from relit_studio.capture.flash.torch import Torch
from relit_studio.capture.persons.captured_person import FACE_REACH_CM, Layers
from relit_studio.capture.persons.head_motion import REST, Motion
from relit_studio.mannequin.rendering.distant_lights import lights_from_map
from relit_studio.mannequin.rendering.rasterizer import Hits, rasterize
from relit_studio.mannequin.rendering.shading import ShadowMap, Surface, Values, reflected
from relit_studio.mannequin.shape.figure import Posture, mannequin

_SEAT_CM = (0.0, -2.0, -62.0)
"""The head's origin at rest."""
_HEIGHT_CM = 56.0
"""Height of the view at the head's origin: the bust, cut below the shoulders, fills it to the bottom."""

_SUPERSAMPLING = 2
_AMBIENT_LIGHTS = 16
"""Number of distant lights that approximate the room."""
_AMBIENT_SHADOW = 112
_SHADOW_PER_ROW = 1.6
"""Texels of the torch's shadow map per row of the picture."""


def phone_camera(width: int, height: int) -> Pinhole:
    """The phone's camera for the mannequin: a head and shoulders at arm's length."""
    return Pinhole(width, height, height * -_SEAT_CM[2] / _HEIGHT_CM)


class MannequinPerson:
    """The mannequin as captured person: its head rotates on the neck, the shoulders move along (see `Person`)."""

    name = "mannequin"
    credits: tuple[str, ...] = ()

    def __init__(self, camera: Pinhole, room: LightMap, origin: ArrayLike = _SEAT_CM) -> None:
        """Seat it before `camera` in a room of this light, its head's origin at `origin` (3,), camera axes."""
        self.camera, self._origin = camera, np.asarray(origin, np.float64)
        self._fine = camera.scaled(_SUPERSAMPLING)
        self._room = lights_from_map(room, _AMBIENT_LIGHTS)
        self._figure = mannequin()
        vertices, _ = self._seen(REST)
        normals = self._figure.normals(vertices)
        # Room shadows are soft and the head moves by a degree or two, so they are computed once, at rest.
        self._room_lit = [
            ShadowMap(vertices, self._figure.casters, direction, _AMBIENT_SHADOW).lit(vertices, normals)
            for direction in self._room.directions
        ]

    @property
    def origin(self) -> NDArray[np.float64]:
        """See `Person.origin`."""
        return self._origin

    def layers(self, motion: Motion, torch: Torch | None) -> Layers:
        """See `Person.layers`."""
        figure = self._figure
        vertices, hits = self._seen(motion)
        normals = figure.normals(vertices)
        material = hits.interpolate(np.concatenate([figure.color, figure.paint], axis=1))
        albedo = figure.albedo(material[:, :3], material[:, 3:])
        black = np.zeros((self.camera.height, self.camera.width, 3), np.float32)
        return Layers(
            matte=self._picture(hits, np.ones((len(hits.pixels), 1), np.float32)),
            ambient=self._picture(hits, self._ambient(vertices, normals, hits, albedo)),
            flash=black if torch is None else self._picture(hits, self._flash(vertices, normals, hits, albedo, torch)),
        )

    def face_points(self) -> NDArray[np.float64]:
        """See `Person.face_points`."""
        vertices, hits = self._seen(REST)
        points = hits.interpolate(vertices).astype(np.float64)
        return np.asarray(points[np.linalg.norm(points - self.origin, axis=1) < FACE_REACH_CM])

    def _seen(self, motion: Motion) -> tuple[Values, Hits]:
        """Vertices (count, 3) in camera axes, and what each sample of the picture sees of them."""
        place = (self.origin + motion.translation_cm).astype(np.float32)
        vertices = self._figure.vertices(Posture(motion.angles)) + place
        projected = self._fine.project(vertices).astype(np.float32)
        return vertices, rasterize(projected, self._figure.triangles, self._fine.width, self._fine.height)

    def _flash(self, vertices: Values, normals: Values, hits: Hits, albedo: Values, torch: Torch) -> Values:
        """Light (samples, 3) sent to the camera under the torch: Lambert and gloss, inverse square, cast shadows."""
        finish = hits.interpolate(np.stack([self._figure.shine, self._figure.exponent], axis=1))
        positions, normal = hits.interpolate(vertices), _unit(hits.interpolate(normals))
        surface = Surface(positions, normal, _unit(-positions), finish[:, 0], finish[:, 1])
        cosine, gloss = reflected(surface, _unit(torch.position.astype(np.float32) - positions))
        texels = int(_SHADOW_PER_ROW * self.camera.height) + 64
        shadow = PointShadow(vertices, self._figure.triangles, torch.position, texels)
        received = shadow.lit(positions, normal) * torch.irradiance(positions)
        return np.asarray(albedo * (cosine * received)[:, None] + (gloss * received)[:, None], np.float32)

    def _ambient(self, vertices: Values, normals: Values, hits: Hits, albedo: Values) -> Values:
        """Light (samples, 3) under the room's lights, found at the vertices: it is soft."""
        figure = self._figure
        used = np.unique(hits.corners)
        seen = Surface(vertices[used], normals[used], _unit(-vertices[used]), figure.shine[used], figure.exponent[used])
        shades = np.empty((2, len(self._room_lit), len(used)), np.float32)
        for index, (direction, lit) in enumerate(zip(self._room.directions, self._room_lit, strict=True)):
            shades[:, index] = reflected(seen, direction)
            shades[:, index] *= lit[used]
        diffuse, gloss = shades.transpose(0, 2, 1) @ self._room.irradiance.astype(np.float32)
        everywhere = np.zeros((len(vertices), 6), np.float32)
        everywhere[used] = np.concatenate([diffuse, gloss], axis=1)
        at_samples = hits.interpolate(everywhere)
        return np.asarray(albedo * at_samples[:, :3] + at_samples[:, 3:])

    def _picture(self, hits: Hits, values: Values) -> LinearImage:
        """Values (samples, k) at the hits averaged to pixels (height, width, k), or (height, width) of one channel."""
        samples = np.zeros((self._fine.height * self._fine.width, values.shape[1]), np.float32)
        samples[hits.pixels] = values
        fine = samples.reshape(self._fine.height, self._fine.width, -1)
        size = (self.camera.width, self.camera.height)
        return np.asarray(cv2.resize(fine, size, interpolation=cv2.INTER_AREA), np.float32)


def _unit(vectors: Values) -> Values:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-6))
