"""Estimating the room's light from the live face.

The subject's reflectance field gives the face under any light, so the light under which it looks as it does now is a
linear fit: non-negative amounts of some eighty soft lights, fixed in the room, that explain the live pixels of the
face. It is fitted robustly, a few times a second. Between fits a gain per frame follows the camera's exposure.

What a soft light does to the face is written in spherical harmonics of degree 12: no more are in it, and 169 of them
are read in place of the subject's components and the 2048 texels.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from functools import partial
from itertools import product

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import LUMINANCE, linear_from_uint8
from relit_camera.base.images.image_types import DisplayImage, Points
from relit_camera.base.rotations import Rotation
from relit_camera.face.landmarks.landmark_triangulation import delaunay_triangles
from relit_camera.light.directions import (
    MAP_HEIGHT,
    MAP_WIDTH,
    texel_directions,
    texel_solid_angles,
)
from relit_camera.light.exposure import facing_light
from relit_camera.light.light_map import LightMap
from relit_camera.light.soft_lights import SoftLights, regularized_nnls
from relit_camera.light.spherical_harmonics import basis
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.subject.subject import Subject


@dataclass(frozen=True)
class RoomLightTunables:
    """Constants of the estimation.

    Attributes:
        harmonics_degree: of the harmonics that a light is written in: finer light hardly changes a face.
        ridge: pull toward the last fit, relative to the normal matrix's mean diagonal.
        robust_iterations: solutions of the first fit, each with new weights; later fits have one, weighed by the last
            light.
        fits_per_s: how often the light is fitted.
        light_smoothing: share of the way from the last light to the newly fitted one.
        residual_smoothing: share of the way that the reported residual goes to that of each fit.
        turn_tolerance: radians that the head turns before the face under the last light is predicted anew, by which the
            gain is measured: by one degree it changes by less than 2 %.
        clipping_code: sRGB code from which a sample counts as clipped.
        huber_threshold: relative residual from which a sample loses weight (Huber).
        min_samples: usable samples that the gain of a frame needs.
        gain_range: limits of that gain.
        gap_s: after so long without a frame the residual begins anew.
    """

    harmonics_degree: int = 10
    ridge: float = 3e-3
    robust_iterations: int = 3
    fits_per_s: float = 4.0
    light_smoothing: float = 0.5
    residual_smoothing: float = 0.5
    turn_tolerance: float = np.pi / 180
    clipping_code: int = 250
    huber_threshold: float = 0.25
    min_samples: int = 20
    gain_range: tuple[float, float] = (0.25, 4.0)
    gap_s: float = 0.5


TUNABLES = RoomLightTunables()
LIGHTS = SoftLights()
"""The soft lights whose amounts are fitted."""
LEAST_CONTRAST = 0.1
"""Of a face in flat light, relative to its mean."""
BLUR_CELLS = 3
"""A large live picture is reduced until a sample is the mean of so many by so many pixels; odd: none is displaced."""
CELLS_PER_BOX = 3.3
"""Cells in a box that blurs as much as that mean with the interpolation between cells: √(3² + 2)."""


@dataclass(frozen=True)
class RoomLightEstimate:
    """The room's light in one frame.

    Attributes:
        light_map: (32, 64, 3) float32 room radiance in units of the live picture's linear values.
        in_head_frame: gives the same as a head sees it under a rotation, head → room.
        gain: (3,) float32 by which this frame's exposure differs from the fit's.
        residual: deviation of the live face from the relit one, relative to its contrast (see `relative_deviation`):
            how badly the light explains it; NaN where too little of the face was seen so far.
        skin: (count, 3) float32 linear values of the live face, where it is seen and not clipped.
    """

    light_map: LightMap
    in_head_frame: Callable[[Rotation], LightMap]
    gain: NDArray[np.float32]
    residual: float
    skin: NDArray[np.float32]

    def cast(self, tint: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
        """The color (3,) of the light that faces the camera, in this frame's exposure, of luminance 1.

        `tint` (3,) is the color of the skin beside that of the subject's; None for the same.
        """
        color = facing_light(self.light_map) * self.gain / (1 if tint is None else tint)
        return np.asarray(color / max(float(color @ LUMINANCE), 1e-6), np.float32)


@dataclass(frozen=True)
class _Prediction:
    """The last fitted light, as a head sees it.

    Attributes:
        rotation: of the head.
        samples: (count, 3) float32 of the face under that light.
    """

    rotation: Rotation
    samples: NDArray[np.float32]


class RoomLightEstimator:
    """Fits the room's light to the face of one subject."""

    def __init__(self, subject: Subject, face: SourceFace) -> None:
        self._triangles = _skin_triangles(face)
        harmonics = basis(texel_directions().reshape(-1, 3), TUNABLES.harmonics_degree)
        weighted = harmonics * texel_solid_angles().reshape(-1, 1)
        self._project = np.linalg.solve(harmonics.T @ weighted, weighted.T).astype(np.float32)
        samples = _sample_basis(subject, face.landmarks[self._triangles].mean(axis=1))
        self._response = samples @ (subject.coefficients @ weighted.astype(np.float32))
        self._forget()

    def fresh(self) -> RoomLightEstimator:
        """Another one for the same subject, which knows nothing yet; it takes no time to make."""
        other = copy(self)
        other._forget()
        return other

    def _forget(self) -> None:
        self._amounts = np.zeros((LIGHTS.count, 3), np.float32)
        self._light_map = np.zeros((MAP_HEIGHT, MAP_WIDTH, 3), np.float32)
        self._fitted_at = self._updated_s = -np.inf
        self._residual: float | None = None
        self._seen: _Prediction | None = None

    def update(self, image: DisplayImage, landmarks: Points, rotation: Rotation, time_s: float) -> RoomLightEstimate:
        """Estimate the light of the next live frame.

        Args:
            image: the live picture, uint8 sRGB.
            landmarks: (count, 2) of the live face, in the scheme of the subject's.
            rotation: head → room, relative to neutral.
            time_s: of the frame.
        """
        live, usable = _sample_frame(image, landmarks[self._triangles].mean(axis=1))
        if not 0 <= time_s - self._updated_s <= TUNABLES.gap_s:
            self._residual = None  # it may be another face
        self._updated_s = time_s
        due = time_s - self._fitted_at > 1 / TUNABLES.fits_per_s or time_s < self._fitted_at
        if due:
            self._fit(live, usable, LIGHTS.maps(rotation))
            self._fitted_at = time_s
            self._light_map = _soft_light_map(self._amounts)
        if due or self._seen is None or (rotation * self._seen.rotation.inv()).magnitude() > TUNABLES.turn_tolerance:
            self._seen = self._predict_under(rotation)
        gain = _exposure_gain(live, self._seen.samples, usable)
        if due and usable.sum() >= TUNABLES.min_samples:
            now = relative_deviation(live[usable], self._seen.samples[usable] * gain)
            self._residual = (
                now if self._residual is None else self._residual + TUNABLES.residual_smoothing * (now - self._residual)
            )
        residual = np.nan if self._residual is None else self._residual
        return RoomLightEstimate(self._light_map, partial(_soft_light_map, self._amounts), gain, residual, live[usable])

    def _predict_under(self, rotation: Rotation) -> _Prediction:
        return _Prediction(
            rotation, self._predict(self._project @ _soft_light_map(self._amounts, rotation).reshape(-1, 3))
        )

    def _predict(self, harmonics: NDArray[np.floating]) -> NDArray[np.float32]:
        """The samples (count, 3) under a light of these harmonics (harmonics, 3)."""
        return np.stack([self._response[c] @ harmonics[:, c] for c in range(3)], axis=1).astype(np.float32)

    def _fit(self, live: NDArray[np.float32], usable: NDArray[np.bool_], lobes: NDArray[np.float32]) -> None:
        mixed = self._project @ lobes
        first = not self._amounts.any()
        predicted = self._predict(mixed @ self._amounts)
        predicted *= _exposure_gain(live, predicted, usable)
        new = np.empty_like(self._amounts)  # estimates hold the old ones
        for channel in range(3):
            design, goal = self._response[channel] @ mixed, live[:, channel]
            amounts = self._amounts[:, channel]
            level = max(float(goal[usable].mean()) if usable.any() else 0.0, 1e-4)
            weight = usable if first else _robust_weight(predicted[:, channel], goal, level, usable)
            for _ in range(TUNABLES.robust_iterations if first else 1):
                fitted = regularized_nnls(design, goal, weight, amounts, TUNABLES.ridge)
                weight = _robust_weight(design @ fitted, goal, level, usable)
            new[:, channel] = fitted if first else amounts + TUNABLES.light_smoothing * (fitted - amounts)
        self._amounts = new


def _soft_light_map(amounts: NDArray[np.float32], rotation: Rotation | None = None) -> LightMap:
    """The light map of soft lights of these amounts (count, 3), in the room or as a head sees it under a rotation."""
    return (LIGHTS.maps(rotation) @ amounts).reshape(MAP_HEIGHT, MAP_WIDTH, 3)


def relative_deviation(live: NDArray[np.float32], relit: NDArray[np.float32]) -> float:
    """Median deviation of relit samples (count, 3) from the live ones, relative to the contrast of the live face.

    A channel's contrast is its median absolute deviation, and a tenth of its mean for faces in flat light, of which
    little but noise is left. So hard and coloured light, which makes every error larger, does not count against a face.
    """
    middle, mean = np.median(live, axis=0), live.mean(axis=0)
    contrast = np.median(np.abs(live - middle), axis=0) + LEAST_CONTRAST * mean
    return float(np.median(np.abs(relit - live) / np.maximum(contrast, 1e-5)))


def _exposure_gain(
    live: NDArray[np.float32], predicted: NDArray[np.float32], usable: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """The factor (3,) float32 by which the live samples (count, 3) are brighter than the predicted ones."""
    if usable.sum() < TUNABLES.min_samples:
        return np.ones(3, np.float32)
    if not usable.all():
        live, predicted = live[usable], predicted[usable]
    ratio = live / np.maximum(predicted, 1e-4)
    return np.clip(np.median(ratio, axis=0), *TUNABLES.gain_range).astype(np.float32)


def _robust_weight(
    fitted: NDArray[np.floating], goal: NDArray[np.float32], level: float, usable: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Huber's weights (count,) of samples, by their error relative to `level`."""
    error = np.abs(fitted - goal) / level
    return np.asarray(usable * np.minimum(1, TUNABLES.huber_threshold / np.maximum(error, 1e-9)))


def _skin_triangles(face: SourceFace) -> NDArray[np.intp]:
    """Triangles (count, 3) of landmark indices that lie on skin: not in the eyes, nor between the lips."""
    scheme = face.scheme
    triangles = delaunay_triangles(face.landmarks)
    holes = [
        set(scheme.right_eye.lids) | set(scheme.right_eye.iris),
        set(scheme.left_eye.lids) | set(scheme.left_eye.iris),
    ]
    holes.append(set(scheme.lips))
    keep = [not any(set(map(int, t)) <= hole for hole in holes) for t in triangles]
    return np.asarray(triangles[np.array(keep)])


def _sample_basis(subject: Subject, points: Points) -> NDArray[np.float32]:
    """The subject's rows at `points` (count, 2): (3, count, components), blurred as the live samples are."""
    width, height = subject.size
    reach = _blur_size(points)
    # What a box filter and then bilinear interpolation would read there, borders repeated.
    offsets = np.arange(reach) - reach // 2
    base = np.floor(points - 0.5)
    share = points - 0.5 - base
    pixels, weights = [], []
    for across, up in product((0, 1), repeat=2):
        corner = np.abs(1 - across - share[:, 0]) * np.abs(1 - up - share[:, 1]) / reach**2
        for x, y in product(offsets + across, offsets + up):
            column = np.clip(base[:, 0] + x, 0, width - 1)
            pixels.append((np.clip(base[:, 1] + y, 0, height - 1) * width + column).astype(np.intp))
            weights.append(corner)
    return subject.basis.rows(np.stack(pixels, axis=1), np.stack(weights, axis=1))


def _sample_frame(image: DisplayImage, points: Points) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Linear values (count, 3) of the live picture at `points`, and which of them lie inside it and are not clipped.

    They are means over about `_blur_size` pixels.
    """
    reach = _blur_size(points)
    cell = max(round(reach / CELLS_PER_BOX), 1)
    box = reach if cell == 1 else BLUR_CELLS
    height, width = image.shape[:2]
    low = np.clip(np.floor(points.min(axis=0)).astype(int) - reach, 0, [width - 2, height - 2])
    high = np.clip(np.ceil(points.max(axis=0)).astype(int) + reach, low + 2, [width, height])
    columns, rows = map(int, np.maximum((high - low) // cell, 1))
    part = image[low[1] : low[1] + rows * cell, low[0] : low[0] + columns * cell]
    small = part if cell == 1 else cv2.resize(part, (columns, rows), interpolation=cv2.INTER_AREA)
    soft = cv2.blur(linear_from_uint8(np.asarray(small, np.uint8)), (box, box))
    local = ((points - low) / cell - 0.5).astype(np.float32)
    values = cv2.remap(soft, local[None], None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)[0]
    column, row = np.clip(points.astype(int), 0, [width - 1, height - 1]).T
    unclipped = (image[row, column] < TUNABLES.clipping_code).all(axis=1)
    return values, unclipped & ((points > 0) & (points < [width, height])).all(axis=1)


def _blur_size(points: Points) -> int:
    """Box size in pixels: about the spacing of the samples, so that both pictures are sampled equally coarsely."""
    return max(int(np.ptp(points[:, 0]) / 24), 1)
