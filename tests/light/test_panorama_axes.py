"""Axes of latitude-longitude pictures: where a direction lies in each, and there and back."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.light.directions import texel_directions
from relit_camera.light.environments.panorama_axes import between_map_and_picture_axes, between_map_and_viewer_axes

HEIGHT, WIDTH = 16, 32


def test_both_ways_are_their_own_inverse() -> None:
    radiance = np.random.default_rng(0).random((HEIGHT, WIDTH, 3), np.float32)
    for way in (between_map_and_picture_axes, between_map_and_viewer_axes):
        assert not np.array_equal(way(radiance), radiance)
        np.testing.assert_array_equal(way(way(radiance)), radiance)


@pytest.mark.parametrize(
    ("way", "middle", "right"),
    [
        (between_map_and_picture_axes, (0, 0, 1), (-1, 0, 0)),
        (between_map_and_viewer_axes, (0, 0, -1), (1, 0, 0)),
    ],
)
def test_what_lies_in_the_middle_and_right_of_it(
    way: Callable[[NDArray[np.float32]], NDArray[np.float32]],
    middle: tuple[float, float, float],
    right: tuple[float, float, float],
) -> None:
    directions = way(texel_directions(HEIGHT, WIDTH).astype(np.float32))
    near = 2.5 * 2 * np.pi / WIDTH
    np.testing.assert_allclose(directions[HEIGHT // 2, WIDTH // 2], middle, atol=near)
    np.testing.assert_allclose(directions[HEIGHT // 2, 3 * WIDTH // 4], right, atol=near)
