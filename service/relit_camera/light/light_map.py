"""The light map, 64 × 32 texels of radiance from all sides: its type, resampling to it, its energy and irradiance."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from relit_camera.base.errors import ImageError
from relit_camera.base.images.image_types import check_image
from relit_camera.light.directions import MAP_HEIGHT, MAP_WIDTH, texel_directions, texel_solid_angles

LightMap = NDArray[np.float32]
"""(32, 64, 3) float32 linear RGB radiance, row 0 up, the middle toward the camera (see `light.directions`)."""


def check_light_map(light_map: NDArray, name: str = "light map") -> None:
    """Check shape (32, 64, 3) and float32.

    Raises:
        ImageError: it is neither; the message has the shape.
    """
    check_image(light_map, np.float32, name)
    if light_map.shape != (MAP_HEIGHT, MAP_WIDTH, 3):
        raise ImageError(f"{name} has shape {light_map.shape}, not ({MAP_HEIGHT}, {MAP_WIDTH}, 3)")


def _overlap_weights(edges_in: NDArray[np.float64], edges_out: NDArray[np.float64]) -> NDArray[np.float32]:
    """Weights (out, in) of cells between rising edges: the share of each output cell that an input cell covers."""
    top = np.minimum(edges_out[1:, None], edges_in[None, 1:])
    bottom = np.maximum(edges_out[:-1, None], edges_in[None, :-1])
    return np.asarray(np.maximum(top - bottom, 0) / np.diff(edges_out)[:, None], np.float32)


def resample_by_area(radiance: NDArray[np.float32], height: int, width: int) -> NDArray[np.float32]:
    """A latitude-longitude map (height, width, 3) resampled from one of any size (h, w, 3).

    Each texel is the mean over its solid angle of piecewise constant input, so Σ E·ω is kept to rounding. Solid angle
    is the product of widths in θ and in sin φ, so rows and columns are averaged in turn.
    """
    rows_in, columns_in = radiance.shape[:2]
    rows = _overlap_weights(*(-np.cos(np.linspace(0, np.pi, n + 1)) for n in (rows_in, height)))
    columns = _overlap_weights(*(np.linspace(0, 1, n + 1) for n in (columns_in, width)))
    shrunk = (rows @ radiance.reshape(rows_in, -1)).reshape(height, columns_in, 3)
    return np.ascontiguousarray(np.matmul(columns, shrunk), dtype=np.float32)


def resample_to_light_map(radiance: NDArray[np.float32]) -> LightMap:
    """The light map of panorama radiance (h, w, 3) in map axes, of any size; Σ E·ω is kept to 1e-5."""
    return resample_by_area(radiance, MAP_HEIGHT, MAP_WIDTH)


def total(light_map: LightMap) -> NDArray[np.float64]:
    """Σ E·ω per channel (3,): the energy of the light from all sides."""
    rows: NDArray[np.float64] = light_map.sum(axis=1, dtype=np.float64)
    return texel_solid_angles(*light_map.shape[:2])[:, 0] @ rows


def irradiance(light_map: LightMap, normal: ArrayLike) -> NDArray[np.float32]:
    """Σ E·ω·max(0, n·l) per channel (..., 3) on surfaces with unit normals (..., 3).

    A lamp of irradiance 1 gives a surface that faces it 1, and a white diffuse surface then reads 1.
    """
    cosine = np.maximum(0, np.asarray(normal, np.float64) @ texel_directions().reshape(-1, 3).T)
    weighted = (light_map * texel_solid_angles()[..., None]).reshape(-1, 3)
    return (cosine @ weighted).astype(np.float32)
