"""Where the lamp was, frame by frame: on the ray that a ball mirrors, as far away as is said or as two balls tell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.ball.direction import NearLight
from relit_camera.capture.ball.highlight import Highlight, NoHighlight
from relit_camera.capture.ball.two_balls import BallHighlight, LightPosition, locate_light
from relit_camera.capture.ball.view import Vectors
from relit_camera.capture.chain.survey import Survey
from relit_camera.capture.light.lamp_distance import LampDistances, follow_distance
from relit_camera.capture.light.place import Place
from relit_camera.errors import CaptureError

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

_APART_DEG, _TIMES_USUAL = 3.0, 4.0
"""Two balls show different things where their rays pass each other by more than this and so many times the usual."""
_MOST_ELSEWHERE = 0.2
"""Share of the frames in which they may do so now and then: a hand, a lamp mirrored twice."""
_BEYOND_BALL = 1.2
"""The lamp is at least so many times as far from the head as a ball is."""

_CURE = (
    "both must be mirror balls of one size: give their circles with --ball and --second-ball, give --focal-px, "
    "or leave --balls 2 out"
)


@dataclass(frozen=True, eq=False)
class LampPlaces:
    """Where the lamp was in the frames that show it.

    Attributes:
        index: (count,) of the frames, growing.
        lamps_cm: (count, 3) camera axes.
        balls_cm: (count, 3) the first ball's centre, camera axes.
        distances: from the head.
        located: where two balls show the lamp, by the frame's index.
        unusable: why other bright frames do not, by index.
    """

    index: Indices
    lamps_cm: Floats
    balls_cm: Floats
    distances: LampDistances
    located: Mapping[int, LightPosition]
    unusable: Mapping[int, str]


def place_lamps(seen: Survey, place: Place) -> LampPlaces:
    """Where the lamp was in every bright frame that shows it.

    Raises:
        CaptureError: what two balls show is no lamp before the head.
        InputError: the lamp would be nearer to the head than the ball is.
    """
    shown, unusable = _shown(seen, place)
    located, elsewhere = _located(shown)
    for index in elsewhere:
        del shown[index]
        unusable[index] = "the two balls show the lamp in different places"
    frames = np.array(list(shown), np.intp)
    distances = _distances(seen, place, frames, located)
    lamps, balls = np.empty((len(frames), 3)), np.empty((len(frames), 3))
    for row, (index, lights) in enumerate(shown.items()):
        lamps[row] = _lamp_cm(lights, place, float(distances.cm[row]))
        first = seen.balls[0]
        balls[row] = place.near_light(first.outline(index) or first.found.outline).ball_cm
    return LampPlaces(frames, lamps, balls, distances, located, unusable)


def _shown(seen: Survey, place: Place) -> tuple[dict[int, list[BallHighlight]], dict[int, str]]:
    """The lamp in the balls that show it, by index of the frame; and why none does."""
    shown: dict[int, list[BallHighlight]] = {}
    unusable: dict[int, str] = {}
    for index in seen.bright.tolist():
        lights = [ball.lamp(index) for ball in seen.balls]
        known = [
            BallHighlight(place.view(outline), place.ball_radius_cm, light.normal)
            for ball, light in zip(seen.balls, lights, strict=True)
            if isinstance(light, Highlight) and (outline := ball.outline(index)) is not None
        ]
        if known:
            shown[index] = known
        else:
            unusable[index] = next(light.reason for light in lights if isinstance(light, NoHighlight))
    return shown, unusable


def _located(shown: Mapping[int, list[BallHighlight]]) -> tuple[dict[int, LightPosition], list[int]]:
    """Where two balls put the lamp, by index of the frames in which both show it; and those in which they do not agree.

    Raises:
        CaptureError: these are most.
    """
    both = {index: locate_light(*lights) for index, lights in shown.items() if len(lights) == 2}
    met = {index: place for index, place in both.items() if place is not None}
    usual = np.median([place.gap_deg for place in met.values()]) if met else 0.0
    near = {index: place for index, place in met.items() if place.gap_deg < max(_APART_DEG, _TIMES_USUAL * usual)}
    elsewhere = [index for index in both if index not in near]
    if len(elsewhere) > _MOST_ELSEWHERE * len(both):
        raise CaptureError(
            f"the two mirror balls show the lamp in different places in {len(elsewhere)} of {len(both)} frames", _CURE
        )
    return near, elsewhere


def _distances(seen: Survey, place: Place, frames: Indices, located: Mapping[int, LightPosition]) -> LampDistances:
    if len(seen.balls) == 1:
        return LampDistances(np.full(len(frames), place.light_distance_cm), np.full(len(frames), np.nan))
    rows = {int(np.searchsorted(frames, index)): each for index, each in located.items()}
    found = follow_distance(seen.flashes.times_s[frames], rows, place.head_cm, place.light_distance_cm)
    reach = max(float(np.linalg.norm(place.ball_radius_cm * view.centre - place.head_cm)) for view in seen.views)
    if len(frames) and found.cm.min() < _BEYOND_BALL * reach:
        raise CaptureError(
            f"two mirror balls put the lamp {found.cm.min():.0f} cm from the head, the farther ball is {reach:.0f} cm "
            "from it",
            _CURE,
        )
    return found


def _lamp_cm(lights: list[BallHighlight], place: Place, distance_cm: float) -> Vectors:
    """Where (3,) the lamp is, so far from the head: the mean of what the balls say, the nearer counting more."""
    ends, weights = [], []
    for light in lights:
        near = NearLight(light.view, light.radius_cm, place.head_cm, distance_cm)
        ends.append(near.position_cm(light.normal))
        weights.append(1 / float(np.sum((ends[-1] - near.ball_cm) ** 2)))
    return np.asarray(np.average(ends, axis=0, weights=weights))
