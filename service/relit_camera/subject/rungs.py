"""The rungs of capture: how a subject was made, and how far it may be trusted for that.

Each rung measures more of the light than the one before, and asks for more of the person's time.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

Rung = Literal["instant", "desk", "film", "pictures"]
"""From a few frames of a webcam, before one's own monitor, from a film of a mirror ball and a lamp, or from pictures
under one light each."""

EXPECTED_DB: dict[Rung, float] = {"instant": 25.5, "desk": 25.4, "film": 33.0}
"""Mean PSNR in dB under environments on people whose truth is known (docs/evaluate.md), one gain a channel;
pictures may be any."""

SOFT_FROM_DEG = 90.0
"""Angle from the camera beyond which instant subjects show light softer than it is (`capture.instant.back_light`)."""

_HOW: dict[Rung, str] = {
    "instant": "from a few frames in the light of the room",
    "desk": "before a monitor that lit the face in patterns",
    "film": "from a film of a mirror ball and a lamp that went around",
    "pictures": "from pictures under one light each",
}


def describe_places(fractions: Mapping[str, float]) -> str:
    """One sentence on how much of each place's light was measured, as a fraction by its name; the rest is modelled."""
    told = [f"{name} {100 * fraction:.0f} %" for name, fraction in fractions.items()]
    return f"measured of the light of {', '.join(told)}; the rest is modelled"


def describe_rung(rung: Rung | None, expected_db: float | None, measured_fraction: float | None) -> str:
    """One sentence for people on how a subject was captured, how right it is, and what of it was measured."""
    if rung is None:
        return "an older version of the program captured it and did not note how"
    told = [f"{rung}: captured {_HOW[rung]}"]
    if expected_db is not None:
        told.append(f"such subjects are right to about {expected_db:.0f} dB in an environment's light")
    if measured_fraction == 0:
        told.append("no direction of light was measured, all are modelled; trust soft light, not a lamp from behind")
    elif measured_fraction is not None:
        told.append(
            f"light was measured from {100 * measured_fraction:.0f} % of all directions and is modelled for the rest"
        )
    return "; ".join(told)
