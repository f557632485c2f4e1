"""The motion of a face in films whose motion is known."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.errors import CaptureError
from relit_camera.capture.alignment import template_alignment
from relit_camera.capture.alignment.rigid_transform import RigidTransform, transforms_to_array
from relit_camera.capture.alignment.template_alignment import align_across_lights, align_to_mean
from relit_camera.capture.film.face_circle import FaceCircle
from relit_camera.capture.film.flash.flash_signal import measure_brightness
from relit_camera.capture.film.flash.frame_classification import Flashes, FrameClass, detect_flashes
from relit_camera.capture.film.stabilization import face_crops
from relit_camera.capture.film.stabilization.corner_tracking import CornerTracker, local_contrast
from relit_camera.capture.film.stabilization.film_stabilization import stabilize_film
from tests.capture.film.moving_face_film import CIRCLE, SIZE, Move, film_moving, moved, shading, texture, wandering


def true_rows(moves: Sequence[Move]) -> np.ndarray:
    """Transforms (count, 3) that undo moves, about the picture's centre."""
    return transforms_to_array([RigidTransform(move.degrees, move.x, move.y).inverse() for move in moves])


def errors(transforms: Sequence[RigidTransform], moves: Sequence[Move]) -> tuple[float, float]:
    """Root mean square of rotation and of shift, the mean taken out: which frame is the reference does not matter."""
    error = transforms_to_array(transforms) - true_rows(moves)
    error -= error.mean(axis=0)
    return float(np.sqrt(np.mean(error[:, 0] ** 2))), float(np.sqrt(np.mean(error[:, 1] ** 2 + error[:, 2] ** 2)))


def disc() -> np.ndarray:
    x, y = np.arange(SIZE[0]) + 0.5, (np.arange(SIZE[1]) + 0.5)[:, None]
    return (np.hypot(x - CIRCLE.x, y - CIRCLE.y) < CIRCLE.radius).astype(np.float32)


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Move]]:
    """120 frames of a face that moves, and how it does."""
    moves = wandering(120)
    return film_moving(tmp_path_factory.mktemp("film") / "clip.mp4", moves), moves


@pytest.fixture(scope="module")
def flashes(video: tuple[Path, list[Move]]) -> Flashes:
    return detect_flashes(measure_brightness(video[0]), CIRCLE)


@pytest.mark.slow
@pytest.mark.parametrize(("refine", "degrees", "pixels"), [(False, 0.12, 0.2), (True, 0.08, 0.12)])
def test_a_face_is_followed_through_a_video(
    video: tuple[Path, list[Move]], flashes: Flashes, refine: bool, degrees: float, pixels: float
) -> None:
    path, moves = video
    looked: list[int] = []
    found = stabilize_film(path, flashes, CIRCLE, refine=refine, progress=looked.append)
    bright = flashes.indices(FrameClass.BRIGHT)
    rotation, shift = errors([found.transforms[index] for index in bright], [moves[index] for index in bright])
    assert rotation < degrees
    assert shift < pixels
    assert np.std([move.x for move in moves]) > 10 * pixels  # it would be seen if nothing were done
    assert len(found.transforms) == 120
    assert not found.lost
    assert looked[-1] > 100


@pytest.mark.slow
def test_the_reference_stays_where_it_is(video: tuple[Path, list[Move]], flashes: Flashes) -> None:
    path, _ = video
    found = stabilize_film(path, flashes, CIRCLE)
    np.testing.assert_allclose(transforms_to_array([found.transforms[found.reference]]), 0, atol=1e-9)
    assert found.reference in found.measured
    assert found.inliers.shape == found.residual_px.shape == found.measured.shape
    assert found.inliers.min() > 10
    assert 0 < found.residual_px.max() < 1
    # All frames are taken to the reference, so the face's circle there is the first frame's, moved.
    first = transforms_to_array([found.transforms[int(found.measured[0])]])[0]
    assert np.hypot(found.circle.x - CIRCLE.x - first[1], found.circle.y - CIRCLE.y - first[2]) < 1.5
    assert np.hypot(*transforms_to_array(found.transforms)[:, 1:].mean(axis=0)) < 4


@pytest.mark.slow
def test_a_face_that_goes_away(tmp_path: Path) -> None:
    moves = [Move(0, max(0, 4 * (index - 40)), 0) for index in range(120)]
    path = film_moving(tmp_path / "clip.mp4", moves)
    with pytest.raises(CaptureError, match=r"in \d+ of \d+ dark frames only; it is first lost at 2\.\d s; sit"):
        stabilize_film(path, detect_flashes(measure_brightness(path)), CIRCLE)


@pytest.mark.slow
def test_frames_of_a_short_absence_are_lost(tmp_path: Path) -> None:
    moves = wandering(180)
    usual, another = texture(), texture(seed=9)
    faces = [another if 90 <= index < 108 else usual for index in range(180)]
    path = film_moving(tmp_path / "clip.mp4", moves, faces)
    flashes = detect_flashes(measure_brightness(path), CIRCLE)
    found = stabilize_film(path, flashes, CIRCLE)
    assert found.lost
    assert all(84 <= index < 114 for index in found.lost)
    kept = [index for index in flashes.indices(FrameClass.BRIGHT) if not 84 <= index < 114]
    rotation, shift = errors([found.transforms[index] for index in kept], [moves[index] for index in kept])
    assert rotation < 0.1
    assert shift < 0.15


@pytest.mark.slow
def test_a_face_without_features(tmp_path: Path) -> None:
    path = film_moving(tmp_path / "clip.mp4", wandering(60), [np.full(SIZE[::-1], 0.5, np.float32)] * 60)
    with pytest.raises(CaptureError, match=r"nothing that can be followed.*make the room .* brighter"):
        stabilize_film(path, detect_flashes(measure_brightness(path)), CIRCLE)


@pytest.mark.slow
def test_large_faces_are_followed_at_a_smaller_size(
    video: tuple[Path, list[Move]], flashes: Flashes, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, moves = video
    monkeypatch.setattr(face_crops, "MAX_RADIUS_PX", 40.0)
    found = stabilize_film(path, flashes, CIRCLE)
    rotation, shift = errors(found.transforms, moves)
    assert rotation < 0.12
    assert shift < 0.25


@pytest.mark.parametrize("from_reference", [True, False])
def test_corners_are_followed(from_reference: bool) -> None:
    face = texture() * np.float32(0.1) + np.float32(0.03)
    moves = [Move(), *wandering(30, seed=4)]
    tracker = CornerTracker(local_contrast(face), CIRCLE, from_reference=from_reference)
    assert tracker.corners > 30
    pictures = [moved(face, move) * np.float32(1 + 0.01 * index) for index, move in enumerate(moves)]
    matches = [tracker.track(local_contrast(picture)) for picture in pictures]
    found = [match for match in matches if match is not None]
    assert len(found) == len(moves)
    assert min(match.inliers for match in found) > 0.5 * tracker.corners
    assert max(match.residual_px for match in found) < 0.5
    rotation, shift = errors([match.transform for match in found], moves)
    assert rotation < 0.05
    assert shift < 0.1
    assert tracker.track(local_contrast(texture(seed=3))) is None  # another face
    assert (
        CornerTracker(np.full((90, 90), 128, np.uint8), FaceCircle(45, 45, 30)).track(np.zeros((90, 90), np.uint8))
        is None
    )


def test_pictures_of_one_light_are_aligned_to_their_mean() -> None:
    face, noise = texture(), np.random.default_rng(2)
    moves = wandering(20, seed=3, pixels=1.5)
    pictures = [
        (moved(face, move) * (1 + 0.1 * np.sin(i)) + noise.normal(0, 0.02, face.shape)).astype(np.float32)
        for i, move in enumerate(moves)
    ]
    found, mean = align_to_mean(pictures, disc(), [RigidTransform()] * 20, rounds=3)
    rotation, shift = errors(found, moves)
    assert rotation < 0.03
    assert shift < 0.03
    assert mean.correlation(pictures[0], found[0]) > 0.9
    assert abs(mean.correlation(texture(seed=8), RigidTransform())) < 0.5


def lights() -> list[tuple[int, int]]:
    return [(azimuth, elevation) for elevation in (-30, 0, 30, 60) for azimuth in range(-60, 61, 20)]


@pytest.mark.slow
def test_pictures_under_different_light_are_aligned_to_predictions() -> None:
    face = texture()
    moves = wandering(28, seed=7, pixels=2.0, degrees=0.6)
    rng = np.random.default_rng(4)
    pictures = np.stack(
        [
            (moved(face, move) * shading(*light) * rng.uniform(0.7, 1.3) + rng.normal(0, 0.003, face.shape)).clip(0)
            for move, light in zip(moves, lights(), strict=True)
        ]
    ).astype(np.float32)
    rounds: list[tuple[int, int]] = []
    found = align_across_lights(pictures, disc(), progress=lambda done, total: rounds.append((done, total)))
    rotation, shift = errors(found, moves)
    assert rotation < 0.15
    assert shift < 0.45
    assert errors([RigidTransform()] * 28, moves)[1] > 0.9
    assert rounds[-1] == (6, 6)


def test_a_picture_is_predicted_from_those_most_like_it_of_other_groups() -> None:
    rng = np.random.default_rng(0)
    coarse = rng.uniform(size=(40, 100)) * rng.uniform(0.5, 2, (40, 1))
    groups = np.arange(40) // 2
    like, weights = template_alignment.predict_from_similar(coarse @ coarse.T, 7, groups)
    cosine = coarse @ coarse[7] / np.linalg.norm(coarse, axis=1) / np.linalg.norm(coarse[7])
    others = [each for each in np.argsort(-cosine) if each not in (6, 7)]
    assert like.tolist() == others[:16]
    # Ridge regression as least squares with more rows.
    ridge = np.sqrt(0.02 * (coarse[like] ** 2).sum() / 16) * np.eye(16)
    wanted = np.linalg.lstsq(np.vstack([coarse[like].T, ridge]), np.append(coarse[7], np.zeros(16)), rcond=None)[0]
    np.testing.assert_allclose(weights, wanted, rtol=1e-6)
