"""Where the lamp was, frame by frame: on the ray that a ball mirrors, as far away as is said or as two balls tell.

Which bright frames can be used, where their light came from, and whether that is enough.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import CaptureError
from relit_camera.capture.film.ball.light_direction import BallHighlight, LightPosition, NearLight, triangulate_light
from relit_camera.capture.film.ball.specular_highlight import Highlight, NoHighlight
from relit_camera.capture.film.ball.sphere_projection import Vectors
from relit_camera.capture.film.lamp.lamp_distance import LampDistances, estimate_lamp_distances
from relit_camera.capture.film.lamp.scene_layout import INTERPUPILLARY_DISTANCE_CM, SceneLayout, estimate_scene_layout
from relit_camera.capture.film.pipeline.capture_options import CaptureOptions
from relit_camera.capture.film.pipeline.film_analysis import FilmAnalysis
from relit_camera.light.directions import texel_directions, texel_solid_angles

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
class LampPositions:
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


def locate_lamps(analysis: FilmAnalysis, place: SceneLayout) -> LampPositions:
    """Where the lamp was in every bright frame that shows it.

    Raises:
        CaptureError: what two balls show is no lamp before the head.
        InputError: the lamp would be nearer to the head than the ball is.
    """
    shown, unusable = _shown(analysis, place)
    located, elsewhere = _located(shown)
    for index in elsewhere:
        del shown[index]
        unusable[index] = "the two balls show the lamp in different places"
    frames = np.array(list(shown), np.intp)
    distances = _distances(analysis, place, frames, located)
    lamps, balls = np.empty((len(frames), 3)), np.empty((len(frames), 3))
    for row, (index, lights) in enumerate(shown.items()):
        lamps[row] = _lamp_cm(lights, place, float(distances.cm[row]))
        first = analysis.balls[0]
        balls[row] = place.near_light(first.outline(index) or first.found.outline).ball_cm
    return LampPositions(frames, lamps, balls, distances, located, unusable)


def _shown(analysis: FilmAnalysis, place: SceneLayout) -> tuple[dict[int, list[BallHighlight]], dict[int, str]]:
    """The lamp in the balls that show it, by index of the frame; and why none does."""
    shown: dict[int, list[BallHighlight]] = {}
    unusable: dict[int, str] = {}
    for index in analysis.bright.tolist():
        lights = [ball.lamp(index) for ball in analysis.balls]
        known = [
            BallHighlight(place.view(outline), place.ball_radius_cm, light.normal)
            for ball, light in zip(analysis.balls, lights, strict=True)
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
    both = {index: triangulate_light(*lights) for index, lights in shown.items() if len(lights) == 2}
    met = {index: place for index, place in both.items() if place is not None}
    usual = np.median([place.gap_deg for place in met.values()]) if met else 0.0
    near = {index: place for index, place in met.items() if place.gap_deg < max(_APART_DEG, _TIMES_USUAL * usual)}
    elsewhere = [index for index in both if index not in near]
    if len(elsewhere) > _MOST_ELSEWHERE * len(both):
        raise CaptureError(
            f"the two mirror balls show the lamp in different places in {len(elsewhere)} of {len(both)} frames", _CURE
        )
    return near, elsewhere


def _distances(
    analysis: FilmAnalysis, place: SceneLayout, frames: Indices, located: Mapping[int, LightPosition]
) -> LampDistances:
    if len(analysis.balls) == 1:
        return LampDistances(np.full(len(frames), place.light_distance_cm), np.full(len(frames), np.nan))
    rows = {int(np.searchsorted(frames, index)): each for index, each in located.items()}
    found = estimate_lamp_distances(analysis.flashes.times_s[frames], rows, place.head_cm, place.light_distance_cm)
    reach = max(float(np.linalg.norm(place.ball_radius_cm * view.center - place.head_cm)) for view in analysis.views)
    if len(frames) and found.cm.min() < _BEYOND_BALL * reach:
        raise CaptureError(
            f"two mirror balls put the lamp {found.cm.min():.0f} cm from the head, the farther ball is {reach:.0f} cm "
            "from it",
            _CURE,
        )
    return found


def _lamp_cm(lights: list[BallHighlight], place: SceneLayout, distance_cm: float) -> Vectors:
    """Where (3,) the lamp is, so far from the head: the mean of what the balls say, the nearer counting more."""
    ends, weights = [], []
    for light in lights:
        near = NearLight(light.view, light.radius_cm, place.head_cm, distance_cm)
        ends.append(near.position_cm(light.normal))
        weights.append(1 / float(np.sum((ends[-1] - near.ball_cm) ** 2)))
    return np.asarray(np.average(ends, axis=0, weights=weights))


MIN_DIRECTIONS = 40
DISTINCT_DEG = 1.0
"""Nearer directions count as one."""

_FACE_RADIUS_CM = 9.5
"""Half of a face, brow to chin, as detectors see it: the scale where nothing finds the eyes."""
_ONE_SIDE_DEG = 20.0
"""Lights that are all within this angle of their middle come from one side only."""
_REACH_DEG, _LEAST_AREA_SR = 12.0, 0.8
"""Light from so near to a direction is known; least area of all that is."""
_ENHANCED = 0.1
"""Spread of the camera's gains within a frame from which it did more than expose and balance."""


@dataclass(frozen=True, eq=False)
class UsableLamps:
    """Where the lamp was in the usable bright frames.

    Attributes:
        index: (count,) of the frames, growing.
        lamps_cm: (count, 3) from the head's middle, camera axes.
        at_ball: (count, 3) unit vectors from the ball's centre.
        place: of head and balls.
        distances: from the head, of all usable frames.
        located: where two balls show the lamp, by the frame's index.
        unusable: why other bright frames cannot be used, by index.
        area_sr: of the directions from which light is known.
    """

    index: Indices
    lamps_cm: Floats
    at_ball: Floats
    place: SceneLayout
    distances: LampDistances
    located: Mapping[int, LightPosition]
    unusable: Mapping[int, str]
    area_sr: float

    @property
    def measured(self) -> bool:
        """Whether two balls tell the lamp's distance."""
        return bool(self.located)

    @property
    def directions(self) -> Floats:
        """Unit vectors (count, 3) from the head's middle."""
        return np.asarray(self.lamps_cm / np.linalg.norm(self.lamps_cm, axis=1, keepdims=True))

    def only(self, chosen: Indices) -> UsableLamps:
        """Those of some of the frames (some,), given by their place in `index`."""
        return replace(self, index=self.index[chosen], lamps_cm=self.lamps_cm[chosen], at_ball=self.at_ball[chosen])


def find_usable_lamps(analysis: FilmAnalysis, options: CaptureOptions) -> UsableLamps:
    """Where the lamp was in every bright frame that shows it.

    Raises:
        CaptureError: too few frames do, the light comes from one side only, the camera did more than expose, or what
            two balls show is no lamp before the head.
        InputError: the lamp would be nearer to the head than the ball is.
    """
    require_uniform_gains(analysis.gains.spread)
    circle = analysis.motion.circle
    eyes_px = analysis.eyes_px or circle.radius / _FACE_RADIUS_CM * INTERPUPILLARY_DISTANCE_CM
    radius_cm = None if options.ball_diameter_cm is None else options.ball_diameter_cm / 2
    ball, *second = analysis.views
    place = estimate_scene_layout(ball, (circle.x, circle.y), eyes_px, options.light_distance_cm, radius_cm, *second)
    found = locate_lamps(analysis, place)
    if not len(found.index):
        raise _too_few(0, len(analysis.bright))
    to_ball = found.lamps_cm - found.balls_cm
    lamps_cm = found.lamps_cm - place.head_cm
    lamps = UsableLamps(
        found.index,
        lamps_cm,
        to_ball / np.linalg.norm(to_ball, axis=1, keepdims=True),
        place,
        found.distances,
        found.located,
        found.unusable,
        covered_solid_angle(lamps_cm),
    )
    require_light_coverage(lamps.directions, len(analysis.bright))
    return lamps


def covered_solid_angle(vectors: Floats) -> float:
    """Steradians of the sphere within reach of these directions (count, 3), of any length."""
    directions = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    near = (texel_directions() @ directions.T).max(axis=-1) > np.cos(np.radians(_REACH_DEG))
    return float(texel_solid_angles()[near].sum())


def require_uniform_gains(spread: float) -> None:
    """Nothing, if one gain a channel explains what the camera's automatics did.

    Raises:
        CaptureError: it does not.
    """
    if spread > _ENHANCED:
        raise CaptureError(
            f"the camera changes parts of the picture by themselves, by {spread:.0%} where only the room shows",
            "turn off HDR, night mode, beauty and other enhancements, or film with an app that locks the exposure",
        )


def require_light_coverage(directions: Floats, bright: int) -> None:
    """Nothing, if light comes from enough directions (count, 3), all round the front.

    Raises:
        CaptureError: it does not.
    """
    if not len(directions):
        raise _too_few(0, bright)
    middle = directions.mean(axis=0)
    middle /= np.linalg.norm(middle)
    away = np.degrees(np.arccos(np.clip(directions @ middle, -1, 1)))
    if np.percentile(away, 95) < _ONE_SIDE_DEG:
        where = "from beside the camera" if middle[2] > np.cos(np.radians(30)) else "from one side"
        raise CaptureError(
            f"the light comes only {where}: nine in ten flashes are within {np.percentile(away, 90):.0f} degrees",
            "do not use the phone's own lamp: move another around the head, a metre off, left to right and up and down",
        )
    count = count_distinct_directions(directions)
    if count < MIN_DIRECTIONS:
        raise _too_few(count, bright)
    area = covered_solid_angle(directions)
    if area < _LEAST_AREA_SR:
        share = area / (2 * np.pi)
        raise CaptureError(
            f"the light covers {share:.0%} of the space before the face",
            "move it farther: from one ear to the other, from below the chin to above the head",
        )


def count_distinct_directions(directions: Floats) -> int:
    """How many directions (count, 3) there are, those within a degree of one already counted left out."""
    kept: list[Floats] = []
    for direction in directions:
        if not kept or (np.array(kept) @ direction).max() < np.cos(np.radians(DISTINCT_DEG)):
            kept.append(direction)
    return len(kept)


def _too_few(count: int, bright: int) -> CaptureError:
    return CaptureError(
        f"{count} usable directions of light in {bright} bright frames, {MIN_DIRECTIONS} are needed",
        "film half a minute or more, the lamp moving all the time, the ball unhidden and no bright window in it",
    )
