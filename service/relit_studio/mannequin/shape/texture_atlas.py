"""Texture atlas of the mannequin: albedo of face and iris, projected from the front."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_filter

from relit_camera.base.array_types import Float64Array
from relit_camera.face.landmarks.landmark_schemes import EyeLandmarks
from relit_studio.mannequin.shape.expression import Expression, control_vertices
from relit_studio.mannequin.shape.head import SCHEME, control_head

Albedo = NDArray[np.float32]
"""(height, width, 3) float32 linear."""

SKIN_TONE = np.array([0.60, 0.375, 0.275])
BROW_TONE = np.array([0.10, 0.058, 0.036])
LIP_TONE = np.array([0.47, 0.185, 0.165])
IRIS_SHARE = 0.43
"""Iris radius over eyeball radius."""

_MOTTLE = ((1.2, 0.012), (5.0, 0.016), (22.0, 0.025))
"""Sigma in pixels and relative strength of the skin's unevenness."""
_BLUSH: tuple[tuple[tuple[float, float], tuple[float, float], tuple[float, float, float]], ...] = (
    ((-4.9, -0.9), (2.2, 1.7), (1.0, 0.86, 0.855)),
    ((4.9, -0.9), (2.2, 1.7), (1.0, 0.86, 0.855)),
    ((0.0, -0.9), (1.1, 0.9), (1.0, 0.86, 0.85)),
    ((0.0, -8.0), (1.6, 1.1), (1.0, 0.92, 0.91)),
    ((-3.2, 3.5), (1.7, 0.6), (0.93, 0.84, 0.82)),
    ((3.2, 3.5), (1.7, 0.6), (0.93, 0.84, 0.82)),
    ((-3.0, 1.7), (1.3, 0.4), (0.94, 0.88, 0.90)),
    ((3.0, 1.7), (1.3, 0.4), (0.94, 0.88, 0.90)),
)
"""Center and radii in centimeters, and the factor on the skin's color."""
_NOSTRILS = ((79, 238, 20), (309, 458, 250))
"""Landmarks about each nostril."""

_SCALE = 36.0
"""Pixels a centimeter of the face."""
_FACE_ORIGIN = np.array([-9.0, 10.0])
"""Centimeters (x, y) of the atlas's upper left corner."""
_FACE_SIZE = (648, 756)
_EYE_CENTER, _EYE_SPAN = np.array([790.0, 140.0]), 126.0
PLAIN = (950.0, 700.0)
"""Atlas position of white, for parts with a color of their own."""
_ATLAS_SIZE = (1000, 756)
_SUBPIXEL_BITS = 4


def face_paint_position(points: Float64Array) -> Float64Array:
    """Atlas pixels (count, 2) of points (count, 3) of the head at rest."""
    position = (points[:, :2] - _FACE_ORIGIN) * [_SCALE, -_SCALE]
    return np.asarray(np.clip(position, 1, np.array(_FACE_SIZE) - 2))


def eye_paint_position(directions: Float64Array) -> Float64Array:
    """Atlas pixels (..., 2) of unit vectors (..., 3) from the eyeball's center, the iris looking along +Z."""
    return np.asarray(_EYE_CENTER + directions[..., :2] * [_EYE_SPAN, -_EYE_SPAN])


@lru_cache(maxsize=1)
def atlas() -> Albedo:
    """The whole atlas, float32 linear albedo."""
    picture = np.ones((_ATLAS_SIZE[1], _ATLAS_SIZE[0], 3), np.float32)
    picture[: _FACE_SIZE[1], : _FACE_SIZE[0]] = _face()
    top, left = (int(value - _EYE_SPAN - 2) for value in _EYE_CENTER[::-1])
    eye = _eye()
    picture[top : top + eye.shape[0], left : left + eye.shape[1]] = eye
    return picture


def _face() -> Albedo:
    head = control_head()
    points = face_paint_position((head.skin @ control_vertices(Expression()))[: len(SCHEME.canonical) - 10])
    random = np.random.default_rng(7)
    shape = _FACE_SIZE[::-1]
    mottle = sum(weight * _unit(gaussian_filter(random.standard_normal(shape), sigma)) for sigma, weight in _MOTTLE)
    face = (SKIN_TONE * (1 + np.asarray(mottle)[..., None] * [0.6, 1.0, 1.0])).astype(np.float32)
    for position, radius, tint in _BLUSH:
        center = face_paint_position(np.array([[*position, 0.0]]))[0]
        _tint(face, _blob(shape, center, np.array(radius) * _SCALE), tint)
    lips = _outline(points, (*SCHEME.upper_lip_outer, *SCHEME.lower_lip_outer[-2:0:-1]))
    # Real lips fade into the skin below and keep a crisp bow above.
    _cover(face, 0.9 * gaussian_filter(_filled(shape, lips), 2.2), LIP_TONE * (1 + 0.5 * np.asarray(mottle)[..., None]))
    _cover(face, 0.75 * gaussian_filter(_stroke(shape, points[[*SCHEME.upper_lip_inner]], 3), 1.5), LIP_TONE * 0.35)
    for eye, brow in ((SCHEME.right_eye, SCHEME.right_brow), (SCHEME.left_eye, SCHEME.left_brow)):
        _paint_eye(face, points, eye)
        _paint_brow(face, points[list(brow)], random)
    for nostril in _NOSTRILS:
        center = points[list(nostril)].mean(axis=0)
        _cover(face, 0.8 * _blob(shape, center, np.array([0.26, 0.15]) * _SCALE), SKIN_TONE * [0.2, 0.12, 0.1])
    return np.asarray(face)


def _paint_eye(face: Albedo, points: Float64Array, eye: EyeLandmarks) -> None:
    upper = points[list(eye.lids[:9])]
    lower = points[[eye.outer, *eye.lids[:8:-1], eye.inner]]
    shape = face.shape[:2]
    lash = np.zeros(shape, np.float32)
    for start, thickness in enumerate((6, 6, 6, 5, 4, 3, 2)):
        lash = np.maximum(lash, _stroke(shape, upper[start : start + 2] - [0, 0.25 * thickness], thickness))
    _cover(face, 0.92 * np.minimum(1.2 * gaussian_filter(lash, 1.3), 1), np.array([0.03, 0.02, 0.016]))
    _cover(face, 0.35 * gaussian_filter(_stroke(shape, lower[1:-2] - [0, -1.5], 4), 1.6), np.array([0.10, 0.05, 0.04]))
    crease = upper[1:-1] - [0, 0.42 * _SCALE]
    _cover(face, 0.45 * gaussian_filter(_stroke(shape, crease, 3), 2.0), SKIN_TONE * [0.5, 0.38, 0.34])


def _paint_brow(face: Albedo, brow: Float64Array, random: np.random.Generator) -> None:
    """Fine hairs between the brow's upper edge (5 points from the outer end) and lower edge (5 points, back)."""
    upper, lower = _resampled(brow[:5], 90), _resampled(brow[:4:-1], 90)
    # From the outer end: a fine tail, full over the pupil, softer at the nose.
    thick = np.interp(np.linspace(0, 1, 90), [0, 0.12, 0.55, 0.9, 1], [0.12, 0.4, 0.66, 0.72, 0.6])[:, None]
    upper = lower + (upper - lower) * (0.12 + thick)
    lower = lower + (upper - lower) * 0.12
    mask = np.zeros(face.shape[:2], np.float32)
    for start in random.uniform(3, 89, 700):
        root = lower[int(start)] + (upper[int(start)] - lower[int(start)]) * random.uniform(0, 0.85)
        tip = upper[max(int(start - random.uniform(5, 12)), 0)]
        ends = np.stack([root, root + 0.6 * (tip - root)])
        hair = np.zeros(face.shape[:2], np.uint8)
        _line(hair, ends, 1)
        (left, top), (right, bottom) = ends.min(axis=0).astype(int) - 3, ends.max(axis=0).astype(int) + 4
        mask[top:bottom, left:right] += hair[top:bottom, left:right] / 255.0
    body = gaussian_filter(_filled(face.shape[:2], np.concatenate([upper, lower[::-1]])), 2.5)
    hairs = 1 - np.exp(-0.5 * gaussian_filter(mask, 0.6))
    fade = 0.55 * body + 0.6 * hairs
    _cover(face, np.clip(fade, 0, 0.92), BROW_TONE)


def _eye() -> Albedo:
    size = int(2 * _EYE_SPAN + 5)
    y, x = np.mgrid[:size, :size]
    center = _EYE_SPAN + 2
    dx, dy = (x - center) / _EYE_SPAN, (y - center) / _EYE_SPAN
    radius, angle = np.hypot(dx, dy), np.arctan2(dy, dx)
    random = np.random.default_rng(3)
    eye = np.array([0.64, 0.62, 0.60]) * (1 - 0.25 * np.clip(radius - 0.45, 0, 1)[..., None] * [0.3, 1.0, 1.0])
    fraction = radius / IRIS_SHARE
    streaks = sum(np.sin(angle * n + random.uniform(0, 6.3)) for n in (17, 29, 41, 58)) / 8
    tone = (
        np.array([0.085, 0.15, 0.17]) * (0.75 + 1.1 * np.exp(-(((fraction - 0.55) / 0.22) ** 2)) + streaks)[..., None]
    )
    tone *= 1 - 0.75 * np.clip((fraction - 0.82) / 0.18, 0, 1)[..., None]
    eye = _mixed(eye, tone, _step(fraction, 1.0, 0.035))
    eye = _mixed(eye, np.full(3, 0.008), _step(fraction, 0.40, 0.03))
    return eye.astype(np.float32)


def _step(value: NDArray, edge: float, softness: float) -> NDArray:
    return np.asarray(np.clip(0.5 + (edge - value) / (2 * softness), 0, 1)[..., None])


def _mixed(under: NDArray, over: NDArray, alpha: NDArray) -> NDArray:
    return np.asarray(under + (over - under) * alpha)


def _cover(face: Albedo, alpha: NDArray, tone: ArrayLike) -> None:
    face += (np.asarray(tone) - face) * alpha[..., None]


def _tint(face: Albedo, alpha: NDArray, factor: ArrayLike) -> None:
    face *= 1 + (np.asarray(factor) - 1) * alpha[..., None]


def _unit(noise: NDArray) -> NDArray:
    return np.asarray(noise / noise.std())


def _blob(shape: tuple[int, ...], center: NDArray, radii: NDArray) -> NDArray:
    y, x = np.ogrid[: shape[0], : shape[1]]
    return np.asarray(np.exp(-(((x - center[0]) / radii[0]) ** 2) - ((y - center[1]) / radii[1]) ** 2))


def _resampled(line: Float64Array, count: int) -> Float64Array:
    at = np.linspace(0, 1, len(line))
    return np.stack([np.interp(np.linspace(0, 1, count), at, line[:, axis]) for axis in (0, 1)], axis=1)


def _outline(points: Float64Array, loop: tuple[int, ...]) -> Float64Array:
    """A closed outline through landmarks, rounded as the subdivided skin is (Chaikin 1974)."""
    line = points[list(loop)]
    for _ in range(2):
        after = np.roll(line, -1, axis=0)
        line = np.stack([0.75 * line + 0.25 * after, 0.25 * line + 0.75 * after], axis=1).reshape(-1, 2)
    return np.asarray(line)


def _fixed(line: Float64Array) -> NDArray[np.int32]:
    return np.round(line * (1 << _SUBPIXEL_BITS)).astype(np.int32)[:, None]


def _filled(shape: tuple[int, ...], outline: Float64Array) -> NDArray[np.float32]:
    mask = np.zeros(shape[:2], np.uint8)
    cv2.fillPoly(mask, [_fixed(outline)], 255, cv2.LINE_AA, _SUBPIXEL_BITS)
    return (mask / 255.0).astype(np.float32)


def _stroke(shape: tuple[int, ...], line: Float64Array, thickness: int) -> NDArray[np.float32]:
    mask = np.zeros(shape[:2], np.uint8)
    _line(mask, line, thickness)
    return (mask / 255.0).astype(np.float32)


def _line(mask: NDArray[np.uint8], line: Float64Array, thickness: int) -> None:
    cv2.polylines(mask, [_fixed(line)], False, 255, thickness, cv2.LINE_AA, _SUBPIXEL_BITS)
