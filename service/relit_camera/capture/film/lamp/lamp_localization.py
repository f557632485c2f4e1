"""Position of the lamp and direction of its light in every bright frame, from the highlights on one or two balls.

The lamp is on the ray that a ball reflects (`light_from_highlight`), at an assumed or a triangulated distance
(`lamp_distance`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from relit_camera.base.array_types import Float64Array, Indices
from relit_camera.base.errors import CaptureError
from relit_camera.capture.film.ball.ball_tracking import ObservedBall
from relit_camera.capture.film.ball.specular_highlight import Highlight, NoHighlight
from relit_camera.capture.film.ball.sphere_projection import Vectors
from relit_camera.capture.film.lamp.capture_layout import CaptureLayout
from relit_camera.capture.film.lamp.lamp_distance import LampDistances, estimate_lamp_distances
from relit_camera.capture.film.lamp.light_from_highlight import (
    BallHighlight,
    LampTriangulation,
    position_at_distance,
    require_lamp_beyond_ball,
    triangulate_lamp,
)


@dataclass(frozen=True)
class AgreementTunables:
    """When two balls contradict each other; `relit evaluate capture` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        max_gap_deg, max_gap_ratio: a frame's rays contradict where their gap exceeds this angle and this multiple of
            the median gap.
        max_contradicting: fraction of the frames that may do so now and then, by a hand or a lamp mirrored twice.
        min_distance_ratio: least distance of the lamp from the head, over that of the farther ball.
    """

    max_gap_deg: float = 3.0
    max_gap_ratio: float = 4.0
    max_contradicting: float = 0.2
    min_distance_ratio: float = 1.2


_AGREEMENT = AgreementTunables()
_TWO_BALLS_CURE = (
    "both must be mirror balls of one size: give their circles with --ball and --second-ball, give --focal-px, "
    "or leave --balls 2 out"
)


@dataclass(frozen=True, eq=False)
class LampPositions:
    """Where the lamp was in the bright frames in which a ball shows it.

    Attributes:
        index: (count,) of the frames, growing.
        lamps_cm: (count, 3) positions from the head's middle, camera axes.
        at_ball: (count, 3) unit vectors toward the lamp from the center of the first ball.
        distances: from the head.
        triangulated: positions where two balls show the lamp, by the frame's index.
        unusable: reasons why the other bright frames do not show it, by index.
    """

    index: Indices
    lamps_cm: Float64Array
    at_ball: Float64Array
    distances: LampDistances
    triangulated: Mapping[int, LampTriangulation]
    unusable: Mapping[int, str]

    @property
    def measured(self) -> bool:
        """Whether two balls measure the lamp's distance."""
        return bool(self.triangulated)

    @property
    def directions(self) -> Float64Array:
        """Unit vectors (count, 3) toward the lamp from the head's middle."""
        return np.asarray(self.lamps_cm / np.linalg.norm(self.lamps_cm, axis=1, keepdims=True))


def locate_lamps(
    balls: Sequence[ObservedBall],
    bright: Indices,
    times_s: Float64Array,
    layout: CaptureLayout,
    assumed_distance_cm: float,
) -> LampPositions:
    """Find the lamp in every bright frame in which a ball shows it.

    Args:
        balls: one, or two of one size.
        bright: growing indices of the bright frames.
        times_s: (frames,) of all frames of the film.
        layout: positions of head and balls.
        assumed_distance_cm: assumed distance of the lamp from the head; of two balls, a rough guess.

    Raises:
        CaptureError: two balls contradict each other in many frames, or put the lamp no farther than themselves.
        InputError: the lamp would be nearer to the head than the ball is.
    """
    highlights, unusable = _ball_highlights(balls, bright, layout.ball_radius_cm)
    triangulated, contradicting = _triangulate(highlights)
    for index in contradicting:
        del highlights[index]
        unusable[index] = "the two balls show the lamp in different places"
    frames = np.array(list(highlights), np.intp)
    distances = _distances(balls, times_s[frames], frames, triangulated, layout, assumed_distance_cm)
    lamps, to_lamp = np.empty((len(frames), 3)), np.empty((len(frames), 3))
    for row, (index, of_frame) in enumerate(highlights.items()):
        position = _mean_position(of_frame, layout.head_cm, float(distances.cm[row]))
        ball_cm = balls[0].view_at(index).center * layout.ball_radius_cm
        require_lamp_beyond_ball(ball_cm, layout.ball_radius_cm, layout.head_cm, assumed_distance_cm)
        lamps[row], to_lamp[row] = position - layout.head_cm, position - ball_cm
    at_ball = to_lamp / np.linalg.norm(to_lamp, axis=1, keepdims=True)
    return LampPositions(frames, lamps, at_ball, distances, triangulated, unusable)


def _ball_highlights(
    balls: Sequence[ObservedBall], bright: Indices, radius_cm: float
) -> tuple[dict[int, list[BallHighlight]], dict[int, str]]:
    """Highlights by index of the frames in which some ball shows the lamp; and reasons why none does in the others."""
    highlights: dict[int, list[BallHighlight]] = {}
    unusable: dict[int, str] = {}
    for index in bright.tolist():
        found = [ball.highlight(index) for ball in balls]
        usable = [
            BallHighlight(ball.view_at(index), radius_cm, each.normal)
            for ball, each in zip(balls, found, strict=True)
            if isinstance(each, Highlight)
        ]
        if usable:
            highlights[index] = usable
        else:
            unusable[index] = next(each.reason for each in found if isinstance(each, NoHighlight))
    return highlights, unusable


def _triangulate(highlights: Mapping[int, list[BallHighlight]]) -> tuple[dict[int, LampTriangulation], list[int]]:
    """Triangulated positions by index of the frames with two highlights, and the frames whose rays contradict.

    Raises:
        CaptureError: too many contradict.
    """
    both = {index: triangulate_lamp(*pair) for index, pair in highlights.items() if len(pair) == 2}
    met = {index: each for index, each in both.items() if each is not None}
    median_gap_deg = np.median([each.gap_deg for each in met.values()]) if met else 0.0
    max_gap_deg = max(_AGREEMENT.max_gap_deg, _AGREEMENT.max_gap_ratio * median_gap_deg)
    agreeing = {index: each for index, each in met.items() if each.gap_deg < max_gap_deg}
    contradicting = [index for index in both if index not in agreeing]
    if len(contradicting) > _AGREEMENT.max_contradicting * len(both):
        raise CaptureError(
            f"the two mirror balls show the lamp in different places in {len(contradicting)} of {len(both)} frames",
            _TWO_BALLS_CURE,
        )
    return agreeing, contradicting


def _distances(
    balls: Sequence[ObservedBall],
    times_s: Float64Array,
    frames: Indices,
    triangulated: Mapping[int, LampTriangulation],
    layout: CaptureLayout,
    assumed_cm: float,
) -> LampDistances:
    """Distances of the lamp from the head in these frames: assumed with one ball, measured with two.

    Raises:
        CaptureError: two balls put the lamp no farther from the head than the farther of them is.
    """
    if len(balls) == 1:
        return LampDistances(np.full(len(frames), assumed_cm), np.full(len(frames), np.nan))
    rows = {int(np.searchsorted(frames, index)): each for index, each in triangulated.items()}
    distances = estimate_lamp_distances(times_s, rows, layout.head_cm, assumed_cm)
    reach = max(float(np.linalg.norm(layout.ball_radius_cm * ball.view.center - layout.head_cm)) for ball in balls)
    if len(frames) and distances.cm.min() < _AGREEMENT.min_distance_ratio * reach:
        raise CaptureError(
            f"two mirror balls put the lamp {distances.cm.min():.0f} cm from the head, the farther ball is "
            f"{reach:.0f} cm from it",
            _TWO_BALLS_CURE,
        )
    return distances


def _mean_position(highlights: list[BallHighlight], head_cm: Vectors, distance_cm: float) -> Vectors:
    """Position (3,) of the lamp at a distance from the head, camera axes: the balls' mean, the nearer weighing more."""
    positions = [position_at_distance(each, head_cm, distance_cm) for each in highlights]
    weights = [
        1 / float(np.sum((position - each.ball_cm) ** 2)) for position, each in zip(positions, highlights, strict=True)
    ]
    return np.asarray(np.average(positions, axis=0, weights=weights))
