"""The lamp's distance from the head over time, from positions that two balls give.

Such positions are noisy, and some frames lack them, so distances are smoothed and interpolated.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from relit_camera.base.array_types import Float64Array
from relit_camera.capture.film.lamp.light_from_highlight import LampTriangulation


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
    times_s: Float64Array, triangulated: Mapping[int, LampTriangulation], head_cm: Float64Array, assumed_cm: float
) -> LampDistances:
    """Distance in each frame, by Gaussian process regression over time (Rasmussen and Williams 2006, 2.2).

    The process models 1 / distance, in which the errors of triangulation do not depend on the distance. The error of a
    ray is taken from the median gap between the two balls' rays.

    Args:
        times_s: (count,) of the frames.
        triangulated: positions by row in `times_s`, where both balls show the lamp.
        head_cm: (3,) middle of the face, camera axes.
        assumed_cm: distance that the user gives, the mean of the prior.
    """
    model = _DISTANCE
    rows, lamps = np.array(list(triangulated), np.intp), list(triangulated.values())
    gap = np.median([each.gap_deg for each in lamps]) if lamps else 0.0
    ray_error = max(model.min_ray_error, model.gap_to_deviation * np.radians(gap))
    nearness = np.array([assumed_cm / np.linalg.norm(each.position_cm - head_cm) for each in lamps])
    noise = np.array([np.sqrt(2) * ray_error * assumed_cm / each.across_cm for each in lamps])
    lag = (times_s[:, None] - times_s) / model.correlation_time_s
    covariance = model.prior_error**2 + model.hand_variation**2 * np.exp(-0.5 * lag**2)
    noisy = covariance[np.ix_(rows, rows)] + np.diag(model.frames_per_error * noise**2)
    weights = np.linalg.solve(noisy, covariance[rows]).T
    found = 1 + weights @ (nearness - 1)
    spread = np.sqrt(np.maximum(covariance.diagonal() - (weights * covariance[:, rows]).sum(axis=1), 0))
    # At most ten times the assumed distance: beyond, it hardly matters, and noise could make it infinite or negative.
    found = np.maximum(found, 0.1)
    return LampDistances(assumed_cm / found, spread / found)
