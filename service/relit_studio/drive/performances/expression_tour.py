"""Performance `expressions`, twelve seconds: what a person is asked to show for expression stills."""

from __future__ import annotations

from relit_camera.base.easing import interpolate_keyframes
from relit_studio.drive.performance import FPS, ActorState, Performance
from relit_studio.drive.performances.face_animation import Keys, Syllables, add, blink, look, speak, swaying
from relit_studio.people.face.expressions import NEUTRAL

FRAMES = 288

_SYLLABLES: Syllables = (
    (0.0, "rest"), (0.6, "rest"), (0.75, "eh"), (0.9, "mm"), (1.05, "ah"), (1.2, "ss"), (1.4, "oh"), (1.6, "ff"),
    (1.8, "ee"), (2.0, "rest"), (2.3, "rest"), (2.5, "teeth"), (3.0, "teeth"), (3.3, "oo"), (3.6, "oo"),
    (3.9, "jaw"), (4.3, "jaw"), (4.6, "rest"), (8.2, "rest"), (8.4, "ah"), (8.6, "ee"), (8.8, "mm"), (9.0, "rest"),
    (12.0, "rest"),
)  # fmt: skip
_SMILE: Keys = (
    (0, 0),
    (2.1, 0),
    (2.45, 0.4),
    (2.8, 1),
    (3.05, 1),
    (3.3, 0),
    (10.6, 0),
    (11.0, 0.7),
    (11.6, 0),
    (12, 0),
)
_YAW: Keys = (
    (0, 0), (6.4, 0), (6.9, 15), (7.1, 15), (7.5, 31), (7.8, 31), (8.4, 15), (8.6, 12), (9.0, -15), (9.2, -15),
    (9.6, -31), (9.9, -31), (10.4, 0), (12, 0),
)  # fmt: skip
_PITCH: Keys = ((0, 0), (10.4, 0), (10.8, 14), (11.0, 14), (11.5, -14), (11.7, -14), (12, 0))
_LOOK_RIGHT_DEG: Keys = ((0, 0), (5.2, 0), (5.3, 16), (5.5, 16), (5.6, -16), (5.8, -16), (5.9, 0), (12, 0))
_LOOK_DOWN_DEG: Keys = ((0, 0), (5.9, 0), (6.0, 12), (6.15, 12), (6.25, -12), (6.4, -12), (6.5, 0), (12, 0))
_BLINKS_S = (0.4, 2.2, 4.8, 4.95, 5.1, 7.3, 9.4, 10.5)
"""Three in a row: eyes that stay shut."""


def _show(time_s: float) -> ActorState:
    expression = dict(NEUTRAL)
    speak(expression, _SYLLABLES, time_s)
    smile = interpolate_keyframes(time_s, _SMILE)
    add(expression, {"mouthSmile": 0.5, "cheekSquint": 0.45, "eyeSquint": 0.2, "mouthUpperUp": 0.2}, smile)
    look(expression, interpolate_keyframes(time_s, _LOOK_RIGHT_DEG), interpolate_keyframes(time_s, _LOOK_DOWN_DEG))
    blink(expression, _BLINKS_S, time_s)
    angles = (interpolate_keyframes(time_s, _YAW), interpolate_keyframes(time_s, _PITCH), 0.0)
    return ActorState(swaying(angles, expression, time_s, FRAMES / FPS))


EXPRESSIONS_SHOWN = Performance(
    "expressions", FRAMES, _show, "talks, shows teeth, 'oo', a dropped jaw, shut eyes, glances and turns to 31 degrees"
)
