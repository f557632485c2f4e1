"""The near field undone: pictures under patches half a metre away become pictures under distant lights.

The correction needs the head's shape, and the shape needs corrected pictures. Two rounds with the points of a generic
head and the normals of the pictures, then two with integrated depth that stays near the generic one: unbounded, an
error of depth feeds itself and the head collapses.

The correction is smooth, so it is found at half the pictures' resolution.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from relit_camera.base.array_types import Float32Array
from relit_camera.base.images.image_types import Mask
from relit_camera.capture.desk.person.generic_head import GenericHead
from relit_camera.capture.desk.person.patch_light import Patches
from relit_camera.capture.geometry.normal_completion import complete_normals
from relit_camera.capture.geometry.normal_integration import integrate_normals
from relit_camera.capture.geometry.photometric_stereo import photometric_stereo

ROUNDS_ON_GENERIC_HEAD, ROUNDS_ON_OWN_DEPTH = 2, 2
MAX_DEPARTURE_CM = 4.0
"""Of the integrated depth from the generic head's."""


def undo_near_field(pictures: Float32Array, patches: Patches, head: GenericHead, matte: Mask) -> Float32Array:
    """Pictures (patches, height, width, 3) under distant lights of unit irradiance in the patches' directions.

    Args:
        pictures: (patches, height, width, 3) linear, each under one patch alone.
        patches: before the face.
        head: in the same picture.
        matte: (height, width) alpha of the person.
    """
    unit = pictures / patches.strengths()[:, None, None, None]
    size = (matte.shape[1] // 2, matte.shape[0] // 2)
    small = np.stack([cv2.resize(each, size, interpolation=cv2.INTER_AREA) for each in unit])
    half_matte, points, face = (
        cv2.resize(each, size, interpolation=cv2.INTER_AREA)
        for each in (matte, head.points_cm, head.face.astype(np.float32))
    )
    half_head = replace(
        head, points_cm=points, pixels_per_cm=head.pixels_per_cm * size[0] / matte.shape[1], face=face > 0.5
    )
    factors = _factors(small, patches, half_head, np.asarray(half_matte, np.float32))
    larger = (cv2.resize(each, matte.shape[::-1], interpolation=cv2.INTER_LINEAR) for each in factors)
    return np.asarray(unit * np.stack(list(larger))[..., None], np.float32)


def _factors(unit: Float32Array, patches: Patches, head: GenericHead, matte: Mask) -> Float32Array:
    """Factors (patches, height, width) by which pictures (patches, height, width, 3) of unit patches are corrected."""
    factors = np.ones(unit.shape[:3], np.float32)
    for round_index in range(ROUNDS_ON_GENERIC_HEAD + ROUNDS_ON_OWN_DEPTH):
        shape = photometric_stereo(unit * factors[..., None], patches.directions, matte)
        normals = complete_normals(shape.normals, shape.confidence, matte)
        points = head.points_cm
        if round_index >= ROUNDS_ON_GENERIC_HEAD:
            points = bounded_points(integrate_normals(normals, matte > 0.5, shape.confidence), head)
        factors = np.stack([patches.distant_light_factor(points, normals, patch) for patch in range(len(unit))])
    return factors


def bounded_points(depth_px: Float32Array, head: GenericHead) -> Float32Array:
    """Points (height, width, 3) in centimeters of a depth map (height, width), within reach of the generic head's.

    The mean depth of the face is the generic head's. Where depth is NaN, so is that of the generic head used.
    """
    generic = head.points_cm[..., 2]
    known = np.isfinite(depth_px)
    depth = np.where(known, depth_px / head.pixels_per_cm, 0)
    middle = head.face & known
    if not middle.any():
        return head.points_cm
    depth = depth - depth[middle].mean() + generic[middle].mean()
    bounded = np.clip(depth, generic - MAX_DEPARTURE_CM, generic + MAX_DEPARTURE_CM)
    points = head.points_cm.copy()
    points[..., 2] = np.where(known, bounded, generic)
    return points
