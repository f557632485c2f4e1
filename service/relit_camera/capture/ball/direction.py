"""From the highlight on the ball to the direction of the light, at the ball and at the head."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.ball.view import BallView, PinholeView, Vectors
from relit_camera.errors import CaptureError, InputError


@dataclass(frozen=True, eq=False)
class LightDirection:
    """Unit vectors (3,) toward the light, camera axes.

    Attributes:
        at_ball: from the ball's centre.
        at_head: from the head.
    """

    at_ball: Vectors
    at_head: Vectors


def distant_light(view: BallView, normal: Vectors) -> LightDirection:
    """The direction toward a light that is very far away, the same everywhere.

    With a `DistantView` this is thesis 4.3.4 and Mudge et al. 2006: the normal's angle from the axis, doubled.

    Args:
        view: of the ball.
        normal: (3,) of the ball's surface at the highlight.
    """
    direction = view.mirrored(normal)
    return LightDirection(direction, direction)


class NearLight:
    """Directions toward a light whose distance from the head is about known.

    The light lies on the ray that the ball mirrors at the highlight. Where on it, the distance from the head tells: a
    metre off, it is seen from the ball some ten degrees off the way it is seen from the head.
    """

    def __init__(self, view: PinholeView, radius_cm: float, head_cm: NDArray[np.float64], distance_cm: float) -> None:
        """Place ball, head and light.

        Args:
            view: of the ball.
            radius_cm: of the ball; `radius_at_depth` where only its distance is about known.
            head_cm: (3,) the face's centroid, camera axes: z is negative.
            distance_cm: from there to the light.

        Raises:
            InputError: the light would be no farther from the head than the ball is.
        """
        self._view, self._radius_cm, self._distance_cm = view, radius_cm, distance_cm
        self._head = np.asarray(head_cm, np.float64)
        self.ball_cm: Vectors = view.centre * radius_cm
        """(3,) the ball's centre, camera axes."""
        reach = float(np.linalg.norm(self.ball_cm - self._head)) + radius_cm
        if not distance_cm > reach:
            raise InputError(
                f"the light is said to be {distance_cm:g} cm from the head, the ball is {reach:.0f} cm from it",
                "give the lamp's usual distance from the head, about 100, or correct the ball's size",
            )

    def direction(self, normal: Vectors) -> LightDirection:
        """The directions toward the light whose highlight is where the ball's surface has this normal (3,)."""
        return self._from_position(self.position_cm(normal))

    def position_cm(self, normal: Vectors) -> Vectors:
        """Where (3,) the mirrored ray is at the light's distance from the head, camera axes."""
        ray = self._view.mirrored(normal)
        start = self.ball_cm + self._radius_cm * normal - self._head
        along = float(start @ ray)
        # The start is nearer to the head than the light, so there is one such place, ahead.
        length = -along + np.sqrt(along**2 - start @ start + self._distance_cm**2)
        return np.asarray(self._head + start + length * ray)

    def _from_position(self, light: Vectors) -> LightDirection:
        to_ball, to_head = light - self.ball_cm, light - self._head
        return LightDirection(to_ball / np.linalg.norm(to_ball), to_head / np.linalg.norm(to_head))


def radius_at_depth(view: PinholeView, depth_cm: float) -> float:
    """Radius in centimetres of a ball that is seen so and stands `depth_cm` before the camera, along its axis.

    Raises:
        CaptureError: the depth is not positive.
    """
    if not depth_cm > 0:
        raise CaptureError(f"the ball cannot be {depth_cm:g} cm before the camera", "give a positive distance")
    return float(depth_cm / -view.centre[2])
