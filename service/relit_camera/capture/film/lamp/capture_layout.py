"""Where the head stands before the camera and how large the balls are, in centimeters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.film.ball.sphere_projection import PinholeView
from relit_camera.capture.film.lamp.light_from_highlight import radius_at_depth

INTERPUPILLARY_DISTANCE_CM = 6.3
"""Mean distance of adults' pupils, with a standard deviation of 0.36 cm (Dodgson 2004)."""
_FACE_RADIUS_CM = 9.5
"""Half the height of a face, brow to chin, as detectors box it: the scale where the eyes are not found."""


@dataclass(frozen=True, eq=False)
class CaptureLayout:
    """Head and balls, camera axes.

    Attributes:
        head_cm: (3,) middle of the face's surface.
        pixels_per_cm: scale of the picture at the head's distance.
        ball_radius_cm: radius of the balls.
    """

    head_cm: NDArray[np.float64]
    pixels_per_cm: float
    ball_radius_cm: float


def eye_distance_from_face(face_radius_px: float) -> float:
    """Distance of the eyes in pixels, guessed from the radius of the face's circle."""
    return face_radius_px / _FACE_RADIUS_CM * INTERPUPILLARY_DISTANCE_CM


def estimate_capture_layout(
    balls: Sequence[PinholeView],
    head_px: tuple[float, float],
    eyes_px: float,
    ball_radius_cm: float | None = None,
) -> CaptureLayout:
    """Place the head by the distance of its eyes, and find the balls' size unless it is known.

    A ball of unknown size is taken to be as far from the camera as the head; two of one size, to be so on average.

    Args:
        balls: the camera's views of one ball, or of two that are of one size.
        head_px: middle of the face in the picture.
        eyes_px: distance of the pupils.
        ball_radius_cm: radius of the balls, where it is known.
    """
    view = balls[0]
    pixels_per_cm = eyes_px / INTERPUPILLARY_DISTANCE_CM
    depth_cm = view.focal_px / pixels_per_cm
    x, y = (head_px[0] - view.size[0] / 2) / pixels_per_cm, (view.size[1] / 2 - head_px[1]) / pixels_per_cm
    if ball_radius_cm is None:
        radii = [radius_at_depth(each, depth_cm) for each in balls]
        # A ball's depth is proportional to its size: this is the size that makes the mean depth the head's.
        radius_cm = len(radii) / sum(1 / each for each in radii)
    else:
        radius_cm = ball_radius_cm
    return CaptureLayout(np.array([x, y, -depth_cm]), pixels_per_cm, radius_cm)
