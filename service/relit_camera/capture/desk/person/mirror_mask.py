"""Eyes and glasses mirror the screen: a bright spot that no skin has, at another place under each patch."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array, Float64Array
from relit_camera.base.images.color import luminance
from relit_camera.base.images.image_types import Mask
from relit_camera.capture.geometry.photometric_stereo import photometric_stereo

MIRRORED = 1.8
"""Times what the robust fit of Lambert's law predicts, above which light is mirrored; skin's highlights stay below."""
MIRRORED_LEVEL = 0.12
"""Of the bright values of all pictures, by which it must exceed the prediction too."""
MAX_FRACTION = 0.15
"""Of the person, above which it is no eye and no glasses, and nothing is masked."""


def suppress_mirrored_patches(
    pictures: Float32Array, directions: Float64Array, matte: Mask
) -> tuple[Float32Array, NDArray[np.bool_]]:
    """The pictures without mirrored patches, and the mask (height, width) of where there were any.

    Args:
        pictures: (patches, height, width, 3) linear, under distant lights of unit irradiance.
        directions: (patches, 3) unit vectors toward them.
        matte: (height, width) alpha of the person.
    """
    shape = photometric_stereo(pictures, directions, matte)
    inside = matte > 0.5
    bright = float(np.percentile(luminance(pictures[:, inside][:, ::8]), 99))
    cosines = np.maximum(shape.normals @ directions.T.astype(np.float32), 0)
    level = luminance(shape.albedo)
    mirrored = np.zeros(matte.shape, np.uint8)
    for patch, picture in enumerate(pictures):
        predicted = level * cosines[..., patch]
        value = luminance(picture)
        mirrored |= ((value > MIRRORED * predicted) & (value > predicted + MIRRORED_LEVEL * bright)).astype(np.uint8)
    mask = (cv2.dilate(mirrored, np.ones((3, 3), np.uint8)) > 0) & (matte > 0)
    if mask[inside].mean() > MAX_FRACTION:
        return pictures, np.zeros(matte.shape, np.bool_)
    calm = pictures.copy()
    for patch, picture in enumerate(calm):
        most = MIRRORED * shape.albedo[mask] * cosines[mask][:, patch, None]
        picture[mask] = np.minimum(picture[mask], most)
    return calm, mask
