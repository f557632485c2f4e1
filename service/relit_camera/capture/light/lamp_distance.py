"""How far the lamp was from the head, told by two balls wherever both show it, and by the hand's calm elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.ball.two_balls import LightPosition

Floats = NDArray[np.float64]

_RAY = np.radians(0.6)
"""Error of a ray: rendered films' is about that."""
_UNKNOWN = 0.5
"""What is known of the usual distance beforehand: it is as said, give or take half."""
_HAND, _CALM_S = 0.12, 1.0
"""A hand that goes about somebody comes nearer and goes farther by an eighth, and keeps that for about a second."""
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


def follow_distance(
    times_s: Floats, seen: Mapping[int, LightPosition], head_cm: Floats, usual_cm: float
) -> LampDistances:
    """The distance in each frame, by a Gaussian process over time (Rasmussen and Williams 2006, 2.2).

    What two balls tell is 1 / distance, with errors that do not depend on it; so that is followed.

    Args:
        times_s: (count,) of the frames.
        seen: where two balls show the lamp, by place in `times_s`.
        head_cm: (3,) the head's middle, camera axes.
        usual_cm: what is known beforehand.
    """
    at = np.array(list(seen), np.intp)
    nearness = np.array([usual_cm / np.linalg.norm(each.position_cm - head_cm) for each in seen.values()])
    noise = np.array([np.sqrt(2) * _RAY * usual_cm / each.across_cm for each in seen.values()])
    alike = _UNKNOWN**2 + _HAND**2 * np.exp(-0.5 * ((times_s[:, None] - times_s) / _CALM_S) ** 2)
    weights = np.linalg.solve(alike[np.ix_(at, at)] + np.diag(_ALIKE * noise**2), alike[at]).T
    found = 1 + weights @ (nearness - 1)
    spread = np.sqrt(np.maximum(alike.diagonal() - (weights * alike[:, at]).sum(axis=1), 0))
    # Nothing is farther than ten times the usual: what noise says beyond that is too far for it to matter.
    found = np.maximum(found, 0.1)
    return LampDistances(usual_cm / found, spread / found)
