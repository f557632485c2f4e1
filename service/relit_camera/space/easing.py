"""How what a person changes is eased over time."""

from __future__ import annotations


def eased_share(elapsed_s: float, transition_s: float) -> float:
    """How much of a change is there, 0..1: fast at first, so that it is seen at once, then settling (cubic).

    A change that is begun anew every few milliseconds, as a slider does, is so followed closely. Before its beginning,
    which is where a file that starts again sets its clock, a change is over.
    """
    if not 0 <= elapsed_s < transition_s:
        return 1.0
    return 1 - (1 - elapsed_s / transition_s) ** 3
