"""What mouth and eyes do, as a few numbers from head-space points, so that expressions can be compared.

They are in units of a difference that is clearly seen, so that a distance of 1 is another expression.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.face.landmarks.landmark_schemes import EyeLandmarks, LandmarkScheme

LIP_CM, WIDTH_CM, CORNER_CM = 0.25, 0.45, 0.25
"""Units of the mouth: height of upper and lower lip, width, height of the corners."""
CLOSURE = 0.25
"""Unit of an eye: share of the neutral opening by which it is shut."""


def mouth_features(points: NDArray[np.floating], scheme: LandmarkScheme) -> NDArray[np.float64]:
    """Heights of the inner edges of upper and lower lip, width, and height of the corners: (4,).

    Args:
        points: (count, 3) head-space centimetres.
        scheme: what they are.
    """
    upper, lower = (points[list(side), 1].mean() for side in scheme.lip_gap)
    right, left = points[scheme.upper_lip_outer[0]], points[scheme.upper_lip_outer[-1]]
    width = np.linalg.norm(left - right)
    return np.array([upper / LIP_CM, lower / LIP_CM, width / WIDTH_CM, (right[1] + left[1]) / 2 / CORNER_CM])


def mouth_gap_cm(points: NDArray[np.floating], scheme: LandmarkScheme) -> float:
    """Distance of the inner edges of the lips, in the middle; points as in `mouth_features`."""
    upper, lower = (points[list(side)].mean(axis=0) for side in scheme.lip_gap)
    return float(np.linalg.norm(upper - lower))


def lid_gap_cm(points: NDArray[np.floating], eye: EyeLandmarks) -> float:
    """Mean distance of the lids of an eye; points as in `mouth_features`."""
    upper, lower = (points[list(side)] for side in eye.gap)
    return float(np.linalg.norm(upper - lower, axis=1).mean())


def eye_closure(points: NDArray[np.floating], eye: EyeLandmarks, neutral_gap_cm: float) -> float:
    """How far an eye is shut: 0 as wide open as on the neutral face, which has that `lid_gap_cm`, 1 shut; < 0 wider."""
    return 1 - lid_gap_cm(points, eye) / max(neutral_gap_cm, 1e-6)
