"""Performance `hands`, eight seconds: a drink from a mug, then a hand that passes in front of the face."""

from __future__ import annotations

from relit_camera.base.easing import interpolate_keyframes
from relit_studio.drive.performance import FPS, ActorState, Performance
from relit_studio.drive.performances.face_animation import Keys, Syllables, add, blink, look, speak, swaying
from relit_studio.people.face.expressions import NEUTRAL
from relit_studio.people.props.held_objects import Gesture

FRAMES = 192

_MUG: Keys = ((0, 0), (0.7, 0), (1.7, 1), (3.2, 1), (4.1, 0), (8, 0))
_TILT_DEG: Keys = ((0, 0), (1.4, 6), (2.2, 38), (2.7, 40), (3.1, 10), (3.6, 0), (8, 0))
_HAND: Keys = ((0, 0), (4.7, 0), (5.4, 1), (6.6, 1), (7.3, 0), (8, 0))
_ACROSS_CM: Keys = ((0, 9), (5.2, 9), (6.6, -8), (8, -8))
_YAW: Keys = ((0, 0), (0.6, 7), (1.5, -2), (3.2, -1), (4.4, 8), (5.2, 3), (6.0, -4), (7.0, -9), (8, 0))
_PITCH: Keys = ((0, 0), (0.8, 5), (1.6, 1), (2.3, -9), (2.8, -9), (3.3, 0), (4.2, 4), (5.4, -1), (6.4, 3), (8, 0))
_ROLL: Keys = ((0, 0), (0.6, 3), (1.8, 0), (4.5, -3), (6.0, 4), (7.2, -2), (8, 0))
_SIP: Keys = ((0, 0), (1.5, 0), (1.9, 1), (3.0, 1), (3.4, 0), (8, 0))
_LOOK_DOWN_DEG: Keys = ((0, 0), (0.5, 8), (1.3, 10), (1.8, 4), (3.0, 2), (3.4, 9), (4.0, 3), (4.6, 0), (8, 0))
_BLINKS_S = (0.45, 2.1, 3.5, 5.5, 7.0)
_SYLLABLES: Syllables = (
    (0.0, "rest"), (3.9, "rest"), (4.05, "ah"), (4.2, "mm"), (4.34, "eh"), (4.5, "ss"), (4.64, "oh"), (4.8, "ll"),
    (4.94, "ah"), (5.1, "ff"), (5.24, "ee"), (5.4, "rest"), (6.5, "rest"), (6.64, "ee"), (6.8, "ah"), (6.94, "mm"),
    (7.1, "oh"), (7.24, "ss"), (7.4, "eh"), (7.6, "rest"), (8.0, "rest"),
)  # fmt: skip


def _hands(time_s: float) -> ActorState:
    expression = dict(NEUTRAL)
    speak(expression, _SYLLABLES, time_s)
    add(expression, {"mouthPucker": 0.25, "mouthFunnel": 0.2, "jawOpen": 0.05}, interpolate_keyframes(time_s, _SIP))
    look(expression, 0.0, interpolate_keyframes(time_s, _LOOK_DOWN_DEG))
    blink(expression, _BLINKS_S, time_s)
    angles = [interpolate_keyframes(time_s, keys) for keys in (_YAW, _PITCH, _ROLL)]
    mug, tilt_deg, hand, across_cm = (
        interpolate_keyframes(time_s, keys) for keys in (_MUG, _TILT_DEG, _HAND, _ACROSS_CM)
    )
    gesture = Gesture(mug, tilt_deg, hand, across_cm)
    return ActorState(swaying(angles, expression, time_s, FRAMES / FPS), gesture=gesture)


HANDS = Performance("hands", FRAMES, _hands, "drinks from a mug, then passes a hand before the face")
