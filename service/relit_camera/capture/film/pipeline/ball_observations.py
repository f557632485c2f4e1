"""The mirror balls of a video: which they are, and what each shows through it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from relit_camera.base.errors import CaptureError
from relit_camera.base.images.image_types import LinearImage
from relit_camera.capture.film.ball.ball_detection import DetectedBall, ball_from_outline, detect_balls
from relit_camera.capture.film.ball.ball_tracking import (
    BallEpisode,
    BallObservation,
    BallTracker,
    find_episodes,
    outline_at_frame,
)
from relit_camera.capture.film.ball.frame_highlights import BallCrops
from relit_camera.capture.film.ball.scene_sample import SceneSample
from relit_camera.capture.film.ball.specular_highlight import Highlight, NoHighlight
from relit_camera.capture.film.ball.sphere_projection import BallOutline, PinholeView
from relit_camera.capture.film.focal_length import FocalLength
from relit_camera.capture.film.pipeline.capture_options import CaptureOptions


@dataclass(frozen=True, eq=False)
class ObservedBall:
    """A mirror ball through a video.

    Attributes:
        found: where it mostly is.
        episodes: in which it was hidden or elsewhere.
        highlights: of the bright frames about which the face was found, by index.
    """

    found: DetectedBall
    episodes: list[BallEpisode]
    highlights: Mapping[int, Highlight | NoHighlight]

    def outline(self, index: int) -> BallOutline | None:
        """Where it is in a frame; None while it is hidden."""
        return outline_at_frame(self.episodes, self.found.outline, index)

    def lamp(self, index: int) -> Highlight | NoHighlight:
        """The lamp in it in a bright frame, or why it shows none."""
        return NoHighlight("the ball is hidden") if self.outline(index) is None else self.highlights[index]


class BallRecorder:
    """What a ball shows, frame by frame; see `ObservedBall`."""

    def __init__(self, found: DetectedBall, sample: SceneSample, view: PinholeView) -> None:
        """Follow a ball that was found in this sample and is seen so."""
        self._found, self._view = found, view
        self._film, self._watch = BallCrops(found.outline, sample.size), BallTracker(sample, found.outline)
        self._sightings: list[BallObservation] = []

    def add(self, index: int, frame: LinearImage, *, dark: bool) -> None:
        """Look at a frame, linear RGB (height, width, 3)."""
        self._film.add(index, frame)
        if dark:
            self._sightings.append(self._watch.see(index, frame))

    def seen(self, bright: Iterable[int]) -> ObservedBall:
        """All there was to see, these frames being bright ones."""
        found = find_episodes(self._sightings, self._found.outline.radius)
        return ObservedBall(self._found, found, self._film.highlights(bright, self._view, found))


def find_capture_balls(sample: SceneSample, focal: FocalLength, options: CaptureOptions) -> list[DetectedBall]:
    """The ball, or both where two were promised; those that are not given are found, the clearest first.

    Raises:
        CaptureError: there are fewer, or one is cut off by the picture's edge.
    """
    given = [ball_from_outline(sample, each, focal) for each in (options.ball, options.second_ball) if each is not None]
    count = max(options.balls, len(given))
    if len(given) == count:
        return given
    found = [each for each in detect_balls(sample, focal, count) if all(_apart(each, other) for other in given)]
    balls = [*given, *found][:count]
    if len(balls) < count:
        raise CaptureError(
            f"only one mirror ball was found, at {balls[0].outline.x:.0f}, {balls[0].outline.y:.0f}, not two",
            "film the second on the other side of the head, all of it in the picture and before something plain, or "
            "give its circle, --second-ball X,Y,RADIUS; or leave --balls 2 out",
        )
    return balls


def _apart(one: DetectedBall, other: DetectedBall) -> bool:
    a, b = one.outline, other.outline
    return bool(np.hypot(a.x - b.x, a.y - b.y) > a.radius + b.radius)
