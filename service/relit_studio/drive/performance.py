"""What the person does in a driving video: six seconds of talk to a webcam."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.space.rotation import Angles
from relit_studio.mannequin.performance import eased_value
from relit_studio.people.expressions import NEUTRAL, Expression
from relit_studio.people.eyes import GAZE_DEG
from relit_studio.people.geometry import smoothstep
from relit_studio.people.posture import Posture

FPS = 24
FRAMES = 144

Keys = tuple[tuple[float, float], ...]
"""(seconds, value): held and eased between."""

_YAW: Keys = ((0, 0), (0.5, 1), (1.0, -6), (1.5, 4), (2.3, 26), (2.8, 24), (3.7, -27), (4.2, -25), (5.1, 3), (6, 0))
_PITCH: Keys = (
    (0, 0), (0.4, 2), (0.8, -3), (1.2, 3), (1.7, -2), (2.3, -4), (2.7, 3), (3.2, 6), (3.7, -2), (4.3, 4), (4.8, 8),
    (5.2, -3), (5.6, 1), (6, 0),
)  # fmt: skip
_ROLL: Keys = ((0, 0), (0.7, 2), (1.3, -3), (2.2, 5), (2.9, 3), (3.7, -6), (4.3, -3), (5.0, 4), (5.6, 0), (6, 0))
_SMILE: Keys = ((0, 0), (1.4, 0.05), (1.9, 0.35), (2.6, 0.1), (4.2, 0), (4.6, 0.55), (5.5, 0.5), (6, 0))
_BROWS: Keys = (
    (0, 0),
    (0.5, 0.1),
    (0.8, 0.6),
    (1.2, 0.1),
    (2.4, 0),
    (2.8, 0.5),
    (3.3, 0),
    (4.4, 0.2),
    (4.7, 0.6),
    (5.3, 0),
    (6, 0),
)
_FROWN: Keys = ((0, 0), (3.2, 0), (3.5, 0.35), (3.9, 0.3), (4.2, 0), (6, 0))
_LOOK_RIGHT_DEG: Keys = (
    (0, 0), (0.95, 0), (1.0, -5), (1.4, -4), (1.47, 2), (1.9, 2), (1.97, 12), (2.3, 0), (2.8, -6), (2.87, -14),
    (3.3, -10), (3.7, 2), (4.4, 8), (4.47, 14), (5.0, 2), (5.07, 0), (6, 0),
)  # fmt: skip
_LOOK_DOWN_DEG: Keys = (
    (0, 0),
    (1.9, 0),
    (1.97, -3),
    (2.5, 2),
    (3.2, 2),
    (3.27, 6),
    (3.6, 0),
    (4.7, -2),
    (5.07, 0),
    (6, 0),
)
_BLINKS_S = (0.62, 1.98, 2.86, 4.42, 5.06)

_SYLLABLES: tuple[tuple[float, str], ...] = (
    (0.20, "rest"), (0.32, "ah"), (0.46, "ee"), (0.58, "mm"), (0.70, "oh"), (0.86, "ah"), (0.98, "ss"), (1.10, "eh"),
    (1.22, "ff"), (1.34, "ah"), (1.50, "oo"), (1.66, "mm"), (1.80, "rest"), (2.05, "rest"), (2.18, "eh"), (2.30, "ll"),
    (2.42, "ah"), (2.56, "oo"), (2.68, "ss"), (2.82, "ee"), (2.94, "mm"), (3.06, "ah"), (3.20, "oh"), (3.34, "ll"),
    (3.46, "eh"), (3.58, "ff"), (3.70, "oo"), (3.84, "ah"), (3.98, "mm"), (4.12, "rest"), (4.45, "rest"), (4.58, "ee"),
    (4.70, "ah"), (4.82, "ss"), (4.96, "oh"), (5.10, "mm"), (5.24, "ah"), (5.38, "ee"), (5.54, "rest"), (6.0, "rest"),
)  # fmt: skip
"""When the mouth reaches which shape: about seven a second, as in speech."""
_VISEMES: dict[str, dict[str, float]] = {
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
}
"""Mouth shapes; a name without a side stands for both."""
_ONE_PIECE = frozenset(
    {"jawOpen", "jawLeft", "jawRight", "mouthFunnel", "mouthPucker", "mouthRollLower", "mouthRollUpper"}
)


def posture_at(time_s: float) -> Posture:
    """The posture at a time of the performance."""
    expression = dict(NEUTRAL)
    for viseme, share in _mouth(time_s):
        _add(expression, viseme, share)
    smile = eased_value(time_s, _SMILE)
    _add(expression, {"mouthSmile": 0.45, "cheekSquint": 0.45, "eyeSquint": 0.2, "mouthUpperUp": 0.1}, smile)
    brows = eased_value(time_s, _BROWS)
    _add(expression, {"browInnerUp": 0.5, "browOuterUp": 0.35}, brows)
    _add(expression, {"browDown": 0.5}, eased_value(time_s, _FROWN))
    _look(expression, eased_value(time_s, _LOOK_RIGHT_DEG), eased_value(time_s, _LOOK_DOWN_DEG))
    _blink(expression, max(_lid(time_s, middle) for middle in _BLINKS_S))
    # Nobody holds still between two movements.
    sway = [np.sin(2 * np.pi * f * time_s + p) for f, p in ((0.9, 0.3), (0.7, 2.0), (1.1, 4.4))]
    yaw, pitch, roll = (eased_value(time_s, keys) for keys in (_YAW, _PITCH, _ROLL))
    ends = float(np.clip(min(time_s, FRAMES / FPS - time_s) / 0.4, 0, 1))
    angles = Angles(yaw + 0.5 * ends * sway[0], pitch + 0.5 * ends * sway[1], roll + 0.4 * ends * sway[2])
    return Posture(angles, {name: round(weight, 4) for name, weight in expression.items()})


def frame_times(frames: int = FRAMES) -> NDArray[np.float64]:
    """Presentation times (frames,) in seconds."""
    return np.arange(frames) / FPS


def _mouth(time_s: float) -> tuple[tuple[dict[str, float], float], tuple[dict[str, float], float]]:
    """The two mouth shapes between which the mouth is, and their shares."""
    times = np.array([time for time, _ in _SYLLABLES])
    after = int(np.clip(np.searchsorted(times, time_s, side="right"), 1, len(times) - 1))
    share = float(smoothstep(time_s, times[after - 1], times[after]))
    before, following = (_VISEMES[_SYLLABLES[index][1]] for index in (after - 1, after))
    return (before, 1 - share), (following, share)


def _add(expression: dict[str, float], weights: Expression, share: float) -> None:
    for name, weight in weights.items():
        for each in (name,) if name in _ONE_PIECE else (f"{name}_L", f"{name}_R"):
            expression[each] = expression.get(each, 0.0) + share * weight


def _look(expression: dict[str, float], right_deg: float, down_deg: float) -> None:
    """Turn both eyes; right is the picture's, toward the subject's left."""
    right, down = right_deg / GAZE_DEG, down_deg / GAZE_DEG
    for name, weight in (("Out_L", right), ("In_R", right), ("In_L", -right), ("Out_R", -right)):
        expression[f"eyeLook{name}"] = max(weight, 0.0)
    for side in "LR":
        expression[f"eyeLookDown_{side}"], expression[f"eyeLookUp_{side}"] = max(down, 0.0), max(-down, 0.0)


def _blink(expression: dict[str, float], shut: float) -> None:
    """Shut the lids; what else moves them gives way, or they would cross."""
    for side in "LR":
        expression[f"eyeBlink_{side}"] = shut
        # Lids that look down are half shut already.
        for name in ("eyeWide", "eyeSquint", "eyeLookDown", "eyeLookUp"):
            key = f"{name}_{side}"
            expression[key] = expression.get(key, 0.0) * (1 - shut)


def _lid(time_s: float, middle_s: float) -> float:
    """A lid that falls in 80 ms, rests shut for a moment, and opens more slowly."""
    offset = time_s - middle_s
    return float(smoothstep(1.3 + offset / 0.085 if offset < 0 else 1.3 - offset / 0.14, 0, 1))
