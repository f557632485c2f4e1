"""From the highlight on the ball to the direction of the light, at the ball and at the head.

Two mirror balls see where the light is, not only its direction (the thesis's future work).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import CaptureError, InputError
from relit_camera.capture.film.ball.sphere_projection import BallView, PinholeView, Vectors


@dataclass(frozen=True, eq=False)
class LightDirection:
    """Unit vectors (3,) toward the light, camera axes.

    Attributes:
        at_ball: from the ball's centre.
        at_head: from the head.
    """

    at_ball: Vectors
    at_head: Vectors


def distant_light_direction(view: BallView, normal: Vectors) -> LightDirection:
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
        self.ball_cm: Vectors = view.center * radius_cm
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
    return float(depth_cm / -view.center[2])


@dataclass(frozen=True, eq=False)
class LightPosition:
    """A light near by.

    Attributes:
        position_cm: (3,) camera axes.
        gap_deg: angle at which the two balls see the gap between the rays where they are closest: how well they agree.
        across_cm: how far apart the rays start, across them: where both are off by an angle e, 1 / distance is off by
            about √2 e / across_cm.
    """

    position_cm: Vectors
    gap_deg: float
    across_cm: float


@dataclass(frozen=True, eq=False)
class BallHighlight:
    """A highlight on a ball whose size is known.

    Attributes:
        view: of the ball.
        radius_cm: of the ball.
        normal: (3,) of its surface at the highlight.
    """

    view: PinholeView
    radius_cm: float
    normal: Vectors

    def ray(self) -> tuple[Vectors, Vectors]:
        """Where the mirrored ray starts, and its direction."""
        return self.radius_cm * (self.view.center + self.normal), self.view.mirrored(self.normal)


def triangulate_light(first: BallHighlight, second: BallHighlight) -> LightPosition | None:
    """Where the rays that two balls mirror come closest; None where they part.

    Between them, nearer to the one that is shorter: rays that are equally sure are surer the nearer.
    """
    (start_a, ray_a), (start_b, ray_b) = first.ray(), second.ray()
    between, cosine = start_b - start_a, float(ray_a @ ray_b)
    under = 1 - cosine**2
    if under < 1e-9:
        return None
    along_a = float(between @ (ray_a - cosine * ray_b)) / under
    along_b = float(between @ (cosine * ray_a - ray_b)) / under
    if along_a <= 0 or along_b <= 0:
        return None
    a, b = start_a + along_a * ray_a, start_b + along_b * ray_b
    position = (a * along_b**2 + b * along_a**2) / (along_a**2 + along_b**2)
    gap = float(np.linalg.norm(a - b)) / float(np.hypot(along_a, along_b))
    middle = (ray_a + ray_b) / np.linalg.norm(ray_a + ray_b)
    return LightPosition(position, float(np.degrees(gap)), float(np.linalg.norm(np.cross(between, middle))))
