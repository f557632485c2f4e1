"""How the flashes' strengths go with the direction they come from.

The person themself does not tell it: strengths that grow with the lamp's height look like normals turned down.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_AIM, _ROUNDS = 0.1, 8
"""A flash counts half whose strength is so far (logarithm) from the trend, and rounds of the fit that weighs them so.
"""


def without_half_the_trend(strength: Floats, lamps_cm: Floats) -> Floats:
    """Strengths (lights,), median 1, with half of what goes with the direction of the lamps (lights, 3) alone.

    A hand may hold the lamp nearer on one side; skin that obeys the law of the cosine only nearly looks the same.
    Either makes a tenth of a difference: half is what to expect of each.
    """
    logs, terms = _logs_and_terms(strength, lamps_cm)
    trend = terms @ np.linalg.lstsq(terms, logs, rcond=None)[0]
    left = logs - (trend - trend.mean()) / 2
    return np.asarray(np.exp(left - np.median(left)))


def with_the_trend_of_distance(strength: Floats, lamps_cm: Floats) -> Floats:
    """Strengths (lights,), median 1, that go with the direction of the lamps (lights, 3) as the inverse square does.

    Where the distances are measured, that is what the hand makes. All the rest of the trend is the skin's, which a hand
    that aims at the face has no part in; flashes at which it did not (by `_AIM`) count little.
    """
    logs, terms = _logs_and_terms(strength, lamps_cm)
    rest = logs + 2 * np.log(np.linalg.norm(lamps_cm, axis=1))
    weights: Floats = np.ones(len(logs))
    trend: Floats = np.zeros(len(logs))
    for _ in range(_ROUNDS):
        root = np.sqrt(weights)
        trend = np.asarray(terms @ np.linalg.lstsq(terms * root[:, None], rest * root, rcond=None)[0])
        weights = np.asarray(1 / (1 + ((rest - trend) / _AIM) ** 2))
    left = logs - trend
    return np.asarray(np.exp(left - np.median(left)))


def _logs_and_terms(strength: Floats, lamps_cm: Floats) -> tuple[Floats, Floats]:
    """Logarithms (lights,) of the strengths, and what is linear in the direction (lights, 4)."""
    directions = lamps_cm / np.linalg.norm(lamps_cm, axis=1, keepdims=True)
    return np.log(np.maximum(strength, 1e-6)), np.concatenate([directions, np.ones((len(directions), 1))], axis=1)
