"""Performance `away`, six seconds: the person leaves the picture sideways and comes back."""

from __future__ import annotations

from relit_camera.base.easing import interpolate_keyframes
from relit_studio.drive.performance import FPS, ActorState, Performance
from relit_studio.drive.performances.face_animation import Keys, Syllables, add, blink, look, speak, swaying
from relit_studio.people.face.expressions import NEUTRAL

FRAMES = 144

_RIGHT_CM: Keys = ((0, 0), (1.1, 0), (2.5, 66), (3.3, 66), (4.8, 0), (6, 0))
_UP_CM: Keys = ((0, 0), (1.1, 0), (1.6, -1.5), (2.5, 4), (3.3, 4), (4.3, -1.5), (4.9, 0), (6, 0))
_YAW: Keys = ((0, 0), (0.6, -4), (1.3, 26), (2.2, 34), (3.4, -30), (4.0, -24), (4.7, -4), (5.3, 3), (6, 0))
_PITCH: Keys = ((0, 0), (0.5, 3), (1.2, -2), (1.7, 6), (2.5, 0), (4.0, 5), (4.8, -3), (5.4, 3), (6, 0))
_ROLL: Keys = ((0, 0), (1.1, 2), (1.8, -7), (2.5, -4), (3.5, 4), (4.1, 7), (4.9, 0), (6, 0))
_LOOK_RIGHT_DEG: Keys = ((0, 0), (0.95, 0), (1.02, 14), (1.5, 6), (3.4, -8), (4.3, 3), (5.0, 0), (6, 0))
_SMILE: Keys = ((0, 0), (4.3, 0), (4.9, 0.7), (5.6, 0.5), (6, 0))
_BLINKS_S = (0.4, 1.2, 4.6, 5.7)
_SYLLABLES: Syllables = (
    (0.0, "rest"), (0.15, "eh"), (0.3, "ss"), (0.44, "ah"), (0.6, "mm"), (0.74, "oh"), (0.9, "ll"), (1.05, "ee"),
    (1.2, "rest"), (4.8, "rest"), (4.95, "ah"), (5.1, "ee"), (5.25, "mm"), (5.4, "oh"), (5.6, "rest"), (6.0, "rest"),
)  # fmt: skip


def _away(time_s: float) -> ActorState:
    expression = dict(NEUTRAL)
    speak(expression, _SYLLABLES, time_s)
    add(expression, {"mouthSmile": 0.4, "cheekSquint": 0.4}, interpolate_keyframes(time_s, _SMILE))
    look(expression, interpolate_keyframes(time_s, _LOOK_RIGHT_DEG), 0.0)
    blink(expression, _BLINKS_S, time_s)
    angles = [interpolate_keyframes(time_s, keys) for keys in (_YAW, _PITCH, _ROLL)]
    shift_cm = (interpolate_keyframes(time_s, _RIGHT_CM), interpolate_keyframes(time_s, _UP_CM), 0.0)
    return ActorState(swaying(angles, expression, time_s, FRAMES / FPS), shift_cm)


AWAY = Performance("away", FRAMES, _away, "leaves the picture sideways and comes back")
