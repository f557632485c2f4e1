"""Performance of the mannequin in its driving clip."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.easing import interpolate_keyframes
from relit_camera.base.rotations import Angles
from relit_studio.mannequin.shape.expression import Expression
from relit_studio.mannequin.shape.figure import Posture

FPS = 24
FRAMES = 96


def posture_at(time_s: float) -> Posture:
    """The posture at a time of the clip: it talks, turns to both sides, nods, tilts, smiles, blinks and looks about."""
    turn = interpolate_keyframes(
        time_s, [(0, 0), (0.35, 0), (1.05, 25), (1.3, 25), (2.2, -25), (2.45, -25), (3.2, 0), (4, 0)]
    )
    nod = interpolate_keyframes(
        time_s, [(0, 0), (0.3, 2), (0.9, -6), (1.6, 5), (2.2, -3), (2.9, 12), (3.35, -7), (3.8, 0), (4, 0)]
    )
    tilt = interpolate_keyframes(
        time_s, [(0, 0), (0.5, 0), (1.1, 5), (1.75, -4), (2.4, -9), (3.1, 9), (3.7, 0), (4, 0)]
    )
    smile = interpolate_keyframes(time_s, [(0, 0), (0.2, 0.1), (2.2, 0.1), (2.7, 0.9), (3.4, 1), (3.9, 0.3), (4, 0.25)])
    brows = interpolate_keyframes(
        time_s, [(0, 0), (0.5, 0), (0.75, 0.8), (1.2, 0.1), (2.3, 0), (2.6, 0.6), (3.2, 0.2), (4, 0)]
    )
    speaking = interpolate_keyframes(
        time_s, [(0, 0), (0.25, 0), (0.4, 1), (2.2, 1), (2.45, 0), (3.1, 0), (3.2, 0.8), (3.6, 0), (4, 0)]
    )
    # Syllables at about five a second, never twice alike.
    syllables = np.sin(2 * np.pi * 2.55 * time_s) ** 2 * (0.62 + 0.38 * np.sin(2 * np.pi * 1.3 * time_s + 0.6))
    look = interpolate_keyframes(
        time_s, [(0, 0), (0.3, 0), (0.42, 14), (0.95, 4), (1.3, -2), (1.45, -16), (2.0, -4), (2.5, 0), (4, 0)]
    )
    look_down = interpolate_keyframes(time_s, [(0, 0), (2.5, 0), (2.65, 8), (3.0, 0), (4, 0)])
    both = max(_blink(time_s, 0.62), _blink(time_s, 1.62), _blink(time_s, 3.02))
    wink = _blink(time_s, 2.62, 0.14)
    return Posture(
        Angles(turn, nod, tilt),
        Expression(
            jaw=float(0.5 * speaking * syllables),
            blink_right=max(both, wink),
            blink_left=both,
            smile=smile,
            brows=brows,
            gaze_yaw_deg=look,
            gaze_pitch_deg=look_down,
        ),
    )


def frame_times(frames: int = FRAMES) -> NDArray[np.float64]:
    """Presentation times (frames,) in seconds."""
    return np.arange(frames) / FPS


def _blink(time_s: float, middle_s: float, half_s: float = 0.1) -> float:
    """Closure 0..1 of a lid that closes quickly, stays closed briefly, and opens again."""
    return float(np.clip(1.5 * (1 - abs(time_s - middle_s) / half_s), 0, 1))
