"""Performance `meeting`, four seconds: lively talk with far turns, for measuring how a moving face is shown."""

from __future__ import annotations

from relit_camera.base.easing import interpolate_keyframes
from relit_studio.drive.performance import FPS, ActorState, Performance
from relit_studio.drive.performances.face_animation import Keys, Syllables, add, blink, look, speak, swaying
from relit_studio.people.face.expressions import NEUTRAL

FRAMES = 96

_SYLLABLES: Syllables = (
    (0.0, "rest"), (0.25, "rest"), (0.38, "ah"), (0.5, "ee"), (0.62, "oh"), (0.75, "teeth"), (0.9, "ss"), (1.0, "oo"),
    (1.12, "jaw"), (1.25, "jaw"), (1.38, "ff"), (1.5, "ll"), (1.62, "ah"), (1.75, "eh"), (1.88, "teeth"), (2.0, "oh"),
    (2.12, "mm"), (2.25, "ee"), (2.5, "ah"), (2.62, "ss"), (2.75, "oo"), (2.88, "teeth"), (3.0, "teeth"), (3.25, "eh"),
    (3.5, "mm"), (3.75, "rest"), (4.0, "rest"),
)  # fmt: skip
_YAW: Keys = ((0, 0), (0.4, 2), (0.7, -6), (1.0, 4), (1.6, 35), (1.8, 34), (2.9, -35), (3.1, -34), (4, 0))
_PITCH: Keys = ((0, 0), (0.4, 4), (0.8, -4), (1.2, 6), (1.7, -3), (2.2, 8), (2.6, -6), (3.0, 4), (3.5, -2), (4, 0))
_ROLL: Keys = ((0, 0), (0.7, 4), (1.3, -4), (2.0, 5), (2.8, -6), (3.4, 3), (4, 0))
_SMILE: Keys = ((0, 0), (0.6, 0.1), (0.8, 0.5), (1.1, 0), (2.7, 0), (2.95, 0.8), (3.3, 0.3), (3.8, 0), (4, 0))
_BROWS: Keys = ((0, 0), (0.4, 0.2), (0.7, 0.8), (1.1, 0), (2.1, 0), (2.4, 0.7), (2.9, 0), (4, 0))
_LOOK_RIGHT_DEG: Keys = (
    (0, 0),
    (0.45, 0),
    (0.5, 12),
    (0.9, 10),
    (0.95, -10),
    (1.4, -14),
    (2.1, 8),
    (2.9, 12),
    (3.4, 0),
    (4, 0),
)
_LOOK_DOWN_DEG: Keys = ((0, 0), (0.9, 0), (0.95, 6), (1.4, 4), (2.1, -6), (2.6, 0), (4, 0))
_BLINKS_S = (0.25, 1.5, 2.28, 3.5)


def _meet(time_s: float) -> ActorState:
    expression = dict(NEUTRAL)
    speak(expression, _SYLLABLES, time_s)
    smile = interpolate_keyframes(time_s, _SMILE)
    add(expression, {"mouthSmile": 0.5, "cheekSquint": 0.45, "eyeSquint": 0.2, "mouthUpperUp": 0.15}, smile)
    add(expression, {"browInnerUp": 0.5, "browOuterUp": 0.35}, interpolate_keyframes(time_s, _BROWS))
    look(expression, interpolate_keyframes(time_s, _LOOK_RIGHT_DEG), interpolate_keyframes(time_s, _LOOK_DOWN_DEG))
    blink(expression, _BLINKS_S, time_s)
    angles = [interpolate_keyframes(time_s, keys) for keys in (_YAW, _PITCH, _ROLL)]
    return ActorState(swaying(angles, expression, time_s, FRAMES / FPS))


MEETING = Performance("meeting", FRAMES, _meet, "talks with teeth, a dropped jaw and glances, turns to 35 degrees")
