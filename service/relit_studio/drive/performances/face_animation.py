"""Building blocks of performances: speech, gaze, blinks and slight sway."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from relit_camera.base.easing import smoothstep
from relit_camera.base.rotations import Angles
from relit_studio.people.face.expressions import Expression
from relit_studio.people.face.eyes import GAZE_DEG
from relit_studio.people.posture import Posture

Keys = tuple[tuple[float, float], ...]
"""Keyframes (seconds, value) for `base.easing.interpolate_keyframes`."""
Syllables = tuple[tuple[float, str], ...]
"""Keyframes (seconds, name) of the mouth shapes in `VISEMES`."""

VISEMES: dict[str, dict[str, float]] = {
    "rest": {},
    "ah": {"jawOpen": 0.26, "mouthLowerDown": 0.14, "mouthUpperUp": 0.14},
    "eh": {"jawOpen": 0.17, "mouthStretch": 0.18, "mouthUpperUp": 0.16, "mouthLowerDown": 0.12},
    "ee": {"jawOpen": 0.08, "mouthStretch": 0.28, "mouthSmile": 0.14, "mouthUpperUp": 0.16, "mouthLowerDown": 0.18},
    "oh": {"jawOpen": 0.2, "mouthFunnel": 0.34},
    "oo": {"jawOpen": 0.09, "mouthPucker": 0.5, "mouthFunnel": 0.16},
    "ss": {"jawOpen": 0.04, "mouthStretch": 0.14, "mouthUpperUp": 0.18, "mouthLowerDown": 0.22},
    "ll": {"jawOpen": 0.14, "mouthUpperUp": 0.12, "mouthLowerDown": 0.08},
    "ff": {"jawOpen": 0.05, "mouthRollLower": 0.5, "mouthUpperUp": 0.16},
    "mm": {"mouthPress": 0.3, "mouthRollUpper": 0.22, "mouthRollLower": 0.22},
    "teeth": {"jawOpen": 0.03, "mouthStretch": 0.2, "mouthSmile": 0.2, "mouthUpperUp": 0.4, "mouthLowerDown": 0.4},
    "jaw": {"jawOpen": 0.6, "mouthUpperUp": 0.1, "mouthLowerDown": 0.15},
}
"""Mouth shapes as expression weights, bared teeth and a dropped jaw too; a name without a side applies to both."""
_ONE_PIECE = frozenset(
    {"jawOpen", "jawLeft", "jawRight", "mouthFunnel", "mouthPucker", "mouthRollLower", "mouthRollUpper"}
)
_SWAY_HZ_PHASE = ((0.9, 0.3), (0.7, 2.0), (1.1, 4.4))
_SWAY_DEG = (0.5, 0.5, 0.4)


def add(expression: dict[str, float], weights: Expression, fraction: float) -> None:
    """Add a fraction of some weights to an expression; names without a side apply to both sides."""
    for name, weight in weights.items():
        for each in (name,) if name in _ONE_PIECE else (f"{name}_L", f"{name}_R"):
            expression[each] = expression.get(each, 0.0) + fraction * weight


def speak(expression: dict[str, float], syllables: Syllables, time_s: float) -> None:
    """Blend the mouth between the two mouth shapes around the time."""
    times = np.array([time for time, _ in syllables])
    after = int(np.clip(np.searchsorted(times, time_s, side="right"), 1, len(times) - 1))
    fraction = float(smoothstep(time_s, times[after - 1], times[after]))
    before, following = (VISEMES[syllables[index][1]] for index in (after - 1, after))
    add(expression, before, 1 - fraction)
    add(expression, following, fraction)


def look(expression: dict[str, float], right_deg: float, down_deg: float) -> None:
    """Turn both eyes; right is the picture's right, the subject's left."""
    right, down = right_deg / GAZE_DEG, down_deg / GAZE_DEG
    for name, weight in (("Out_L", right), ("In_R", right), ("In_L", -right), ("Out_R", -right)):
        expression[f"eyeLook{name}"] = max(weight, 0.0)
    for side in "LR":
        expression[f"eyeLookDown_{side}"], expression[f"eyeLookUp_{side}"] = max(down, 0.0), max(-down, 0.0)


def blink(expression: dict[str, float], times_s: Sequence[float], time_s: float) -> None:
    """Close the lids around these times; other lid movements fade out meanwhile, or the lids would intersect."""
    shut = max((_lid(time_s, middle) for middle in times_s), default=0.0)
    for side in "LR":
        expression[f"eyeBlink_{side}"] = shut
        # Lids that look down are half shut already.
        for name in ("eyeWide", "eyeSquint", "eyeLookDown", "eyeLookUp"):
            key = f"{name}_{side}"
            expression[key] = expression.get(key, 0.0) * (1 - shut)


def swaying(angles: Sequence[float], expression: Mapping[str, float], time_s: float, end_s: float) -> Posture:
    """Posture at yaw, pitch and roll with a slight sway, which is zero at the beginning and the end."""
    ends = float(np.clip(min(time_s, end_s - time_s) / 0.4, 0, 1))
    sway = [np.sin(2 * np.pi * hertz * time_s + phase) for hertz, phase in _SWAY_HZ_PHASE]
    held = Angles(*(angle + deg * ends * each for angle, deg, each in zip(angles, _SWAY_DEG, sway, strict=True)))
    return Posture(held, {name: round(weight, 4) for name, weight in expression.items()})


def _lid(time_s: float, middle_s: float) -> float:
    """Closure 0..1 of a lid that closes in 80 ms, stays closed briefly, and opens more slowly."""
    offset = time_s - middle_s
    return float(smoothstep(1.3 + offset / 0.085 if offset < 0 else 1.3 - offset / 0.14, 0, 1))
