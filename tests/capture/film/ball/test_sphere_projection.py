"""Views of a ball against rays traced another way."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.capture.film.ball.sphere_projection import BallOutline, DistantView, PinholeView
from tests.capture.film.ball.mirror_scene import MirrorScene, degrees_between

SCENES = [
    MirrorScene(),
    MirrorScene(center=np.array([-15.0, -4.0, -55.0]), radius_cm=3.0),
    MirrorScene(center=np.array([0.0, 0.0, -40.0])),
]


@pytest.mark.parametrize("scene", SCENES)
def test_the_outline_and_the_focal_length_place_the_ball(scene: MirrorScene) -> None:
    view = PinholeView(BallOutline(*scene.outline()), scene.size, scene.focal_px)
    np.testing.assert_allclose(view.center * scene.radius_cm, scene.center, rtol=2e-3, atol=0.02)


def test_elongation_is_that_of_the_counted_outline() -> None:
    scene = SCENES[1]
    x, y = np.meshgrid(np.arange(20, 180, 0.1), np.arange(60, 220, 0.1))
    hit, _ = scene.hit(scene.rays(x, y))
    axes = np.sqrt(np.linalg.eigvalsh(np.cov(np.stack([x[hit], y[hit]]))))
    view = PinholeView(BallOutline(*scene.outline()), scene.size, scene.focal_px)
    assert view.elongation == pytest.approx(axes[1] / axes[0], abs=2e-3)


@pytest.mark.parametrize("scene", SCENES)
def test_rays_obey_the_law_of_reflection(scene: MirrorScene) -> None:
    view = PinholeView(BallOutline(*scene.outline()), scene.size, scene.focal_px)
    x0, y0, radius = scene.outline()
    for dx, dy in [(0.0, 0.0), (0.6, 0.2), (-0.5, 0.5), (0.1, -0.8)]:
        x, y = np.array(x0 + dx * radius), np.array(y0 + dy * radius)
        normal = view.normals(x, y)
        ray = scene.rays(x, y)
        hit, point = scene.hit(ray)
        assert hit
        assert degrees_between(normal, point - scene.center) < 0.4
        assert degrees_between(view.reflect(normal), scene.mirror(ray, point)) < 0.8
        np.testing.assert_allclose(view.project(normal), (x, y), atol=1e-6)


def test_beside_the_ball_there_is_no_surface() -> None:
    for view in (PinholeView(BallOutline(100, 90, 20), (320, 240), 300), DistantView(BallOutline(100, 90, 20))):
        assert np.isnan(view.normals(np.array([130.0]), np.array([90.0]))).all()


def test_from_afar_the_angle_of_the_normal_doubles() -> None:
    # Thesis 4.3.4: p = atan2(H), q = 2 asin |H|.
    view = DistantView(BallOutline(50, 40, 20))
    across, up = 0.3, -0.4
    direction = view.reflect(view.normals(np.array(50 + 20 * across), np.array(40 - 20 * up)))
    p, q = np.arctan2(up, across), 2 * np.arcsin(np.hypot(across, up))
    np.testing.assert_allclose(direction, [np.cos(p) * np.sin(q), np.sin(p) * np.sin(q), np.cos(q)], atol=1e-12)


def test_a_long_lens_sees_as_from_afar() -> None:
    outline = BallOutline(161, 119, 30)
    pinhole, distant = PinholeView(outline, (320, 240), 1e5), DistantView(outline)
    x, y = np.array([150.0, 175.0]), np.array([130.0, 105.0])
    np.testing.assert_allclose(
        pinhole.reflect(pinhole.normals(x, y)), distant.reflect(distant.normals(x, y)), atol=1e-3
    )
