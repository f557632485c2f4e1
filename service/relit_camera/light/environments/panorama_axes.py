"""Axes of latitude-longitude pictures of the light from all sides, and the ways between them.

- map axes: those of light maps and of everything that computes with light (`light.directions`): the middle is the
  direction toward the camera (+Z), +X lies to the right of it.
- picture axes: what cameras and renderers write, as seen from inside the sphere: the same middle, −X to its right.
- viewer axes: as seen by somebody who looks along −Z at the background behind the person: the middle is −Z, +X to its
  right.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

Axes = Literal["picture", "map"]
"""How a panorama file is laid out: in `picture` axes or in `map` axes."""


def between_map_and_picture_axes(radiance: NDArray[np.float32]) -> NDArray[np.float32]:
    """A panorama (height, width, channels) in map axes given one in picture axes, and the other way round: mirrored."""
    return np.ascontiguousarray(radiance[:, ::-1])


def between_map_and_viewer_axes(radiance: NDArray[np.float32]) -> NDArray[np.float32]:
    """A panorama of even width in map axes given one in viewer axes, and back: mirrored and turned by half a circle."""
    return np.ascontiguousarray(np.roll(radiance[:, ::-1], radiance.shape[1] // 2, axis=1))
