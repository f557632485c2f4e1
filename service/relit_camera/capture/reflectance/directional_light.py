"""Relighting a subject by one distant light from an exact direction, without the 64 × 32 light map."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from relit_camera.base.images.image_types import LinearImage
from relit_camera.capture.reflectance.method_registry import LinearMethod, ReflectanceMethod, open_method
from relit_camera.light.directions import MAP_HEIGHT, MAP_WIDTH, map_position_from_direction
from relit_camera.subject.subject import Subject

CAPTURED_LIGHT_RADIUS_DEG = 3.0
"""Distance from a captured light within which its own picture has weight: half a texel of the map."""


def relight_from_direction(subject: Subject, direction: NDArray[np.float64]) -> LinearImage:
    """The picture under a light of unit irradiance from `direction` (3,), a unit vector.

    At a captured direction this is the captured frame, within the subject's compression accuracy. A subject of an
    instant capture has no captured direction, and none of the methods: the texels in its file are interpolated.

    Raises:
        NotFoundError: the subject's method is not installed.
    """
    if subject.metadata.rung == "instant":
        amounts = _interpolated_coefficients(subject, direction[None, :])
    else:
        amounts = directional_coefficients(subject, open_method(subject.metadata.method), direction[None, :])
    return np.asarray(subject.pictures(amounts)[0])


def directional_coefficients(
    subject: Subject, method: ReflectanceMethod, directions: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Amounts (components, count) of the subject's shared basis under unit light from unit vectors (count, 3).

    A linear method gives weights of the captured lights. For other methods the texels in the file are interpolated, and
    near a captured light its own picture replaces them.
    """
    captured = subject.light_directions.astype(np.float64)
    if isinstance(method, LinearMethod):
        return np.asarray(subject.light_coefficients @ method.weights(captured, directions), np.float32)
    from_map = _interpolated_coefficients(subject, directions)
    cosines = directions @ captured.T
    nearest = cosines.argmax(axis=1)
    distance_deg = np.degrees(np.arccos(np.clip(cosines.max(axis=1), -1, 1)))
    fraction = np.clip(1 - distance_deg / CAPTURED_LIGHT_RADIUS_DEG, 0, 1)
    return np.asarray(fraction * subject.light_coefficients[:, nearest] + (1 - fraction) * from_map, np.float32)


def _interpolated_coefficients(subject: Subject, directions: NDArray[np.float64]) -> NDArray[np.float32]:
    """Coefficients (components, count) between those of the texels in the subject's file."""
    return np.asarray((bilinear_map_lookup(directions) @ subject.coefficients.T).T, np.float32)


def bilinear_map_lookup(directions: NDArray[np.float64]) -> csr_array:
    """Bilinear interpolation on the 64 × 32 map as a matrix (count, 2048); at a texel's centre, that texel alone."""
    row, column = map_position_from_direction(directions)
    row = np.clip(row, 0, MAP_HEIGHT - 1)
    # The position of a texel's center may be a rounding error below its integer.
    top, left = np.floor(row + 1e-9).astype(int), np.floor(column + 1e-9).astype(int)
    down, right = np.maximum(row - top, 0), np.maximum(column - left, 0)
    entries = []
    for row_step, row_fraction in ((0, 1 - down), (1, down)):
        for column_step, column_fraction in ((0, 1 - right), (1, right)):
            texel = np.minimum(top + row_step, MAP_HEIGHT - 1) * MAP_WIDTH + (left + column_step) % MAP_WIDTH
            entries.append((row_fraction * column_fraction, texel))
    values, texels = (np.concatenate(part) for part in zip(*entries, strict=True))
    rows = np.tile(np.arange(len(directions)), len(entries))
    return csr_array((values, (rows, texels)), shape=(len(directions), MAP_HEIGHT * MAP_WIDTH))
