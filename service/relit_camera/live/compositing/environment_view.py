"""The environment as the camera sees it behind the person: a perspective picture of a panorama."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import DisplayImage, LinearImage
from relit_camera.base.images.tone_mapping import display_from_linear
from relit_camera.base.rotations import Rotation
from relit_camera.light.directions import map_position_from_direction
from relit_camera.light.environments.environment_panorama import Panorama

RADIANCE_TO_DISPLAY = np.pi
"""What a picture shows of radiance 1. The unit of relit pictures is a white wall under irradiance 1, whose radiance is
1/π: with this factor the environment's own walls are as bright as the same wall beside the face."""

BLUR_SIGMA = 0.1
"""Standard deviation, as a share of the picture's height, of a blur of 1."""

_DISK_RADIUS = 5
"""Radius of the blur's disc in working pixels, where the panorama is fine enough: enough for lights to look round."""

_BAND_ROWS = 32
"""Rows of a view whose directions are in memory at once: all of them would be 22 MB at 1280 × 720, and as much again
for each step of their conversion."""


class EnvironmentView:
    """Looks from the camera along -Z into a panorama: at what lies around the edges of its file."""

    def __init__(self, panorama: Panorama, size: tuple[int, int], height_deg: float, blur: float = 0.0) -> None:
        """Prepare what does not change as the environment turns.

        Args:
            panorama: the light from all sides.
            size: of the pictures, (width, height).
            height_deg: their vertical field of view, under 180.
            blur: 0 sharp, 1 as a lens that spreads a point to a disc with a sigma of a tenth of the height.
        """
        self._size = size
        width, height = size
        radius = 2 * BLUR_SIGMA * blur * height  # a disc's standard deviation along an axis is half its radius
        # Neither what the panorama does not hold nor what the disc takes away need be computed.
        texels = panorama.radiance.shape[0] * height_deg / 180
        shrink = max(1.0, min(height / (2 * texels), 8.0), min(radius / _DISK_RADIUS, 8.0))
        self._working_size = (max(1, round(width / shrink)), max(1, round(height / shrink)))
        self._disc = _disk_kernel(radius / shrink)
        self._panorama = _wrap_columns(_downsample(panorama.radiance, self._working_size[1] * 180 / height_deg))
        self._across, self._up = _image_plane(size, self._working_size, height_deg)

    def picture(self, rotation: Rotation, exposure: float) -> DisplayImage:
        """What the camera sees, uint8 sRGB of the view's size.

        Args:
            rotation: turns the environment: the room's direction l shows the panorama at R⁻¹·l.
            exposure: display light of a unit of relit pictures (see `light.exposure.auto_exposure_scale`).
        """
        to_panorama = rotation.as_matrix()  # rows times it are R⁻¹·l
        across = self._across[:, np.newaxis] * to_panorama[0] - to_panorama[2]
        up = self._up[:, np.newaxis] * to_panorama[1]
        height, width = self._panorama.shape[0], self._panorama.shape[1] - 2
        radiance = np.empty((len(up), len(across), 3), np.float32)
        for top in range(0, len(up), _BAND_ROWS):
            band = up[top : top + _BAND_ROWS, np.newaxis] + across
            row, column = map_position_from_direction(band, height, width)
            cv2.remap(
                self._panorama,
                (column + 1).astype(np.float32),
                row.astype(np.float32),
                cv2.INTER_LINEAR,
                dst=radiance[top : top + _BAND_ROWS],
                borderMode=cv2.BORDER_REPLICATE,
            )
        light = cv2.filter2D(radiance, -1, self._disc, borderType=cv2.BORDER_REPLICATE)
        shown = display_from_linear(light * np.float32(exposure * RADIANCE_TO_DISPLAY))
        if self._working_size == self._size:
            return shown
        enlarged: DisplayImage = cv2.resize(shown, self._size, interpolation=cv2.INTER_CUBIC)
        return enlarged


def _image_plane(
    size: tuple[int, int], working_size: tuple[int, int], height_deg: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The middles of a picture's working pixels on a plane at distance 1: x (columns,) and y (rows,)."""
    (width, height), (columns, rows) = size, working_size
    top = np.tan(np.radians(height_deg) / 2)
    y = top * (1 - 2 * (np.arange(rows) + 0.5) / rows)
    x = top * width / height * (2 * (np.arange(columns) + 0.5) / columns - 1)
    return x, y


def _disk_kernel(radius: float) -> NDArray[np.float32]:
    """A disc with soft edges, summing to 1; a single 1 for radius 0."""
    reach = int(np.ceil(radius))
    distance = np.hypot(*np.mgrid[-reach : reach + 1, -reach : reach + 1])
    disc = np.maximum(np.clip(radius + 0.5 - distance, 0, 1), distance == 0)
    return np.asarray(disc / disc.sum(), dtype=np.float32)


def _downsample(radiance: LinearImage, rows: float) -> LinearImage:
    """The panorama with no more than about `rows` rows: a finer one would alias in the view."""
    height = min(radiance.shape[0], max(2, round(rows)))
    if height == radiance.shape[0]:
        return radiance
    shrunk: LinearImage = cv2.resize(radiance, (2 * height, height), interpolation=cv2.INTER_AREA)
    return shrunk


def _wrap_columns(radiance: LinearImage) -> LinearImage:
    """The panorama with its last column before the first and its first after the last, to interpolate across."""
    return np.concatenate([radiance[:, -1:], radiance, radiance[:, :1]], axis=1)
