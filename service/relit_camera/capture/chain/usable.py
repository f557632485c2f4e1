"""Which bright frames can be used, where their light came from, and whether that is enough."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.ball.two_balls import LightPosition
from relit_camera.capture.chain.lamp_places import place_lamps
from relit_camera.capture.chain.options import CaptureOptions
from relit_camera.capture.chain.survey import Survey
from relit_camera.capture.light.lamp_distance import LampDistances
from relit_camera.capture.light.place import EYES_CM, Place, place_scene
from relit_camera.errors import CaptureError
from relit_camera.space.directions import texel_directions, texel_solid_angles

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

MIN_DIRECTIONS = 40
SAME_DEG = 1.0
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
class Lamps:
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
    place: Place
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

    def only(self, chosen: Indices) -> Lamps:
        """Those of some of the frames (some,), given by their place in `index`."""
        return replace(self, index=self.index[chosen], lamps_cm=self.lamps_cm[chosen], at_ball=self.at_ball[chosen])


def find_lamps(seen: Survey, options: CaptureOptions) -> Lamps:
    """Where the lamp was in every bright frame that shows it.

    Raises:
        CaptureError: too few frames do, the light comes from one side only, the camera did more than expose, or what
            two balls show is no lamp before the head.
        InputError: the lamp would be nearer to the head than the ball is.
    """
    refuse_enhanced(seen.gains.spread)
    circle = seen.motion.circle
    eyes_px = seen.eyes_px or circle.radius / _FACE_RADIUS_CM * EYES_CM
    radius_cm = None if options.ball_diameter_cm is None else options.ball_diameter_cm / 2
    ball, *second = seen.views
    place = place_scene(ball, (circle.x, circle.y), eyes_px, options.light_distance_cm, radius_cm, *second)
    found = place_lamps(seen, place)
    if not len(found.index):
        raise _too_few(0, len(seen.bright))
    to_ball = found.lamps_cm - found.balls_cm
    lamps_cm = found.lamps_cm - place.head_cm
    lamps = Lamps(
        found.index,
        lamps_cm,
        to_ball / np.linalg.norm(to_ball, axis=1, keepdims=True),
        place,
        found.distances,
        found.located,
        found.unusable,
        known_area(lamps_cm),
    )
    refuse_one_sided(lamps.directions, len(seen.bright))
    return lamps


def known_area(vectors: Floats) -> float:
    """Steradians of the sphere within reach of these directions (count, 3), of any length."""
    directions = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    near = (texel_directions() @ directions.T).max(axis=-1) > np.cos(np.radians(_REACH_DEG))
    return float(texel_solid_angles()[near].sum())


def refuse_enhanced(spread: float) -> None:
    """Nothing, if one gain a channel explains what the camera's automatics did.

    Raises:
        CaptureError: it does not.
    """
    if spread > _ENHANCED:
        raise CaptureError(
            f"the camera changes parts of the picture by themselves, by {spread:.0%} where only the room shows",
            "turn off HDR, night mode, beauty and other enhancements, or film with an app that locks the exposure",
        )


def refuse_one_sided(directions: Floats, bright: int) -> None:
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
    count = distinct(directions)
    if count < MIN_DIRECTIONS:
        raise _too_few(count, bright)
    area = known_area(directions)
    if area < _LEAST_AREA_SR:
        share = area / (2 * np.pi)
        raise CaptureError(
            f"the light covers {share:.0%} of the space before the face",
            "move it farther: from one ear to the other, from below the chin to above the head",
        )


def distinct(directions: Floats) -> int:
    """How many directions (count, 3) there are, those within a degree of one already counted left out."""
    kept: list[Floats] = []
    for direction in directions:
        if not kept or (np.array(kept) @ direction).max() < np.cos(np.radians(SAME_DEG)):
            kept.append(direction)
    return len(kept)


def _too_few(count: int, bright: int) -> CaptureError:
    return CaptureError(
        f"{count} usable directions of light in {bright} bright frames, {MIN_DIRECTIONS} are needed",
        "film half a minute or more, the lamp moving all the time, the ball unhidden and no bright window in it",
    )
