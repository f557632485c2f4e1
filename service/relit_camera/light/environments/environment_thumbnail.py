"""Thumbnails of environments: small tone-mapped pictures to choose from."""

from __future__ import annotations

import cv2
import numpy as np

from relit_camera.base.images.color import luminance, uint8_from_linear
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.light.directions import texel_solid_angles
from relit_camera.light.environments.environment_panorama import Panorama
from relit_camera.light.environments.panorama_axes import between_map_and_picture_axes

THUMBNAIL_SIZE = (256, 128)
"""Width and height in pixels."""
_HIGHLIGHT_QUANTILE, _HIGHLIGHT_VALUE = 0.85, 0.72
"""The quantile of luminance by solid angle that would be shown at this linear value, near white."""
_MID_GRAY = 0.16
"""Linear value at which the median would be shown; the exposure lies half way between both."""


def thumbnail_image(panorama: Panorama) -> DisplayImage:
    """The panorama as seen from inside, uint8 sRGB (128, 256, 3), exposed and tone-mapped for its light.

    Half way, in stops, between showing the median at mid grey and the 85th percentile (by solid angle) near white; then
    Reinhard's curve (2002) of the luminance, with the brightest 0.5 % as white, so that lamps keep a shape and hue.
    """
    width, height = THUMBNAIL_SIZE
    small = cv2.resize(between_map_and_picture_axes(panorama.radiance), (width, height), interpolation=cv2.INTER_AREA)
    light = luminance(small)
    middle, bright, white = _quantiles(light, (0.5, _HIGHLIGHT_QUANTILE, 0.995))
    tiny = 1e-6 * max(float(light.max()), 1e-30)
    scale = np.sqrt((_MID_GRAY / max(middle, tiny)) * (_HIGHLIGHT_VALUE / max(bright, tiny)))
    exposed = light * np.float32(scale)
    curve = (1 + exposed / max(float(white * scale), 1.5) ** 2) / (1 + exposed)
    return uint8_from_linear(small * np.float32(scale) * curve[..., None])


def _quantiles(light: np.ndarray, shares: tuple[float, ...]) -> list[float]:
    order = np.argsort(light, axis=None)
    covered = np.cumsum(texel_solid_angles(*light.shape).ravel()[order])
    found = np.searchsorted(covered, np.array(shares) * covered[-1])
    return [float(value) for value in light.ravel()[order][np.minimum(found, light.size - 1)]]
