"""Performance `turn`, twelve seconds: slow head turns, as far as trackers must follow."""

from __future__ import annotations

from relit_camera.base.easing import interpolate_keyframes
from relit_studio.drive.performance import FPS, ActorState, Performance
from relit_studio.drive.performances.face_animation import Keys, blink, look, swaying
from relit_studio.people.face.expressions import NEUTRAL

FRAMES = 288
YAW_DEG, PITCH_DEG = 45, 20

_YAW: Keys = (
    (0, 0), (0.5, 0), (2.5, YAW_DEG), (2.8, YAW_DEG), (6.4, -YAW_DEG), (6.7, -YAW_DEG), (8.5, 0), (11.5, 0), (12, 0),
)  # fmt: skip
_PITCH: Keys = ((0, 0), (8.5, 0), (9.5, PITCH_DEG), (9.7, PITCH_DEG), (11.2, -PITCH_DEG), (11.3, -PITCH_DEG), (12, 0))
_BLINKS_S = (1.1, 3.9, 7.5, 10.4)
_EYES_LEAD_DEG = 12
"""Largest angle by which the eyes lead the head."""


def _turn(time_s: float) -> ActorState:
    expression = dict(NEUTRAL)
    yaw, pitch = interpolate_keyframes(time_s, _YAW), interpolate_keyframes(time_s, _PITCH)
    ahead_yaw, ahead_pitch = (interpolate_keyframes(time_s + 0.25, keys) for keys in (_YAW, _PITCH))
    limit = _EYES_LEAD_DEG
    look(expression, min(max(ahead_yaw - yaw, -limit), limit), min(max(ahead_pitch - pitch, -limit), limit))
    blink(expression, _BLINKS_S, time_s)
    return ActorState(swaying((yaw, pitch, 0.0), expression, time_s, FRAMES / FPS))


TURN = Performance("turn", FRAMES, _turn, "turns slowly to 45 degrees at both sides, then nods to 20 down and up")
