"""Shadows of the room's light that a generic head does not have.

Where a person is darker than the generic head in the room's light, either the skin is darker or the light is blocked:
a nose is longer, hair hangs over the forehead, a cheek turns away sooner. Left in the skin's color, the dark half of a
face by a side window would stay dark in every other light. So where the model expects little light, what is missing in
low frequencies is taken from the rows of the shape, in the directions that the room's light comes from; light from
elsewhere then reaches the place as it does the rest of the face.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array, Float64Array
from relit_camera.base.images.color import LUMINANCE, luminance
from relit_camera.capture.instant.response.generic_reflectance import ShapeResponse
from relit_camera.light.directions import texel_solid_angles


@dataclass(frozen=True)
class ShadowTunables:
    """What is taken for a shadow; chosen by looking at faces by a side window.

    Attributes:
        lit, unlit: expected light, in units of the skin's typical, from which what is missing is all the skin's, and
            down to which it is all a shadow.
        blur: standard deviation of what counts as a low frequency, in sides of the picture.
        range: limits of the factor by which light is missing, or more than expected.
    """

    lit: float = 0.7
    unlit: float = 0.3
    blur: float = 0.02
    range: tuple[float, float] = (0.1, 2.0)


TUNABLES = ShadowTunables()


def with_room_shadows(
    response: ShapeResponse,
    picture: Float32Array,
    skin: NDArray[np.bool_],
    certainty: Float32Array,
    room: Float32Array,
    albedo: Float64Array,
) -> ShapeResponse:
    """The response, less or more light reaching its pixels from where the room's light comes.

    Args:
        response: of the generic shape.
        picture: (height, width, 3) linear, of the response's size.
        skin: (height, width) where the picture is compared.
        certainty: (height, width) of the shape: nothing is changed where it is 0.
        room: light (2048, 3), radiance times solid angle, that was fitted with this response.
        albedo: (3,) of the skin.
    """
    size, pixels = response.size, response.pixels
    gray = room @ np.asarray(LUMINANCE, np.float32)
    toward = gray / texel_solid_angles().ravel().astype(np.float32)
    toward /= max(float(toward.max()), 1e-9)
    received = response.diffuse @ gray
    explained = float(albedo @ np.asarray(LUMINANCE)) * received + response.glossy @ gray
    expected = np.zeros(size[0] * size[1], np.float32)
    expected[pixels] = explained
    sigma = TUNABLES.blur * max(size)
    weight = skin.astype(np.float32)
    known = cv2.GaussianBlur(weight, (0, 0), sigma)
    seen, model = (
        cv2.GaussianBlur(np.asarray(each * weight, np.float32), (0, 0), sigma) / np.maximum(known, 1e-6)
        for each in (luminance(picture), expected.reshape(size))
    )
    factor = np.clip(seen / np.maximum(model, 1e-6), *TUNABLES.range)
    level = model / max(float(np.median(expected.reshape(size)[skin])), 1e-9)
    share = np.clip((TUNABLES.lit - level) / (TUNABLES.lit - TUNABLES.unlit), 0, 1) * np.clip(known / 0.5, 0, 1)
    share = cv2.GaussianBlur(np.asarray(share * certainty, np.float32), (0, 0), sigma)
    missing = (share * (factor - 1)).ravel()[pixels]
    # All of it in the light's own directions: D · (1 + g · w) has the wanted sum over the room's light.
    reachable = response.diffuse @ (gray * toward)
    amount = np.clip(missing * received / np.maximum(reachable, 1e-9), -0.98, 3.0).astype(np.float32)
    return replace(response, diffuse=response.diffuse * (1 + amount[:, None] * toward))
