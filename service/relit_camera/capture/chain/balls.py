"""The mirror balls of a video: which they are, and what each shows through it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from relit_camera.capture.ball.find import FoundBall, find_balls, given_ball
from relit_camera.capture.ball.focal import Focal
from relit_camera.capture.ball.highlight import Highlight, NoHighlight
from relit_camera.capture.ball.outline import Outline
from relit_camera.capture.ball.sample import SceneSample
from relit_camera.capture.ball.view import PinholeView
from relit_camera.capture.ball.watch import BallWatch, Episode, Sighting, episodes, outline_in
from relit_camera.capture.chain.options import CaptureOptions
from relit_camera.capture.light.highlights import BallFilm
from relit_camera.errors import CaptureError
from relit_camera.space.images import LinearImage


@dataclass(frozen=True, eq=False)
class SeenBall:
    """A mirror ball through a video.

    Attributes:
        found: where it mostly is.
        episodes: in which it was hidden or elsewhere.
        highlights: of the bright frames about which the face was found, by index.
    """

    found: FoundBall
    episodes: list[Episode]
    highlights: Mapping[int, Highlight | NoHighlight]

    def outline(self, index: int) -> Outline | None:
        """Where it is in a frame; None while it is hidden."""
        return outline_in(self.episodes, self.found.outline, index)

    def lamp(self, index: int) -> Highlight | NoHighlight:
        """The lamp in it in a bright frame, or why it shows none."""
        return NoHighlight("the ball is hidden") if self.outline(index) is None else self.highlights[index]


class BallLog:
    """What a ball shows, frame by frame; see `SeenBall`."""

    def __init__(self, found: FoundBall, sample: SceneSample, view: PinholeView) -> None:
        """Follow a ball that was found in this sample and is seen so."""
        self._found, self._view = found, view
        self._film, self._watch = BallFilm(found.outline, sample.size), BallWatch(sample, found.outline)
        self._sightings: list[Sighting] = []

    def add(self, index: int, frame: LinearImage, *, dark: bool) -> None:
        """Look at a frame, linear RGB (height, width, 3)."""
        self._film.add(index, frame)
        if dark:
            self._sightings.append(self._watch.see(index, frame))

    def seen(self, bright: Iterable[int]) -> SeenBall:
        """All there was to see, these frames being bright ones."""
        found = episodes(self._sightings, self._found.outline.radius)
        return SeenBall(self._found, found, self._film.highlights(bright, self._view, found))


def find_all(sample: SceneSample, focal: Focal, options: CaptureOptions) -> list[FoundBall]:
    """The ball, or both where two were promised; those that are not given are found, the clearest first.

    Raises:
        CaptureError: there are fewer, or one is cut off by the picture's edge.
    """
    given = [given_ball(sample, each, focal) for each in (options.ball, options.second_ball) if each is not None]
    count = max(options.balls, len(given))
    if len(given) == count:
        return given
    found = [each for each in find_balls(sample, focal, count) if all(_apart(each, other) for other in given)]
    balls = [*given, *found][:count]
    if len(balls) < count:
        raise CaptureError(
            f"only one mirror ball was found, at {balls[0].outline.x:.0f}, {balls[0].outline.y:.0f}, not two",
            "film the second on the other side of the head, all of it in the picture and before something plain, or "
            "give its circle, --second-ball X,Y,RADIUS; or leave --balls 2 out",
        )
    return balls


def _apart(one: FoundBall, other: FoundBall) -> bool:
    a, b = one.outline, other.outline
    return bool(np.hypot(a.x - b.x, a.y - b.y) > a.radius + b.radius)
