"""Direction and position of the light from its specular highlight on a mirror ball.

A highlight gives the ray that the ball reflects (`BallHighlight.ray`); the lamp lies on it. Where on the ray follows
from the lamp's distance from the head (`position_at_distance`, thesis 4.3.4) or from a second ball's ray
(`triangulate_lamp`, the thesis's future work). The direction of the light is from the head to that position.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relit_camera.base.errors import CaptureError, InputError
from relit_camera.capture.film.ball.sphere_projection import PinholeView, Vectors


@dataclass(frozen=True, eq=False)
class BallHighlight:
    """A highlight on a ball whose size is known.

    Attributes:
        view: the camera's view of the ball.
        radius_cm: radius of the ball.
        normal: (3,) unit normal of the ball's surface at the highlight, camera axes.
    """

    view: PinholeView
    radius_cm: float
    normal: Vectors

    @property
    def ball_cm(self) -> Vectors:
        """Center of the ball (3,), camera axes."""
        return self.view.center * self.radius_cm

    def ray(self) -> tuple[Vectors, Vectors]:
        """Start (3,) in centimeters and direction (3,) of the reflected ray, camera axes."""
        return self.radius_cm * (self.view.center + self.normal), self.view.reflect(self.normal)


def radius_at_depth(view: PinholeView, depth_cm: float) -> float:
    """Radius in centimeters of a ball with this view whose center is `depth_cm` before the camera, along its axis.

    Raises:
        CaptureError: the depth is not positive.
    """
    if not depth_cm > 0:
        raise CaptureError(f"the ball cannot be {depth_cm:g} cm before the camera", "give a positive distance")
    return float(depth_cm / -view.center[2])


def require_lamp_beyond_ball(ball_cm: Vectors, radius_cm: float, head_cm: Vectors, distance_cm: float) -> None:
    """Check that the lamp is farther from the head than the ball is.

    Args:
        ball_cm: (3,) center of the ball, camera axes.
        radius_cm: radius of the ball.
        head_cm: (3,) middle of the face, camera axes.
        distance_cm: from there to the lamp.

    Raises:
        InputError: it is not.
    """
    reach = float(np.linalg.norm(ball_cm - head_cm)) + radius_cm
    if not distance_cm > reach:
        raise InputError(
            f"the light is said to be {distance_cm:g} cm from the head, the ball is {reach:.0f} cm from it",
            "give the lamp's usual distance from the head, about 100, or correct the ball's size",
        )


def position_at_distance(highlight: BallHighlight, head_cm: Vectors, distance_cm: float) -> Vectors:
    """Position (3,) of a lamp at a known distance from the head, camera axes.

    It is where the reflected ray meets the sphere of that radius about the head. A lamp a meter away is seen from the
    ball some ten degrees off the direction in which the head sees it.

    Args:
        highlight: mirror image of the lamp.
        head_cm: (3,) middle of the face, camera axes.
        distance_cm: from there to the lamp.

    Raises:
        InputError: the lamp would be no farther from the head than the ball is.
    """
    ball_cm = highlight.ball_cm
    require_lamp_beyond_ball(ball_cm, highlight.radius_cm, head_cm, distance_cm)
    ray = highlight.view.reflect(highlight.normal)
    start = ball_cm + highlight.radius_cm * highlight.normal - head_cm
    along = float(start @ ray)
    # The ray starts inside the sphere, so it leaves it at exactly one place.
    length = -along + np.sqrt(along**2 - start @ start + distance_cm**2)
    return np.asarray(head_cm + start + length * ray)


@dataclass(frozen=True, eq=False)
class LampTriangulation:
    """A lamp's position from the rays of two balls.

    Attributes:
        position_cm: (3,) camera axes.
        gap_deg: angle that the gap between the rays subtends where they are closest: a measure of their error.
        across_cm: distance of the rays' starts across the mean ray (the baseline). Where both rays are off by an angle
            e, 1 / distance is off by about √2 e / across_cm.
    """

    position_cm: Vectors
    gap_deg: float
    across_cm: float


def triangulate_lamp(first: BallHighlight, second: BallHighlight) -> LampTriangulation | None:
    """Position at which the reflected rays of two balls come closest; None where the rays diverge.

    The position divides the gap in inverse proportion to the squared lengths of the rays, since equal angular errors
    make a shorter ray more accurate.
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
    return LampTriangulation(position, float(np.degrees(gap)), float(np.linalg.norm(np.cross(between, middle))))
