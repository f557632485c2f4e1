"""Detection of mirror balls in painted scenes whose truth is known, and in photographs of a real ball."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from relit_camera.base.errors import CaptureError
from relit_camera.base.images.image_files import read_linear
from relit_camera.base.images.image_types import LinearImage
from relit_camera.capture.film.ball.ball_detection import (
    DetectedBall,
    ball_from_outline,
    detect_balls,
    find_balls,
)
from relit_camera.capture.film.ball.frame_sample import sample_frames
from relit_camera.capture.film.ball.specular_highlight import Highlight
from relit_camera.capture.film.ball.sphere_projection import BallOutline, DistantView
from relit_camera.capture.film.focal_length import focal_length_from_option, typical_focal_length
from tests.capture.film.ball.mirror_scene import MirrorScene, hand_path, highlight_in

HEAD = np.array([0.0, -2.0, -58.0])
SCENE = MirrorScene(noise=0.002)
GIVEN = focal_length_from_option(SCENE.focal_px)


def film(scene: MirrorScene, count: int = 5) -> list[LinearImage]:
    """Dark frames and bright ones by turns."""
    lamps = hand_path(count, 100.0, HEAD)
    return [
        scene.photograph(lamp, seed=2 * i + bool(k)) for i, at in enumerate(lamps) for k, lamp in enumerate((None, at))
    ]


def with_decoys(frames: list[LinearImage]) -> list[LinearImage]:
    """A lamp shade, a button, a small wet eye, and a face that the lamp lights, all rounder than the ball."""
    changed = []
    for index, frame in enumerate(frames):
        copy = frame.copy()
        lit = 0.5 if index % 2 else 0.05
        cv2.circle(copy, (120, 170), 45, (lit, 0.7 * lit, 0.5 * lit), -1, cv2.LINE_AA)
        cv2.circle(copy, (150, 155), 4, (0.02, 0.02, 0.02), -1, cv2.LINE_AA)
        if index % 2:
            copy[154, 148 + index % 5] = 1
        cv2.circle(copy, (50, 60), 25, (0.9, 0.9, 0.8), -1, cv2.LINE_AA)
        cv2.circle(copy, (240, 200), 14, (0.3, 0.05, 0.05), -1, cv2.LINE_AA)
        changed.append(copy)
    return changed


def off(found: BallOutline, true: tuple[float, float, float]) -> tuple[float, float]:
    """Errors of centre and radius, in radii."""
    return float(np.hypot(found.x - true[0], found.y - true[1])) / true[2], abs(found.radius / true[2] - 1)


@pytest.fixture(scope="module")
def frames() -> list[LinearImage]:
    return film(SCENE)


@pytest.mark.slow
def test_a_ball_among_other_round_things(frames: list[LinearImage]) -> None:
    (ball,) = find_balls(sample_frames(with_decoys(frames)), GIVEN)
    center, radius = off(ball.outline, SCENE.outline())
    assert center < 0.02
    assert radius < 0.02
    assert ball.highlight_visibility == pytest.approx(0.5)
    assert ball.evidence is not None
    assert ball.evidence > 0.6


@pytest.mark.slow
def test_other_round_things_are_no_balls(frames: list[LinearImage]) -> None:
    plain = np.full_like(frames[0], 0.06)
    with pytest.raises(CaptureError, match="no mirror ball was found") as refusal:
        find_balls(sample_frames(with_decoys([plain] * 10)), GIVEN)
    assert "--ball X,Y,RADIUS" in refusal.value.cure


@pytest.mark.slow
def test_two_balls() -> None:
    left = MirrorScene(center=np.array([-14.0, 5.0, -58.0]), radius_cm=4.0, noise=0.002)
    pairs = zip(film(SCENE), film(left), strict=True)
    half = SCENE.size[0] // 2
    frames = [np.concatenate([b[:, :half], a[:, half:]], axis=1) for a, b in pairs]
    found = detect_balls(sample_frames(frames), GIVEN, 2)
    assert len(found) == 2
    for ball, scene in zip(sorted(found, key=lambda ball: ball.outline.x), (left, SCENE), strict=True):
        assert max(off(ball.outline, scene.outline())) < 0.03


def test_cut_off_by_the_edge() -> None:
    scene = MirrorScene(center=np.array([29.5, 5.0, -60.0]), radius_cm=6.0, noise=0.002)
    with pytest.raises(CaptureError, match="cut off by the picture's right edge"):
        find_balls(sample_frames(film(scene)), GIVEN)


def test_over_exposed(frames: list[LinearImage]) -> None:
    x, y, radius = SCENE.outline()
    white = [frame.copy() for frame in frames]
    for frame in white:
        cv2.circle(frame, (round(x), round(y)), round(radius), (1.0, 1.0, 1.0), -1, cv2.LINE_AA)
    with pytest.raises(CaptureError, match="over-exposed"):
        find_balls(sample_frames(white), GIVEN)


def test_a_given_circle_is_taken_as_it_is(frames: list[LinearImage]) -> None:
    given = BallOutline(*SCENE.outline())
    ball = ball_from_outline(sample_frames(frames), given, GIVEN)
    assert ball.outline == given
    assert ball.highlight_visibility == pytest.approx(0.5)
    with pytest.raises(CaptureError, match="cut off by the picture's top edge"):
        ball_from_outline(sample_frames(frames), BallOutline(100, 3, 20), GIVEN)


@pytest.mark.slow
def test_a_second_ball_that_is_missing_beside_a_given_one_is_refused(frames: list[LinearImage]) -> None:
    given = BallOutline(*SCENE.outline())
    with pytest.raises(
        CaptureError, match=rf"only one mirror ball was found, at {given.x:.0f}, {given.y:.0f}, not two"
    ):
        find_balls(sample_frames(frames), GIVEN, 2, [given])


@pytest.mark.slow
def test_the_outline_corrects_the_focal_length() -> None:
    scene = MirrorScene(size=(320, 400), center=np.array([17.0, 26.0, -60.0]), radius_cm=6.5, noise=0.002)
    guess = typical_focal_length(scene.size)
    assert abs(guess.pixels / scene.focal_px - 1) > 0.2
    (ball,) = find_balls(sample_frames(film(scene)), guess)
    assert abs(ball.focal.pixels / scene.focal_px - 1) < 0.12
    assert ball.focal.error < 0.15
    assert "corrected by the ball's outline" in ball.focal.source


def test_a_sample_is_small_and_always_the_same() -> None:
    def stream() -> Iterator[LinearImage]:
        for index in range(300):
            yield np.full((90, 1600, 3), index / 300, np.float32)

    once, again = sample_frames(stream()), sample_frames(stream())
    assert once.codes.shape == (48, 72, 1280)
    assert once.scale == pytest.approx(0.8)
    np.testing.assert_array_equal(once.codes, again.codes)
    means = once.codes.mean(axis=(1, 2))
    assert (np.diff(means) >= 0).all()
    assert means.min() < 70
    assert means.max() > 240


def test_frames_that_do_not_fit() -> None:
    with pytest.raises(CaptureError, match="no frame"):
        sample_frames([])
    small, large = (np.zeros((height, 80, 3), np.float32) for height in (60, 90))
    with pytest.raises(CaptureError, match="frame 1 is 80x90 instead of 80x60"):
        sample_frames([small, large])


# Photographs: twelve lights, a glint drawn out into a streak, a smaller second highlight, a limb that nearly vanishes.


@pytest.fixture(scope="module")
def photographs(shared: Path) -> list[LinearImage]:
    return [read_linear(path) for path in sorted((shared / "olat/psbox_cat/ball").glob("Image_*.JPG"))]


@pytest.fixture(scope="module")
def published(shared: Path, photographs: list[LinearImage]) -> tuple[float, float, float]:
    """Its circle: pixels count from 1 there, y from the bottom row up."""
    x, y, radius = np.loadtxt(shared / "olat/psbox_cat/ball/circle_data.txt")
    return x - 0.5, photographs[0].shape[0] - y + 0.5, radius


@pytest.fixture(scope="module")
def found(photographs: list[LinearImage]) -> DetectedBall:
    sample = sample_frames(photographs)
    return find_balls(sample, typical_focal_length(sample.size))[0]


@pytest.mark.slow
def test_a_real_ball(found: DetectedBall, published: tuple[float, float, float]) -> None:
    assert max(off(found.outline, published)) < 0.01
    assert found.highlight_visibility == 1


@pytest.mark.slow
def test_real_lights_and_never_the_second_highlight(
    shared: Path, photographs: list[LinearImage], found: DetectedBall, published: tuple[float, float, float]
) -> None:
    lights = np.loadtxt(shared / "olat/psbox_cat/ball/light_directions.txt").T
    for outline in (found.outline, BallOutline(*published)):
        view = DistantView(outline)
        angles = []
        for photograph, light in zip(photographs, lights, strict=True):
            place = highlight_in(photograph, view)
            assert isinstance(place, Highlight)
            assert abs(place.x - published[0]) < 0.3 * published[2]  # the second one is at 0.75 radii
            angles.append(np.degrees(np.arccos(view.reflect(place.normal) @ light / np.linalg.norm(light))))
        assert np.mean(angles) < 1.0
        assert np.max(angles) < 2.0
