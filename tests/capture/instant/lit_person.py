"""A person whose truth is known: the generic head with a skin of its own, in a room whose light is known."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from relit_camera.base.array_types import Float32Array, Float64Array
from relit_camera.base.images.color import LUMINANCE, uint8_from_linear
from relit_camera.base.images.image_types import Mask
from relit_camera.capture.instant.head_shape import HeadShape, fit_head_shape
from relit_camera.capture.instant.median_picture import MedianPicture
from relit_camera.capture.instant.response.generic_reflectance import GenericField, ShapeResponse, shape_response
from relit_camera.capture.instant.response.learned_response import with_learned_response
from relit_camera.light.directions import direction_from_degrees, texel_directions, texel_solid_angles
from tests.capture.instant.canonical_person import canonical_landmarks, canonical_pose, person_matte

SIDE = 128
SKIN = np.array([0.40, 0.26, 0.20])


@lru_cache(maxsize=1)
def generic_person() -> tuple[HeadShape, ShapeResponse, Mask]:
    """The head at half of the picture's resolution, how its shape alone answers light, and its matte."""
    half = SIDE // 2
    pose = canonical_pose(half, pixels_per_cm=1.5)
    matte = person_matte(half, 1.5)
    shape = fit_head_shape(canonical_landmarks(pose, half), matte)
    return shape, shape_response(shape.geometry, shape.certainty, matte), matte


@lru_cache(maxsize=1)
def person() -> tuple[HeadShape, ShapeResponse]:
    """The same head, which answers light as people do."""
    shape, response, matte = generic_person()
    return shape, with_learned_response(response, shape, matte)


def field_of(albedo: Float64Array) -> GenericField:
    """Its reflectance field; skin all over."""
    _, response = person()
    everywhere = np.broadcast_to(albedo.astype(np.float32), (SIDE, SIDE, 3))
    return GenericField(response, everywhere, np.ones((SIDE, SIDE), np.float32))


def window(azimuth_deg: float, elevation_deg: float = 20.0, width: float = 6.0, around: float = 0.1) -> Float32Array:
    """A wide light from one side, and a share of it from all around: radiance times solid angle (2048, 3)."""
    toward = direction_from_degrees([azimuth_deg], [elevation_deg])[0]
    lobe = np.exp(width * (texel_directions().reshape(-1, 3) @ toward - 1)) + around
    light = (lobe[:, None] * np.ones(3)) * texel_solid_angles().reshape(-1, 1)
    return np.asarray(light, np.float32)


def facing_irradiance(light: Float32Array) -> float:
    """What of a light (2048, 3) reaches a wall that faces the camera, in luminance."""
    cosines = np.maximum(texel_directions().reshape(-1, 3)[:, 2], 0)
    return float(cosines @ light @ LUMINANCE)


def picture_of(albedo: Float64Array, light: Float32Array, frame_luminance: float = 0.18) -> MedianPicture:
    """The person of that skin in that light, as the camera's picture."""
    seen = field_of(albedo).pictures(light[None])[0]
    landmarks = canonical_landmarks(canonical_pose(SIDE, pixels_per_cm=3.0), SIDE)
    matte = np.asarray(
        cv2.resize(person_matte(SIDE // 2, 1.5), (SIDE, SIDE), interpolation=cv2.INTER_LINEAR), np.float32
    )
    image = uint8_from_linear(np.where(matte[..., None] > 0, seen, 0.2).astype(np.float32))
    return MedianPicture(image, matte, landmarks, frame_luminance, 1)
