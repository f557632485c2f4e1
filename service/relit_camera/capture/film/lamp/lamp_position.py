"""The lamp's position from its mirror image in one ball (thesis 4.3.4) or in two (the thesis's future work).

A highlight on a mirror ball gives a ray on which the lamp lies. Where on the ray follows from the lamp's distance from
the head (`position_at_distance`) or from a second ball's ray (`triangulate_lamp`). Distances that two balls give are
noisy, and some frames lack them: `estimate_lamp_distances` smooths and interpolates them over time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from relit_camera.base.array_types import Float64Array
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


@dataclass(frozen=True)
class DistanceTunables:
    """How the lamp's distance varies; `relit evaluate capture` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        min_ray_error: standard error of a ray in radians, even where two rays nearly meet.
        gap_to_deviation: standard deviation of a normal distribution over the median of its absolute values.
        prior_error: relative standard error of the distance that the user gives.
        hand_variation: relative standard deviation by which a hand that moves about a person varies the distance.
        correlation_time_s: time for which it keeps a deviation.
        frames_per_error: successive frames that share one ray error, since that comes from the ball's outline; so
            many count as one.
    """

    min_ray_error: float = np.radians(0.2)
    gap_to_deviation: float = 1.48
    prior_error: float = 0.5
    hand_variation: float = 0.12
    correlation_time_s: float = 0.5
    frames_per_error: float = 5.0


_DISTANCE = DistanceTunables()


@dataclass(frozen=True, eq=False)
class LampDistances:
    """The lamp's distance from the head in some frames.

    Attributes:
        cm: (count,).
        error: (count,) its relative standard error; NaN where the distance is assumed, not measured.
    """

    cm: Float64Array
    error: Float64Array


def estimate_lamp_distances(
    times_s: Float64Array, triangulated: Mapping[int, LampTriangulation], head_cm: Float64Array, usual_cm: float
) -> LampDistances:
    """Distance in each frame, by Gaussian process regression over time (Rasmussen and Williams 2006, 2.2).

    The process models 1 / distance, in which the errors of triangulation do not depend on the distance. The error of a
    ray is taken from the median gap between the two balls' rays.

    Args:
        times_s: (count,) of the frames.
        triangulated: positions by row in `times_s`, where both balls show the lamp.
        head_cm: (3,) middle of the face, camera axes.
        usual_cm: distance that the user gives, the mean of the prior.
    """
    model = _DISTANCE
    rows, lamps = np.array(list(triangulated), np.intp), list(triangulated.values())
    gap = np.median([each.gap_deg for each in lamps]) if lamps else 0.0
    ray_error = max(model.min_ray_error, model.gap_to_deviation * np.radians(gap))
    nearness = np.array([usual_cm / np.linalg.norm(each.position_cm - head_cm) for each in lamps])
    noise = np.array([np.sqrt(2) * ray_error * usual_cm / each.across_cm for each in lamps])
    lag = (times_s[:, None] - times_s) / model.correlation_time_s
    covariance = model.prior_error**2 + model.hand_variation**2 * np.exp(-0.5 * lag**2)
    noisy = covariance[np.ix_(rows, rows)] + np.diag(model.frames_per_error * noise**2)
    weights = np.linalg.solve(noisy, covariance[rows]).T
    found = 1 + weights @ (nearness - 1)
    spread = np.sqrt(np.maximum(covariance.diagonal() - (weights * covariance[:, rows]).sum(axis=1), 0))
    # At most ten times the usual distance: beyond, it hardly matters, and noise could make it infinite or negative.
    found = np.maximum(found, 0.1)
    return LampDistances(usual_cm / found, spread / found)
