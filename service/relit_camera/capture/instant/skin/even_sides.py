"""A person's color without what the room's light has left in it: one side brighter or redder than the other.

Both sides of a face have the same skin, but for marks and hair that hangs over it. Where an albedo that was told from
one picture differs between a point and its mirror image by what varies smoothly over the face, that is light which
shape and room did not explain; kept, the lit side of a face by a window would stay lit in any other light. Neck, hair
and clothes are corrected as the face next to them, the less the further they are from it.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from relit_camera.base.array_types import Float32Array
from relit_camera.base.images.image_types import LinearImage, Points
from relit_camera.face.landmarks.landmark_schemes import LandmarkScheme


@dataclass(frozen=True)
class SideTunables:
    """Constants of the correction, chosen on two rendered people by a side window.

    Attributes:
        blur: standard deviation of the blur of the albedo that is compared, in sides of the picture.
        known: share of the blur's weight that must be skin.
        outlier: deviation from what varies smoothly, in logarithms, from which a pair of points hardly counts.
        ridge: pull of the correction toward none, relative to the pairs.
        step: width of the step in the middle of the face over which one side becomes the other, in half faces.
        fade: distance from the face, in half faces, over which the correction fades out.
        range: limits of the factor.
    """

    blur: float = 0.02
    known: float = 0.25
    outlier: float = 0.1
    ridge: float = 0.01
    step: float = 0.25
    fade: float = 0.6
    range: tuple[float, float] = (0.25, 4.0)


TUNABLES = SideTunables()


def even_sides(albedo: LinearImage, skin: NDArray[np.bool_], landmarks: Points, scheme: LandmarkScheme) -> LinearImage:
    """The factor (height, width, 3) of an albedo that makes both sides of a person alike.

    Args:
        albedo: (height, width, 3) of the person.
        skin: (height, width) where it is that of the face, without eyes, brows and lips.
        landmarks: (count, 2) of the face, pixels.
        scheme: of the landmarks.
    """
    at, change = _change_at_landmarks(albedo, skin, landmarks, scheme)
    if not len(at):
        return np.ones_like(albedo)
    face = _in_half_faces(scheme.canonical[:, :2])
    design = _odd_functions(face[at])
    pull = np.sqrt(TUNABLES.ridge * len(at)) * np.eye(design.shape[1])
    amounts = [_robust_fit(np.vstack([design, pull]), np.append(each, np.zeros(len(pull)))) for each in change.T]
    # Pixels as places of the mean face; what is beside the face is corrected as where it ends.
    height, width = skin.shape
    places = np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1).reshape(-1, 2)
    to_face = np.linalg.lstsq(_with_one(landmarks), face)[0]
    seen = _with_one(places) @ to_face
    on_face = np.clip(seen, -1, 1)
    share = np.exp(-((seen - on_face) ** 2).sum(axis=1) / TUNABLES.fade**2)
    factor = np.exp(share[:, None] * (_odd_functions(on_face) @ np.stack(amounts, axis=1))).reshape(height, width, 3)
    return np.asarray(np.clip(factor, *TUNABLES.range), np.float32)


def _change_at_landmarks(
    albedo: LinearImage, skin: NDArray[np.bool_], landmarks: Points, scheme: LandmarkScheme
) -> tuple[NDArray[np.intp], Float32Array]:
    """Landmarks (some,) on skin whose mirror image is on skin too, and by how much the logarithm there is to change."""
    sigma = TUNABLES.blur * max(skin.shape)
    weight = skin.astype(np.float32)
    share = cv2.GaussianBlur(weight, (0, 0), sigma)
    logarithms = np.log(np.maximum(albedo, 1e-4)).astype(np.float32) * weight[..., None]
    soft = cv2.GaussianBlur(logarithms, (0, 0), sigma) / np.maximum(share, 1e-6)[..., None]
    places = (landmarks - 0.5).astype(np.float32)[None]
    values, known = (cv2.remap(each, places, None, cv2.INTER_LINEAR)[0] for each in (soft, share))
    mirror = mirrored_landmarks(scheme)
    at = np.flatnonzero((np.minimum(known, known[mirror]) > TUNABLES.known) & (mirror != np.arange(len(mirror))))
    return at, (values[mirror[at]] - values[at]) / 2


def _odd_functions(places: NDArray[np.floating]) -> NDArray[np.float64]:
    """Smooth functions (count, 7) of places (count, 2) of a face, -1..1 across and up, odd across it."""
    x, y = places.T.astype(np.float64)
    side = np.tanh(x / TUNABLES.step)
    return np.stack([x, x * y, x * y * y, x**3, x**3 * y, side, side * y], axis=1)


def _robust_fit(design: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Amounts (functions,) with which `design` (count, functions) gives most of the values (count,)."""

    def deviation(amounts: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(design @ amounts - values)

    def slope(_: NDArray[np.float64]) -> NDArray[np.float64]:
        return design

    start = np.zeros(design.shape[1])
    return np.asarray(least_squares(deviation, start, jac=slope, loss="cauchy", f_scale=TUNABLES.outlier).x)


def _in_half_faces(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The mean face's points (count, 2), -1..1 across, from its axis, and up, from half way between top and bottom."""
    (_, bottom), (_, top) = points.min(axis=0), points.max(axis=0)
    return np.asarray((points - [0, (bottom + top) / 2]) / (np.ptp(points, axis=0) / 2))


def _with_one(points: NDArray[np.floating]) -> NDArray[np.float64]:
    return np.column_stack([points, np.ones(len(points))])


def mirrored_landmarks(scheme: LandmarkScheme) -> NDArray[np.intp]:
    """For each landmark the index of its mirror image on the mean face; its own on the face's middle."""
    mirrored = scheme.canonical * [-1, 1, 1]
    distances = np.linalg.norm(scheme.canonical[None] - mirrored[:, None], axis=2)
    return np.asarray(distances.argmin(axis=1))
