"""Where a face is bare skin: a beard is darker than the skin around it, not in a darker light."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array, Float64Array
from relit_camera.base.images.color import LUMINANCE, luminance
from relit_camera.base.images.image_types import Points
from relit_camera.capture.instant.response.generic_reflectance import ShapeResponse
from relit_camera.capture.instant.room_light import fit_room_light

FOREHEAD, UNDER_NOSE, CHIN = 10, 2, 152
"""Landmarks of the scheme `mesh478` along the middle of the face."""


@dataclass(frozen=True)
class BeardTunables:
    """What is taken for a beard.

    Attributes:
        darker: brightness relative to bare skin in the same light, below which skin is covered.
        blur: standard deviation of the blur of that ratio, in sides of the picture.
        least: share of the skin below the nose that must be covered; less is the shadow of lip, nose or chin.
    """

    darker: float = 0.6
    blur: float = 0.008
    least: float = 0.3


TUNABLES = BeardTunables()


def below_nose(landmarks: Points, size: tuple[int, int]) -> NDArray[np.bool_]:
    """Mask (height, width) of what lies below the nose, along the face's own axis, of `mesh478` landmarks."""
    axis = landmarks[CHIN] - landmarks[FOREHEAD]
    x, y = np.arange(size[1]) + 0.5, np.arange(size[0])[:, None] + 0.5
    return np.asarray((x - landmarks[UNDER_NOSE, 0]) * axis[0] + (y - landmarks[UNDER_NOSE, 1]) * axis[1] > 0)


def find_bare_skin(
    response: ShapeResponse,
    picture: Float32Array,
    skin: NDArray[np.bool_],
    below: NDArray[np.bool_],
    albedo: Float64Array,
) -> NDArray[np.bool_]:
    """The skin (height, width) without a beard.

    The light is told by the upper face alone; the lower one is compared with what bare skin would be in it.

    Args:
        response: of the shape.
        picture: (height, width, 3) linear, of the response's size.
        skin: (height, width) the face without eyes, brows and lips.
        below: (height, width) what lies below the nose.
        albedo: (3,) of bare skin.
    """
    upper, lower = skin & ~below, skin & below
    if not upper.any() or not lower.any():
        return skin
    luma = np.asarray(LUMINANCE, np.float32)
    gray = fit_room_light(response, picture, upper, albedo) @ luma
    expected = np.zeros(skin.size, np.float32)
    expected[response.pixels] = float(albedo @ luma) * (response.diffuse @ gray) + response.glossy @ gray
    weight = lower.astype(np.float32)
    seen, bare = (
        cv2.GaussianBlur(np.asarray(each * weight, np.float32), (0, 0), TUNABLES.blur * max(skin.shape))
        for each in (luminance(picture), expected.reshape(skin.shape))
    )
    covered = lower & (seen < TUNABLES.darker * bare)
    if covered.sum() < TUNABLES.least * lower.sum():
        return skin
    return np.asarray(skin & ~(cv2.dilate(covered.astype(np.uint8), np.ones((3, 3))) > 0))
