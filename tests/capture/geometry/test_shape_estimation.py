"""The whole estimate on a ball that another ball shadows, and on what people hand in."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.capture.geometry.shape_estimation import Geometry, estimate_geometry
from tests.capture.geometry.shapes import angles_deg
from tests.synthetic import fibonacci_directions, render_sphere, sphere_surface

SIZE = 48


@pytest.fixture(scope="module")
def estimated() -> Geometry:
    directions = fibonacci_directions(160, 0.1)
    pictures = np.stack([render_sphere(light, SIZE) for light in directions])
    return estimate_geometry(pictures, directions, sphere_surface(SIZE)[1].astype(np.float32))


def test_normals_albedo_and_depth_of_a_ball_in_shadow(estimated: Geometry) -> None:
    truth, inside = sphere_surface(SIZE)
    assert angles_deg(estimated.normals, truth, inside).mean() < 2
    np.testing.assert_allclose(np.median(estimated.albedo[inside], axis=0), 1, rtol=0.02)
    facing = inside & (truth[..., 2] > 0.4)
    error = estimated.depth[facing] - truth[..., 2][facing] * SIZE / 2
    assert (error - error.mean()).std() < 0.5
    assert np.isnan(estimated.depth[~inside]).all()


def test_light_that_was_not_captured_is_known_to_be_hidden(estimated: Geometry) -> None:
    truth, inside = sphere_surface(SIZE)
    directions = fibonacci_directions(90, 0.2)
    cosine = truth[inside] @ directions.T
    lit = np.stack([render_sphere(light, SIZE)[inside][:, 0] for light in directions], axis=1) > 0
    seen = estimated.visible(directions, np.flatnonzero(inside))
    clear = np.abs(cosine) > 0.1
    wrong = (seen != lit)[clear].mean()
    shadows = (~lit & (cosine > 0))[clear].mean()
    assert shadows > 0.03
    # The small ball is not in the picture: what is known of it, the captured shadows told, those near the horizon.
    assert wrong < 0.6 * shadows


def test_grey_pictures_and_a_matte_of_everything() -> None:
    directions = fibonacci_directions(60, 0.3)
    pictures = np.stack([render_sphere(light, 24) for light in directions])
    found = estimate_geometry(pictures, directions, np.ones((24, 24), np.float32))
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=2), 1, atol=1e-5)
    assert np.isfinite(found.depth).all()
    assert np.isfinite(found.albedo).all()
