"""What a person may tell the chain, and what it tells them meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from relit_camera.base.images.color import Gamma
from relit_camera.capture.film.ball.sphere_projection import BallOutline
from relit_camera.capture.film.face_circle import FaceCircle

DEFAULT_SIZE = 384
LIGHT_DISTANCE_CM = 100.0

Progress = Callable[[str, int, int | None], None]
"""Told the stage, how much of it is done, and of how much, where that is known."""


@dataclass(frozen=True)
class CaptureOptions:
    """How to read a capture.

    Attributes:
        gamma: the video's curve.
        size: pixels a side of the subject; fewer where the video shows fewer.
        focal_px: the camera's focal length in pixels of the upright video, where it is known.
        balls: how many mirror balls there are, 1 or 2; two, of one size, tell the lamp's distance.
        ball, second_ball: their outlines in those pixels, where they are known.
        face: its circle, brow to chin, where it is known.
        ball_diameter_cm: its size, where it is known.
        light_distance_cm: from the lamp to the head, as far as two balls do not tell it.
        subtract_room: whether the room's light is taken off; None where it helps.
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
    """Tell nobody."""
