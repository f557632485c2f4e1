"""How far the lamp was from the head, told by two balls wherever both show it, and by the hand's calm elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.film.ball.light_direction import LightPosition

Floats = NDArray[np.float64]

_LEAST_RAY = np.radians(0.2)
"""Error of a ray, even where two pass each other more nearly."""
_DEVIATION = 1.48
"""Of the normal distribution, by the median of its values."""
_UNKNOWN = 0.5
"""What is known of the usual distance beforehand: it is as said, give or take half."""
_HAND_VARIATION, _CORRELATION_TIME_S = 0.12, 0.5
"""A hand that goes about somebody comes nearer and goes farther by an eighth, and keeps that for about half a second.
"""
_ALIKE = 5.0
"""A ray's error comes from the ball's outline and changes as slowly: so many successive frames count as one."""


@dataclass(frozen=True, eq=False)
class LampDistances:
    """The lamp's distance from the head in some frames.

    Attributes:
        cm: (count,).
        error: (count,) its relative standard error.
    """

    cm: Floats
    error: Floats


def estimate_lamp_distances(
    times_s: Floats, seen: Mapping[int, LightPosition], head_cm: Floats, usual_cm: float
) -> LampDistances:
    """The distance in each frame, by a Gaussian process over time (Rasmussen and Williams 2006, 2.2).

    What two balls tell is 1 / distance, with errors that do not depend on it; so that is followed. How sure a ray is,
    tells how nearly two pass each other.

    Args:
        times_s: (count,) of the frames.
        seen: where two balls show the lamp, by place in `times_s`.
        head_cm: (3,) the head's middle, camera axes.
        usual_cm: what is known beforehand.
    """
    at, places = np.array(list(seen), np.intp), list(seen.values())
    gap = np.median([each.gap_deg for each in places]) if places else 0.0
    ray = max(_LEAST_RAY, _DEVIATION * np.radians(gap))
    nearness = np.array([usual_cm / np.linalg.norm(each.position_cm - head_cm) for each in places])
    noise = np.array([np.sqrt(2) * ray * usual_cm / each.across_cm for each in places])
    alike = _UNKNOWN**2 + _HAND_VARIATION**2 * np.exp(-0.5 * ((times_s[:, None] - times_s) / _CORRELATION_TIME_S) ** 2)
    weights = np.linalg.solve(alike[np.ix_(at, at)] + np.diag(_ALIKE * noise**2), alike[at]).T
    found = 1 + weights @ (nearness - 1)
    spread = np.sqrt(np.maximum(alike.diagonal() - (weights * alike[:, at]).sum(axis=1), 0))
    # Nothing is farther than ten times the usual: what noise says beyond that is too far for it to matter.
    found = np.maximum(found, 0.1)
    return LampDistances(usual_cm / found, spread / found)
