"""Where head and ball stand before the camera, in centimetres."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import DisplayImage
from relit_camera.capture.film.ball.light_direction import NearLight, radius_at_depth
from relit_camera.capture.film.ball.sphere_projection import BallOutline, PinholeView
from relit_camera.face.tracking.face_detector import FaceDetector

Vector = NDArray[np.float64]

INTERPUPILLARY_DISTANCE_CM = 6.3
"""Between the middles of the eyes: adults have 6.3 cm on average, give or take .36 (Dodgson 2004)."""


@dataclass(frozen=True, eq=False)
class SceneLayout:
    """Head and balls, camera axes.

    Attributes:
        head_cm: (3,) middle of the face's surface.
        pixels_per_cm: at the head's distance.
        ball: how the camera sees the ball, the first if there are two.
        ball_radius_cm: as given, or as it is if the ball is as far from the camera as the head; of two that are of one
            size, if they are so in the mean.
        light_distance_cm: from the lamp to the head, as far as two balls do not tell it.
    """

    head_cm: Vector
    pixels_per_cm: float
    ball: PinholeView
    ball_radius_cm: float
    light_distance_cm: float

    def near_light(self, outline: BallOutline, distance_cm: float | None = None) -> NearLight:
        """The lamp as a ball with this outline tells it: another ball's, or that of one that was pushed.

        Args:
            outline: of the ball.
            distance_cm: from the lamp to the head, where it is not the usual.

        Raises:
            InputError: the lamp would be nearer to the head than the ball is.
        """
        distance_cm = self.light_distance_cm if distance_cm is None else distance_cm
        return NearLight(self.view(outline), self.ball_radius_cm, self.head_cm, distance_cm)

    def view(self, outline: BallOutline) -> PinholeView:
        """How the camera sees a ball with this outline."""
        return self.ball if outline == self.ball.outline else PinholeView(outline, self.ball.size, self.ball.focal_px)


def estimate_scene_layout(
    ball: PinholeView,
    head_px: tuple[float, float],
    eyes_px: float,
    light_distance_cm: float,
    ball_radius_cm: float | None = None,
    second: PinholeView | None = None,
) -> SceneLayout:
    """Place head and balls: the head by the distance of its eyes, a ball by its size, or else beside the head.

    Args:
        ball: how the camera sees it.
        head_px: middle of the face in the picture.
        eyes_px: distance of the eyes' middles.
        light_distance_cm: from the lamp to the head.
        ball_radius_cm: where it is known.
        second: how the camera sees a second ball of the same size.
    """
    pixels_per_cm = eyes_px / INTERPUPILLARY_DISTANCE_CM
    depth_cm = ball.focal_px / pixels_per_cm
    x, y = (head_px[0] - ball.size[0] / 2) / pixels_per_cm, (ball.size[1] / 2 - head_px[1]) / pixels_per_cm
    if ball_radius_cm is None:
        alone = [radius_at_depth(each, depth_cm) for each in (ball, second) if each is not None]
        # The mean of their depths, which go with the size, is then the head's.
        radius_cm = len(alone) / sum(1 / each for each in alone)
    else:
        radius_cm = ball_radius_cm
    return SceneLayout(np.array([x, y, -depth_cm]), pixels_per_cm, ball, radius_cm, light_distance_cm)


def median_eye_distance_px(stills: Iterable[DisplayImage], detector: FaceDetector) -> float | None:
    """Median distance in pixels of the eyes' middles over pictures of one size, None where no face is found."""
    found = (detector.detect(still) for still in stills)
    distances = [float(np.linalg.norm(face.eyes[0] - face.eyes[1])) for face in found if face is not None]
    return float(np.median(distances)) if distances else None
