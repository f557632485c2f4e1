"""Performance `talk`, six seconds: talking to a webcam."""

from __future__ import annotations

from relit_camera.base.easing import interpolate_keyframes
from relit_studio.drive.performance import FPS, ActorState, Performance
from relit_studio.drive.performances.face_animation import Keys, Syllables, add, blink, look, speak, swaying
from relit_studio.people.face.expressions import NEUTRAL

FRAMES = 144

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

_SYLLABLES: Syllables = (
    (0.20, "rest"), (0.32, "ah"), (0.46, "ee"), (0.58, "mm"), (0.70, "oh"), (0.86, "ah"), (0.98, "ss"), (1.10, "eh"),
    (1.22, "ff"), (1.34, "ah"), (1.50, "oo"), (1.66, "mm"), (1.80, "rest"), (2.05, "rest"), (2.18, "eh"), (2.30, "ll"),
    (2.42, "ah"), (2.56, "oo"), (2.68, "ss"), (2.82, "ee"), (2.94, "mm"), (3.06, "ah"), (3.20, "oh"), (3.34, "ll"),
    (3.46, "eh"), (3.58, "ff"), (3.70, "oo"), (3.84, "ah"), (3.98, "mm"), (4.12, "rest"), (4.45, "rest"), (4.58, "ee"),
    (4.70, "ah"), (4.82, "ss"), (4.96, "oh"), (5.10, "mm"), (5.24, "ah"), (5.38, "ee"), (5.54, "rest"), (6.0, "rest"),
)  # fmt: skip
"""Keyframes of mouth shapes, about seven a second as in speech."""


def _talk(time_s: float) -> ActorState:
    expression = dict(NEUTRAL)
    speak(expression, _SYLLABLES, time_s)
    smile = interpolate_keyframes(time_s, _SMILE)
    add(expression, {"mouthSmile": 0.45, "cheekSquint": 0.45, "eyeSquint": 0.2, "mouthUpperUp": 0.1}, smile)
    brows = interpolate_keyframes(time_s, _BROWS)
    add(expression, {"browInnerUp": 0.5, "browOuterUp": 0.35}, brows)
    add(expression, {"browDown": 0.5}, interpolate_keyframes(time_s, _FROWN))
    look(expression, interpolate_keyframes(time_s, _LOOK_RIGHT_DEG), interpolate_keyframes(time_s, _LOOK_DOWN_DEG))
    blink(expression, _BLINKS_S, time_s)
    angles = [interpolate_keyframes(time_s, keys) for keys in (_YAW, _PITCH, _ROLL)]
    return ActorState(swaying(angles, expression, time_s, FRAMES / FPS))


TALK = Performance("talk", FRAMES, _talk, "talks, turns to 27 degrees, blinks and looks about")
