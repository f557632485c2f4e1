"""Light from the virtual background: an environment guessed from the picture behind the person.

This is a heuristic: the picture shows the light behind the person, never what lights the face from the front. The
picture is placed where it is seen, its edges are extended around the sphere, more blurred with distance, and the unseen
half of the scene is assumed to mirror the seen half, strongly blurred. So a bright window at the viewer's left lights
the left rim sharply and the left of the face softly (compare Fig. 1.1 of the thesis).
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.easing import smoothstep
from relit_camera.base.images.image_types import LinearImage
from relit_camera.base.images.resize import shrink
from relit_camera.light.directions import texel_directions
from relit_camera.light.environments.environment_panorama import Panorama
from relit_camera.light.environments.panorama_axes import between_map_and_viewer_axes

BACKGROUND_HEIGHT_DEG = 35.0
"""Vertical angle, in degrees, that the background picture covers."""

_HEIGHT, _WIDTH = 256, 512
_WORKING_ROWS = 96
"""Rows to which the picture is shrunk: about twice those it covers on the sphere."""
_MAX_BLUR_SIGMA = 0.35
"""Sigma, in picture heights, of the softest copy; it is reached `_MAX_BLUR_AT_DEG` degrees outside the picture."""
_MAX_BLUR_AT_DEG = 70.0
_BLUR_LEVELS = 6
_HIGHLIGHT_BOOST = 7.0
"""A clipped highlight is assumed to be up to 1 + 7 times as bright as white (three stops)."""
_MAX_CLIPPED_FRACTION = 0.25
"""Where more than this share of the picture is clipped, it is a white wall or an overexposed sky: no boost."""
_MAX_SEAM_RATIO = 4.0
"""A 2:1 picture counts as a panorama where its sides differ at most so much more than neighbouring columns do."""


def panorama_from_background(picture: LinearImage, height_deg: float = BACKGROUND_HEIGHT_DEG) -> Panorama:
    """The panorama that lights a person in front of `picture`, linear RGB (H, W, 3) as the viewer sees it.

    The picture appears along −Z, `height_deg` high, its left at the viewer's left. A 2:1 panorama (its sides meet, its
    top and bottom rows are each one colour) is used exactly, turned so that its middle, too, lies along −Z.
    """
    if _is_panorama(picture):
        # It is shown as it is: what stands at its left is seen at the left, and must light from there. A file of an
        # environment has its middle before the person instead.
        radiance = between_map_and_viewer_axes(picture)
        return Panorama(radiance, notes=("The background is a panorama: its light is exact.",))
    bright = _with_highlights(shrink(picture, _WORKING_ROWS / picture.shape[0]))
    radiance = _extrapolate_to_sphere(bright, height_deg)
    return Panorama(radiance, notes=("Guessed from an ordinary picture: the light in front of it is not known.",))


def _is_panorama(picture: LinearImage) -> bool:
    height, width = picture.shape[:2]
    if width != 2 * height or height < 16:
        return False
    encoded = np.sqrt(np.clip(picture, 0, 1))
    neighbours = np.abs(np.diff(encoded, axis=1)).mean()
    seam = np.abs(encoded[:, 0] - encoded[:, -1]).mean()
    poles = encoded[[0, -1]].std(axis=1).mean()
    return bool(seam <= _MAX_SEAM_RATIO * neighbours + 0.01 and poles <= 0.05)


def _with_highlights(picture: LinearImage) -> LinearImage:
    """The picture with what is clipped at white raised toward what a lamp or window may have been."""
    level = np.clip((picture.max(axis=2) - 0.85) / 0.15, 0, 1)
    lamp = max(0.0, 1 - float(level.mean()) / _MAX_CLIPPED_FRACTION)
    return np.asarray(picture * (1 + _HIGHLIGHT_BOOST * lamp * level**2)[..., None], np.float32)


def _extrapolate_to_sphere(picture: LinearImage, height_deg: float) -> NDArray[np.float32]:
    """Radiance (256, 512, 3) in map axes."""
    rows, columns = picture.shape[:2]
    x, y, z = np.moveaxis(texel_directions(_HEIGHT, _WIDTH), -1, 0)
    half_height = np.tan(np.radians(height_deg) / 2)
    half_width = half_height * columns / rows
    # Seen from the front a direction lies at its mirror image in the unseen half. The floor under the depth keeps both
    # coordinates smooth at the sides and poles, where only the picture's edges are seen.
    depth = np.maximum(np.abs(z), 0.3)
    unseen = smoothstep((z + 0.6) / 1.2)
    across = (1 - unseen) * np.clip(x / (depth * half_width), -1, 1) + unseen * x
    up = (1 - unseen) * np.clip(y / (depth * half_height), -1, 1) + unseen * y
    softness = _angle_outside_picture(x, y, z, half_width, half_height) / _MAX_BLUR_AT_DEG
    map_x = ((across + 1) / 2 * columns - 0.5).astype(np.float32)
    map_y = ((1 - up) / 2 * rows - 0.5).astype(np.float32)
    return _sample_blurred(picture, map_x, map_y, np.clip(softness, 0, 1))


def _angle_outside_picture(
    x: NDArray, y: NDArray, z: NDArray, half_width: float, half_height: float
) -> NDArray[np.float64]:
    """Angle in degrees from each direction to the nearest one inside the picture."""
    depth = np.maximum(-z, 1e-3)
    nearest = np.stack([
        np.clip(x / depth, -half_width, half_width), np.clip(y / depth, -half_height, half_height), -np.ones_like(z),
    ])  # fmt: skip
    cosine = (nearest * np.stack([x, y, z])).sum(axis=0) / np.linalg.norm(nearest, axis=0)
    angle: NDArray[np.float64] = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    return angle


def _sample_blurred(picture: LinearImage, map_x: NDArray, map_y: NDArray, softness: NDArray) -> NDArray[np.float32]:
    """The picture at these pixels, from the copy as soft as asked for: 0 is the picture itself, 1 the softest copy."""
    level = softness * (_BLUR_LEVELS - 1)
    sampled = np.zeros((*softness.shape, 3), np.float32)
    for copy in range(_BLUR_LEVELS):
        weight = np.maximum(0, 1 - np.abs(level - copy)).astype(np.float32)
        sigma = _MAX_BLUR_SIGMA * picture.shape[0] * copy / (_BLUR_LEVELS - 1)
        soft = picture if copy == 0 else cv2.GaussianBlur(picture, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE)
        sampled += weight[..., None] * cv2.remap(soft, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return sampled
