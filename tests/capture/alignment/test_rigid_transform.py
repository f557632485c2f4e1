import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.capture.alignment.rigid_transform import (
    RigidTransform,
    fit_rigid_transform,
    fit_rigid_transform_ransac,
    interpolate_transforms,
    transforms_from_array,
    transforms_to_array,
    warp_to_reference,
)
from tests.capture.film.moving_face_film import SIZE, Move, moved, texture

Points = NDArray[np.float64]
TURNED = RigidTransform(3.0, 4.0, -2.5)


def in_complex_plane(transform: RigidTransform, points: Points, size: tuple[int, int]) -> Points:
    """The same transform, worked out another way: turns are products, up is the imaginary axis."""
    center = np.array(size) / 2
    z = (points[:, 0] - center[0]) - 1j * (points[:, 1] - center[1])
    z = z * np.exp(1j * np.radians(transform.rotation_deg)) + transform.x - 1j * transform.y
    return np.stack([z.real + center[0], center[1] - z.imag], axis=1)


def some_points(count: int = 30, seed: int = 0) -> Points:
    return np.random.default_rng(seed).uniform(0, 200, (count, 2))


def test_a_turn_is_about_the_centre_and_counter_clockwise() -> None:
    right_of_centre = np.array([[60.0, 20.0]])
    np.testing.assert_allclose(RigidTransform(90).apply(right_of_centre, (80, 40)), [[40, 0]], atol=1e-12)
    np.testing.assert_allclose(RigidTransform(0, 5, 2).apply(right_of_centre, (80, 40)), [[65, 22]])


def test_points_go_where_the_complex_plane_says() -> None:
    points = some_points()
    np.testing.assert_allclose(TURNED.apply(points, SIZE), in_complex_plane(TURNED, points, SIZE))


def test_back_and_forth() -> None:
    points = some_points()
    there = TURNED.apply(points, SIZE)
    np.testing.assert_allclose(TURNED.inverse().apply(there, SIZE), points)
    other = RigidTransform(-7, 1, 8)
    np.testing.assert_allclose(TURNED.then(other).apply(points, SIZE), other.apply(there, SIZE))


def test_in_a_picture_twice_as_large() -> None:
    points = some_points()
    large = TURNED.scaled(2).apply(2 * points, (2 * SIZE[0], 2 * SIZE[1]))
    np.testing.assert_allclose(large, 2 * TURNED.apply(points, SIZE))


def test_a_fit_finds_the_transform() -> None:
    points = some_points()
    found = fit_rigid_transform(points, TURNED.apply(points, SIZE), SIZE)
    np.testing.assert_allclose(transforms_to_array([found]), transforms_to_array([TURNED]), atol=1e-9)


def test_a_fit_is_the_least_squares_one() -> None:
    points, noise = some_points(), np.random.default_rng(5).normal(0, 2, (30, 2))
    targets = TURNED.apply(points, SIZE) + noise

    def misfit(row: NDArray[np.float64]) -> float:
        return float(np.square(RigidTransform(*row).apply(points, SIZE) - targets).sum())

    best = transforms_to_array([fit_rigid_transform(points, targets, SIZE)])[0]
    for step in np.vstack([np.eye(3), -np.eye(3)]) * 0.01:
        assert misfit(best + step) > misfit(best)


def test_outliers_do_not_count() -> None:
    points = some_points(60)
    targets = TURNED.apply(points, SIZE)
    targets[::4] += np.random.default_rng(6).uniform(8, 30, (15, 2))
    fitted = fit_rigid_transform_ransac(points, targets, SIZE, 1.0)
    assert fitted is not None
    found, inside = fitted
    assert not inside[::4].any()
    np.testing.assert_allclose(transforms_to_array([found]), transforms_to_array([TURNED]), atol=1e-4)
    assert fit_rigid_transform_ransac(points[:3], targets[:3], SIZE, 1.0) is None


def test_a_picture_is_moved_as_points_are() -> None:
    picture = texture()
    expected = moved(picture, Move(TURNED.rotation_deg, TURNED.x, TURNED.y))
    inner = (slice(30, -30), slice(30, -30))
    assert np.abs(warp_to_reference(picture, TURNED) - expected)[inner].max() < 0.02
    assert np.abs(picture - expected)[inner].max() > 0.2
    colour = warp_to_reference(np.repeat(picture[..., None], 3, axis=2), TURNED)
    np.testing.assert_allclose(colour[..., 1], warp_to_reference(picture, TURNED), atol=1e-6)


def test_between_times() -> None:
    known = [RigidTransform(0, 0, 0), RigidTransform(2, 4, -6)]
    found = interpolate_transforms(np.array([1.0, 1.5, 3.0]), np.array([1.0, 3.0]), known)
    np.testing.assert_allclose(transforms_to_array(found), [[0.0, 0.0, 0.0], [0.5, 1.0, -1.5], [2.0, 4.0, -6.0]])
    assert transforms_from_array(transforms_to_array(known)) == known
    assert transforms_to_array([]).shape == (0, 3)
    assert interpolate_transforms(np.array([0.0, 9.0]), np.array([1.0]), known[1:]) == known[1:] * 2


def test_beyond_the_times_known_it_goes_on_as_it_went() -> None:
    known_s = np.arange(1.0, 3.01, 0.1)
    known = [RigidTransform(time, 2 * time, -time) for time in known_s.tolist()]
    found = interpolate_transforms(np.array([0.8, 3.3]), known_s, known)
    np.testing.assert_allclose(transforms_to_array(found), [[0.8, 1.6, -0.8], [3.3, 6.6, -3.3]])


@pytest.mark.parametrize("center", [(100.0, 120.0), (30.0, 200.0)])
def test_about_another_centre(center: tuple[float, float]) -> None:
    from relit_camera.capture.film.face_circle import FaceCircle
    from relit_camera.capture.film.stabilization.face_crops import CropWindow

    window = CropWindow.about(FaceCircle(*center, 20), 1.5, SIZE)
    points = some_points()
    inside = TURNED.apply(points - (window.left, window.top), (window.side, window.side)) + (window.left, window.top)
    np.testing.assert_allclose(window.in_picture(TURNED).apply(points, SIZE), inside)
    np.testing.assert_allclose(
        transforms_to_array([window.in_window(window.in_picture(TURNED))]), transforms_to_array([TURNED])
    )
    picture = texture()
    whole = warp_to_reference(picture, TURNED)
    cut = window.crop(picture, TURNED)
    top, left = max(window.top, 0), max(window.left, 0)
    part = whole[top : window.top + window.side, left : window.left + window.side]
    np.testing.assert_allclose(cut[top - window.top :, left - window.left :], part, atol=0.02)
