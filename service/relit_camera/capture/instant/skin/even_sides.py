"""A person's color without what the room's light has left in it: one side brighter or redder than the other.

Both sides of a face have the same skin. Where an albedo that was told from one picture differs between a point and its
mirror image in low frequencies, that is light which shape and room did not explain; kept, the lit side of a face by a
window would stay lit in any other light. Hair, neck and clothes may well differ: they are corrected about as far as the
face is, and toward the same side only.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array
from relit_camera.base.images.image_types import LinearImage, Mask, Points
from relit_camera.capture.geometry.normal_completion import pull_push_fill
from relit_camera.face.landmarks.landmark_schemes import LandmarkScheme


@dataclass(frozen=True)
class SideTunables:
    """Constants of the correction, chosen on two rendered people by a side window.

    Attributes:
        face_blur, blur: standard deviations of what counts as a low frequency, on the face and beside it, in sides of
            the picture.
        known: share of a blur's weight that must be skin, or of the person beside the face.
        sure_matte: from which a pixel is the person's.
        most: percentile of the face's corrections that counts as how far it is corrected.
        beside: how far the rest may be, relative to that.
        range: limits of the factor.
    """

    face_blur: float = 0.02
    blur: float = 0.04
    known: float = 0.25
    sure_matte: float = 0.9
    most: float = 90.0
    beside: float = 1.5
    range: tuple[float, float] = (0.25, 4.0)


TUNABLES = SideTunables()


def even_sides(
    albedo: LinearImage, skin: NDArray[np.bool_], matte: Mask, landmarks: Points, scheme: LandmarkScheme
) -> LinearImage:
    """The factor (height, width, 3) of an albedo that makes both sides of a person alike.

    Args:
        albedo: (height, width, 3) of the person.
        skin: (height, width) where it is that of the face's skin.
        matte: (height, width) of the person.
        landmarks: (count, 2) of the face, pixels.
        scheme: of the landmarks.
    """
    height, width = skin.shape
    logarithms = np.log(np.maximum(albedo, 1e-4)).astype(np.float32)
    at, change = _change_of_face(logarithms, skin, landmarks, scheme)
    if not len(at):
        return np.ones_like(albedo)
    columns, rows = np.clip(landmarks[at].astype(int), 0, [width - 1, height - 1]).T
    known = np.zeros((height, width), np.float32)
    np.add.at(known, (rows, columns), 1)
    found = np.zeros((height, width, 3), np.float32)
    np.add.at(found, (rows, columns), change / known[rows, columns][:, None])
    # How far each channel of the face is corrected, positive where the half at the picture's left becomes brighter.
    toward_left = np.sign(change[scheme.canonical[at, 0] < 0].sum(axis=0))
    most = TUNABLES.beside * np.percentile(np.abs(change), TUNABLES.most, axis=0)
    rest, wanted, left = _change_beside_face(logarithms, matte, landmarks, scheme)
    direction = np.where(left[..., None], toward_left, -toward_left)
    found[rest] = (direction * np.clip(direction * wanted, 0, most))[rest]
    known = np.maximum(np.minimum(known, 1), rest)
    smooth = cv2.GaussianBlur(pull_push_fill(found, known), (0, 0), TUNABLES.face_blur * max(skin.shape))
    return np.asarray(np.clip(np.exp(smooth), *TUNABLES.range), np.float32)


def _change_of_face(
    logarithms: Float32Array, skin: NDArray[np.bool_], landmarks: Points, scheme: LandmarkScheme
) -> tuple[NDArray[np.intp], Float32Array]:
    """Landmarks (some,) on skin whose mirror image is on skin too, and by how much their logarithm is to change."""
    soft, share = _soft(logarithms, skin, TUNABLES.face_blur * max(skin.shape))
    places = (landmarks - 0.5).astype(np.float32)[None]
    values, known = (cv2.remap(each, places, None, cv2.INTER_LINEAR)[0] for each in (soft, share))
    mirror = mirrored_landmarks(scheme)
    at = np.flatnonzero(np.minimum(known, known[mirror]) > TUNABLES.known)
    return at, (values[mirror[at]] - values[at]) / 2


def _change_beside_face(
    logarithms: Float32Array, matte: Mask, landmarks: Points, scheme: LandmarkScheme
) -> tuple[NDArray[np.bool_], Float32Array, NDArray[np.bool_]]:
    """The same for the person's pixels beside the face, which are compared with their reflection at its axis.

    Returns:
        Masks and images (height, width): for which pixels it is known; the change (height, width, 3); which pixels lie
        at the picture's left of the axis.
    """
    height, width = matte.shape
    face = cv2.fillConvexPoly(
        np.zeros((height, width), np.uint8), cv2.convexHull(np.round(landmarks).astype(np.int32)), 1
    )
    beside = (matte > TUNABLES.sure_matte) & (face == 0)
    middle = landmarks[np.abs(scheme.canonical[:, 0]) < 1e-6].astype(np.float64)
    center = middle.mean(axis=0)
    along = np.linalg.svd(middle - center)[2][0]
    right = np.array([along[1], -along[0]]) * np.sign(along[1])
    places = np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1)
    aside = (places - center) @ right
    reflected = (places - 2 * aside[..., None] * right - 0.5).astype(np.float32)
    soft, share = _soft(logarithms, beside, TUNABLES.blur * max(matte.shape))
    soft_there, share_there = (cv2.remap(each, reflected, None, cv2.INTER_LINEAR) for each in (soft, share))
    known = beside & (np.minimum(share, share_there) > TUNABLES.known)
    return known, np.asarray((soft_there - soft) / 2, np.float32), aside < 0


def _soft(values: Float32Array, chosen: NDArray[np.bool_], sigma: float) -> tuple[Float32Array, Float32Array]:
    """Means of the chosen values round each pixel, and the share of what is chosen there."""
    weight = chosen.astype(np.float32)
    share = cv2.GaussianBlur(weight, (0, 0), sigma)
    soft = cv2.GaussianBlur(values * weight[..., None], (0, 0), sigma) / np.maximum(share, 1e-6)[..., None]
    return np.asarray(soft, np.float32), np.asarray(share, np.float32)


def mirrored_landmarks(scheme: LandmarkScheme) -> NDArray[np.intp]:
    """For each landmark the index of its mirror image on the mean face; its own on the face's middle."""
    mirrored = scheme.canonical * [-1, 1, 1]
    distances = np.linalg.norm(scheme.canonical[None] - mirrored[:, None], axis=2)
    return np.asarray(distances.argmin(axis=1))
