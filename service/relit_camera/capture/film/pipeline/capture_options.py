"""Options of a capture, and the callback that reports its progress."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from relit_camera.base.images.color import Gamma
from relit_camera.capture.film.ball.sphere_projection import BallOutline
from relit_camera.capture.film.face_circle import FaceCircle

DEFAULT_SIZE = 384
LIGHT_DISTANCE_CM = 100.0

Progress = Callable[[str, int, int | None], None]
"""Called with the name of a stage, how much of it is done, and how much there is, None where that is unknown."""


@dataclass(frozen=True)
class CaptureOptions:
    """How to read a film.

    Attributes:
        gamma: transfer curve of the film.
        size: pixels a side of the subject; fewer where the film shows fewer.
        focal_px: focal length of the camera in pixels of the upright film; None where it is unknown.
        balls: number of mirror balls, 1 or 2; two of one size measure the lamp's distance.
        ball, second_ball: their outlines in those pixels; None where they are to be found.
        face: circle about the face, brow to chin; None where it is to be found.
        ball_diameter_cm: diameter of the balls; None where it is unknown.
        light_distance_cm: assumed distance of the lamp from the head, where two balls do not measure it.
        subtract_room: whether the room's light is subtracted; None for where that leaves less than half of it.
        near_field: whether the lamp's nearness is corrected.
        threads: of the decoder.
    """

    gamma: Gamma = "srgb"
    size: int = DEFAULT_SIZE
    focal_px: float | None = None
    balls: int = 1
    ball: BallOutline | None = None
    second_ball: BallOutline | None = None
    face: FaceCircle | None = None
    ball_diameter_cm: float | None = None
    light_distance_cm: float = LIGHT_DISTANCE_CM
    subtract_room: bool | None = None
    near_field: bool = True
    threads: int = 2


def no_progress(stage: str, done: int, total: int | None) -> None:
    """Report to nobody."""
