"""A ball that is covered or moved, in a film made for it."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.images.image_types import LinearImage
from relit_camera.capture.film.ball.ball_tracking import (
    BallEpisode,
    BallObservation,
    BallTracker,
    find_episodes,
    outline_at_frame,
)
from relit_camera.capture.film.ball.frame_sample import sample_frames
from relit_camera.capture.film.ball.sphere_projection import BallOutline
from tests.capture.film.ball.mirror_scene import MirrorScene, hand_path

SCENE = MirrorScene(noise=0.004)
OUTLINE = BallOutline(*SCENE.outline())
SHIFT_CM = np.array([0.5, -0.3, 0.0])


@pytest.fixture(scope="module")
def frames() -> list[LinearImage]:
    """Twelve as found, lit or not, four with a hand before the ball, six with the ball pushed aside."""
    lamps = hand_path(11, 100.0, np.array([0.0, -2.0, -58.0]))
    whole = [SCENE.photograph(lamps[i // 2] if i % 2 else None, seed=i) for i in range(12)]
    covered = [SCENE.photograph(seed=20 + i) for i in range(4)]
    x, y, radius = (round(value) for value in SCENE.outline())
    for frame in covered:
        frame[y - radius : y + 2 * radius, x - radius - 3 : x + radius // 2] = (0.3, 0.2, 0.15)
    pushed = MirrorScene(center=SCENE.center + SHIFT_CM, noise=0.004)
    return whole + covered + [pushed.photograph(lamps[i // 2 + 5] if i % 2 else None, seed=40 + i) for i in range(6)]


@pytest.mark.slow
def test_hidden_and_moved_frames_are_episodes(frames: list[LinearImage]) -> None:
    tracker = BallTracker(sample_frames(frames), OUTLINE)
    found = find_episodes([tracker.observe(index, frame) for index, frame in enumerate(frames)], OUTLINE.radius)
    assert [(episode.kind, episode.first, episode.last) for episode in found] == [("hidden", 12, 15), ("moved", 16, 21)]
    scale = SCENE.focal_px / -SCENE.center[2]
    assert found[1].dx == pytest.approx(SHIFT_CM[0] * scale, abs=0.3)
    assert found[1].dy == pytest.approx(-SHIFT_CM[1] * scale, abs=0.3)


@pytest.mark.slow
def test_a_ball_that_stays_has_no_episodes(frames: list[LinearImage]) -> None:
    tracker = BallTracker(sample_frames(frames[:12]), OUTLINE)
    observations = [tracker.observe(index, frame) for index, frame in enumerate(frames[:12])]
    assert find_episodes(observations, OUTLINE.radius) == []
    assert max(np.hypot(each.dx, each.dy) for each in observations) < 0.4


def test_the_outline_in_a_frame() -> None:
    found = [BallEpisode("hidden", 3, 5, 0, 0), BallEpisode("moved", 8, 12, 4, -2)]
    assert outline_at_frame(found, OUTLINE, 2) == OUTLINE
    assert outline_at_frame(found, OUTLINE, 4) is None
    assert outline_at_frame(found, OUTLINE, 8) == BallOutline(OUTLINE.x + 4, OUTLINE.y - 2, OUTLINE.radius)


def test_a_single_deviating_frame_is_no_episode() -> None:
    still = [BallObservation(index, 0.0, 0.0, 0.95) for index in range(9)]
    still[4] = BallObservation(4, 3.0, 0.0, 0.9)
    assert find_episodes(still, 30.0) == []
    assert find_episodes([], 30.0) == []
