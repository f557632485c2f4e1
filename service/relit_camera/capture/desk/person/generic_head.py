"""The generic head: a shape of average size where the face is, which bounds what the pictures say of depth."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array
from relit_camera.base.images.image_types import Mask, Points
from relit_camera.capture.geometry.horizon_map import HorizonMap, compute_horizon_map
from relit_camera.capture.instant.head_shape import fit_head_shape

_HALF_WIDTH_CM, _HALF_HEIGHT_CM, _DEPTH_CM = 8.0, 12.0, 10.0
"""Half axes of the ellipsoid of a head."""
_ABOVE_FACE_CM = 1.5
"""The ellipsoid's middle above that of the face: the brow is the middle of a head, the nose that of a face."""
_NOSE_BRIDGE_CM = 0.5
"""The ellipsoid's foremost point before the mean of the face."""
_BODY_CM = -8.0
"""Depth of what lies beside the ellipsoid: neck, shoulders, hair."""
_FACE_RADIUS_CM = 6.0


@dataclass(frozen=True, eq=False)
class GenericHead:
    """A head of average shape in a picture.

    Attributes:
        points_cm: (height, width, 3) positions from the middle of the face, camera axes.
        normals: (height, width, 3) unit vectors.
        horizon: what the head hides of the light.
        pixels_per_cm: of the picture.
        face: (height, width) mask of the face, without hair and ears.
        skin: (height, width) mask of what is skin for certain.
        matte: (height, width) alpha of the person.
    """

    points_cm: Float32Array
    normals: Float32Array
    horizon: HorizonMap
    pixels_per_cm: float
    face: NDArray[np.bool_]
    skin: NDArray[np.bool_]
    matte: Mask


def head_from_landmarks(
    landmarks: Points, center: tuple[float, float], pixels_per_cm: float, matte: Mask
) -> GenericHead:
    """The head fitted to the landmarks of the face mesh.

    Args:
        landmarks: (478, 2) of the scheme `mesh478`, pixels of the picture.
        center: middle of the face in the picture, pixels.
        pixels_per_cm: of the picture.
        matte: (height, width) alpha of the person.

    Raises:
        CaptureError: no head fits.
    """
    shape = fit_head_shape(landmarks, matte)
    depth = np.nan_to_num(shape.geometry.depth) - np.nanmean(shape.geometry.depth[shape.face])
    points = _points_cm(center, pixels_per_cm, np.asarray(depth / pixels_per_cm, np.float32))
    geometry = shape.geometry
    return GenericHead(points, geometry.normals, geometry.horizon, pixels_per_cm, shape.face, shape.skin, matte)


def ellipsoid_head(center: tuple[float, float], pixels_per_cm: float, matte: Mask) -> GenericHead:
    """An ellipsoid before a flat body.

    Args:
        center: middle of the face in the picture, pixels.
        pixels_per_cm: of the picture.
        matte: (height, width) alpha of the person.
    """
    points = _points_cm(center, pixels_per_cm, np.zeros_like(matte))
    across, up = points[..., 0], points[..., 1]
    left = 1 - (across / _HALF_WIDTH_CM) ** 2 - ((up - _ABOVE_FACE_CM) / _HALF_HEIGHT_CM) ** 2
    toward = _NOSE_BRIDGE_CM - _DEPTH_CM + _DEPTH_CM * np.sqrt(np.maximum(left, 0))
    points[..., 2] = np.maximum(toward, _BODY_CM)
    face = np.hypot(across, up) < _FACE_RADIUS_CM
    depth = points[..., 2] * pixels_per_cm
    horizon = compute_horizon_map(np.where(matte > 0.5, depth, np.nan).astype(np.float32))
    return GenericHead(points, _normals(depth), horizon, pixels_per_cm, face, face & (matte > 0.5), matte)


def _points_cm(center: tuple[float, float], pixels_per_cm: float, depth_cm: Float32Array) -> Float32Array:
    height, width = depth_cm.shape
    across = (np.arange(width) + 0.5 - center[0]) / pixels_per_cm + np.zeros((height, 1))
    up = (center[1] - np.arange(height)[:, None] - 0.5) / pixels_per_cm + np.zeros((1, width))
    return np.stack([across, up, depth_cm], axis=-1).astype(np.float32)


def _normals(depth_px: Float32Array) -> Float32Array:
    """Unit normals (height, width, 3) of a depth map in pixels."""
    down, right = np.gradient(cv2.GaussianBlur(depth_px, (0, 0), 1.0))
    normals = np.stack([-right, down, np.ones_like(right)], axis=-1)
    return np.asarray(normals / np.linalg.norm(normals, axis=-1, keepdims=True), np.float32)
