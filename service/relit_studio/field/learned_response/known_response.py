"""How one rendered person answers light, beside what instant capture sees of them and expects."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array
from relit_camera.base.errors import CaptureError
from relit_camera.base.images.color import luminance, uint8_from_linear
from relit_camera.capture.instant.face_selection import follow_face, select_faces
from relit_camera.capture.instant.head_shape import fit_head_shape
from relit_camera.capture.instant.median_picture import median_picture
from relit_camera.capture.instant.response.generic_reflectance import shape_response
from relit_camera.capture.instant.response.learned_response import response_inputs
from relit_camera.capture.instant.response.response_network import DEGREE
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.light.directions import texel_directions, texel_solid_angles
from relit_camera.light.spherical_harmonics import texel_basis

FRAME_PX = 480
"""Side of the picture in which the face is found."""
BRIGHT, BEHIND = 0.7, 0.25
"""Linear value of the person's 95th percentile in that picture, and of what is behind them."""
OPAQUE, ON_SKIN = 0.8, 0.95
"""Mattes from which pixels are compared, and skin is."""
LEAST_LIGHT, LEAST_ALBEDO = 1e-4, 1e-2
"""What a pixel is taken to send at least, so that it has a logarithm; and the least albedo of skin."""


@dataclass(frozen=True)
class KnownResponse:
    """One person's pixels, under some lights.

    Attributes:
        inputs: (pixels, 12) what the network sees, see `response_inputs`.
        expected: (pixels, lights) the generic response, gloss included, in units of the skin's albedo.
        truth: (pixels, lights) logarithm of the true one in the same unit, which holds the pixel's own albedo too.
        skin: (pixels,) 1 where it is bare skin, of whose albedo the skin's is the median; else 0.
        harmonics: (lights, 9) what one of each harmonic adds to `expected`.
    """

    inputs: Float32Array
    expected: Float32Array
    truth: Float32Array
    skin: Float32Array
    harmonics: Float32Array


def known_response(samples: OlatSamples, lights: NDArray[np.float32], lamp_size_deg: float) -> KnownResponse:
    """The response of a person under lights (2048, count), luminance times solid angle.

    Args:
        samples: the person under lamps all round.
        lights: see `training_lights`.
        lamp_size_deg: full angle of those lamps.

    Raises:
        CaptureError: no face is found, or no bare skin.
        ModelError: the networks are not there.
    """
    frame = _frame(samples)
    face = select_faces([frame], follow_face([frame]), "the picture in even light").faces[0]
    picture = median_picture([face])
    side = len(picture.matte) // 2
    matte = np.asarray(cv2.resize(picture.matte, (side, side), interpolation=cv2.INTER_AREA), np.float32)
    shape = fit_head_shape((picture.landmarks / 2).astype(np.float32), matte)
    response = shape_response(shape.geometry, shape.certainty, matte)
    # From the pixels of the response to those of the field's pictures.
    reach = float(np.ptp(face.landmarks[:, 0]) / np.ptp(picture.landmarks[:, 0]))
    corner = face.landmarks.mean(axis=0) - reach * picture.landmarks.mean(axis=0)
    scale = samples.matte.shape[0] / FRAME_PX
    y, x = np.divmod(response.pixels, side)
    place = [((corner[i] + 2 * reach * (each + 0.5)) * scale - 0.5)[None] for i, each in enumerate((x, y))]
    place_x, place_y = (np.asarray(each, np.float32) for each in place)

    def at_pixels(image: NDArray[np.float32]) -> Float32Array:
        return np.asarray(cv2.remap(image, place_x, place_y, cv2.INTER_LINEAR)[0], np.float32)

    seen = np.stack([at_pixels(luminance(each).astype(np.float32)) for each in samples.pictures], axis=1)
    lamps = lamp_maps(samples.directions, lamp_size_deg)
    diffuse, glossy = response.diffuse @ lamps, response.glossy @ lamps
    weights = lamp_weights(samples.directions, lights)
    inside, true_matte = matte.ravel()[response.pixels], at_pixels(samples.matte)
    skin = shape.skin.ravel()[response.pixels] & (np.minimum(inside, true_matte) > ON_SKIN)
    if not skin.any():
        raise CaptureError("no bare skin is seen of the person", "leave them out")
    albedo = np.median(((seen - glossy) * diffuse)[skin].sum(axis=1) / (diffuse[skin] ** 2).sum(axis=1))
    albedo = max(float(albedo), LEAST_ALBEDO)
    kept = np.minimum(inside, true_matte) > OPAQUE
    return KnownResponse(
        inputs=response_inputs(response, shape, matte)[kept],
        expected=((diffuse + glossy / albedo) @ weights)[kept].astype(np.float32),
        truth=np.log(np.maximum((seen @ weights)[kept] / albedo, LEAST_LIGHT)).astype(np.float32),
        skin=skin[kept].astype(np.float32),
        harmonics=harmonics_of(weights, lamps),
    )


def _frame(samples: OlatSamples) -> NDArray[np.uint8]:
    """The person in the light of all lamps together, before a gray wall."""
    even = samples.pictures.mean(axis=0)
    even *= BRIGHT / max(float(np.percentile(even[samples.matte > ON_SKIN], 95)), 1e-9)
    seen = even + (1 - samples.matte[..., None]) * np.float32(BEHIND)
    large = cv2.resize(seen, (FRAME_PX, FRAME_PX), interpolation=cv2.INTER_CUBIC)
    return uint8_from_linear(np.maximum(large, 0))


def lamp_maps(directions: NDArray[np.float64], size_deg: float) -> NDArray[np.float32]:
    """Solid angle (2048, lamps) of the texels that each lamp covers, over that of all of them: the sums are 1."""
    inside = texel_directions().reshape(-1, 3) @ directions.T > np.cos(np.radians(size_deg / 2))
    measured = inside * texel_solid_angles().reshape(-1, 1)
    return np.asarray(measured / measured.sum(axis=0), np.float32)


def lamp_weights(directions: NDArray[np.float64], lights: NDArray[np.float32]) -> NDArray[np.float32]:
    """Irradiance (lamps, lights) with which the lamps together give each light.

    What comes from between lamps is shared by them, with weights as wide as half of their spacing.
    """
    width = np.sqrt(4 * np.pi / len(directions)) / 2
    share = np.exp((texel_directions().reshape(-1, 3) @ directions.T - 1) / width**2)
    return np.asarray((share / share.sum(axis=1, keepdims=True)).T @ lights, np.float32)


def harmonics_of(weights: NDArray[np.float32], lamps: NDArray[np.float32]) -> Float32Array:
    """What one of each harmonic sends (lights, 9) under lights of `lamp_weights`, made of lamps of `lamp_maps`."""
    return np.asarray(weights.T @ (lamps.T @ texel_basis(DEGREE)), np.float32)
