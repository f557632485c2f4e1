"""How much each expression still shows in each part of the face, from what the driver's face does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.easing import smoothstep
from relit_camera.base.rotations import Rotation, angles_from_rotation
from relit_camera.face.landmarks.expression_features import (
    CLOSURE,
    eye_closure,
    lid_gap_cm,
    mouth_features,
    mouth_gap_cm,
)
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.subject.expression_stills import ExpressionStill

REACH = 0.8
"""By how many units one still may be nearer than another until it alone shows."""
FAR = 1e6
TURN_UNIT_DEG = 15.0
"""Turn that is another view of cheeks and temples."""
FEATURE_TURN_UNIT_DEG = 45.0
"""The same for mouth and eyes, which are moved to any turn."""
PARTED_LIPS_CM = (0.05, 0.3)
"""Further parted than in the source image: from where on the mouth is a still's, and up to where wholly."""
SIDEWAYS_DEG = 20.0
"""Yaw at which the width of a mouth counts half."""
PARTED_UNITS = 3.0
"""By how many units a mouth with parted lips differs from one with shut lips, beside all else: it has an inside."""
CLOSING_LID = (0.4, 0.7)
"""The same for an eye, by how far it is shut."""
SHUT_LID = 0.55
"""How far an eye must be shut in a still that shows shut lids."""
TURNED_DEG = (9.0, 18.0)
"""The same for a face that is turned to a side, by the yaw."""
SMOOTHING_S = {"mouth": 0.05, "right_eye": 0.025, "left_eye": 0.025, "right_turn": 0.12, "left_turn": 0.12}
"""Time in which weights follow, by region."""
RIVAL, FADED = 0.35, 0.1
"""Share of the largest weight up to which another still does not show: of the wanted weights, so that few are mixed,
and of those that follow them."""
NEGLIGIBLE = 0.03
"""Sum of the weights up to which nothing shows."""
NEARER = (0.5, 0.75)
"""The source image's distance from the driver's mouth by that and the nearest still's: from where on, with shut lips,
stills show, and up to where wholly."""
NEUTRAL_MOUTH = (0.4, 0.8)
"""Distance of a mouth from the neutral one up to which it is neutral, and from where on it is another: nearer to it,
noise decides which is nearest. A still of a neutral mouth is no reason to show stills."""


@dataclass(frozen=True)
class Doing:
    """What a face does, as stills and driver are compared.

    Attributes:
        features: by region, (count,) float64.
        certain: by region how sure each feature is, 0..1, (count,).
        needed: by region 0..1: how far a still is needed because the source image does not show such a thing.
    """

    features: dict[str, NDArray[np.float64]]
    certain: dict[str, NDArray[np.float64]]
    needed: dict[str, float]


class StillWeights:
    """Weights of the stills of one subject, frame by frame."""

    def __init__(self, stills: Sequence[ExpressionStill], face: SourceFace) -> None:
        self._face, eyes = face, (face.scheme.right_eye, face.scheme.left_eye)
        self._neutral_mouth_gap_cm = mouth_gap_cm(face.head_points, face.scheme)
        self._neutral_lid_gaps_cm = [(eye, lid_gap_cm(face.head_points, eye)) for eye in eyes]
        self._neutral = self.doing(np.zeros_like(face.head_points), Rotation.identity())
        self._stills = [
            self.doing(still.expression.astype(np.float64), Rotation.from_rotvec(still.rotation.astype(np.float64)))
            for still in stills
        ]
        offset = np.stack([still.features["mouth"] for still in self._stills]) - self._neutral.features["mouth"]
        self._other_mouths = np.linalg.norm(offset[:, :-2], axis=1) > NEUTRAL_MOUTH[0]
        self._features = {
            region: np.stack([still.features[region] for still in self._stills]) for region in SMOOTHING_S
        }
        yaws = np.array([_yaw(still.rotation) for still in stills])
        self._usable = {
            "mouth": np.ones(len(stills), np.bool_),
            "right_eye": self._features["right_eye"][:, 0] * CLOSURE > SHUT_LID,
            "left_eye": self._features["left_eye"][:, 0] * CLOSURE > SHUT_LID,
            "right_turn": -yaws > TURNED_DEG[0],
            "left_turn": yaws > TURNED_DEG[0],
        }
        self._followed: dict[str, NDArray[np.float64]] = {}
        self._time_s: float | None = None

    def doing(self, expression: NDArray[np.float64], rotation: Rotation) -> Doing:
        """What a face does.

        Args:
            expression: (count, 3) head-space centimetres, since neutral.
            rotation: of the head, since neutral.
        """
        scheme = self._face.scheme
        points = self._face.head_points + expression
        yaw, pitch, _ = angles_from_rotation(rotation)
        turn = np.array([yaw, pitch])
        parted = float(smoothstep(mouth_gap_cm(points, scheme) - self._neutral_mouth_gap_cm, *PARTED_LIPS_CM))
        mouth = [*mouth_features(points, scheme), PARTED_UNITS * parted]
        features = {"mouth": np.append(mouth, turn / FEATURE_TURN_UNIT_DEG)}
        needed = {"mouth": parted}
        # Seen from the side, width and corners are confused with the depth of the lips, which landmarks do not tell.
        sideways = 1 / (1 + (yaw / SIDEWAYS_DEG) ** 2)
        certain = {"mouth": np.array([1, 1, sideways, sideways, 1, 1, 1])}
        closures = [eye_closure(points, eye, gap_cm) for eye, gap_cm in self._neutral_lid_gaps_cm]
        for name, own, other, sign in zip(
            ("right_eye", "left_eye"), closures, closures[::-1], (-1.0, 1.0), strict=True
        ):
            # The lids of the eye that turns away are seen too flat: the other one tells.
            closure = own + float(smoothstep(sign * yaw, *TURNED_DEG)) * (other - own)
            features[name] = np.append(closure / CLOSURE, turn / FEATURE_TURN_UNIT_DEG)
            needed[name] = float(smoothstep(closure, *CLOSING_LID))
        # The person's right is at the picture's left: that side turns away while the nose turns there.
        for name, sign in (("right_turn", -1.0), ("left_turn", 1.0)):
            features[name] = turn / TURN_UNIT_DEG
            needed[name] = float(smoothstep(sign * yaw, *TURNED_DEG))
        return Doing(features, certain, needed)

    def update(self, doing: Doing, time_s: float) -> dict[str, list[tuple[int, float]]]:
        """By region the stills that show and their weights 0..1, summing to at most 1.

        Args:
            doing: of the driver.
            time_s: of the frame.
        """
        passed = np.inf if self._time_s is None or time_s < self._time_s else time_s - self._time_s
        self._time_s = time_s
        chosen = {}
        for region, smoothing_s in SMOOTHING_S.items():
            wanted = self._wanted(region, doing)
            before = self._followed.get(region, wanted)
            followed = before + (1 - np.exp(-passed / smoothing_s)) * (wanted - before)
            self._followed[region] = followed
            chosen[region] = _drawn(followed)
        return chosen

    def _wanted(self, region: str, doing: Doing) -> NDArray[np.float64]:
        """The weight (stills,) of each still where time plays no role."""
        total = self._total(region, doing)
        usable = self._usable[region]
        if total <= 0 or not usable.any():
            return np.zeros(len(usable))
        offset = (self._features[region] - doing.features[region]) * doing.certain.get(region, 1.0)
        distance = np.where(usable, np.linalg.norm(offset, axis=1), FAR)
        return total * _without_faint(sparsemax(-distance / REACH), RIVAL)

    def _total(self, region: str, doing: Doing) -> float:
        """How far stills show at all."""
        needed = doing.needed[region]
        if region != "mouth":
            return needed
        if not self._other_mouths.any():
            return needed
        # The turn does not make a mouth another one.
        shape, certain = doing.features[region][:-2], doing.certain[region][:-2]
        neutral = float(np.linalg.norm((self._neutral.features[region][:-2] - shape) * certain))
        others = self._features[region][self._other_mouths, :-2]
        nearest = float(np.linalg.norm((others - shape) * certain, axis=1).min())
        nearer = smoothstep(neutral / max(neutral + nearest, 1e-6), *NEARER)
        return max(needed, float(nearer * smoothstep(neutral, *NEUTRAL_MOUTH)))


def sparsemax(scores: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shares that sum to 1: the point of the simplex next to the scores (Martins and Astudillo, ICML 2016).

    As softmax, but those far below the best are exactly 0, and no share changes faster than the scores.
    """
    falling = np.sort(scores)[::-1]
    above = np.cumsum(falling) - 1
    count = np.arange(1, len(scores) + 1)
    kept = int(np.flatnonzero(falling * count > above)[-1])
    return np.asarray(np.maximum(scores - above[kept] / (kept + 1), 0))


def _without_faint(weights: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """Weights of the same sum without those below a share of the largest; what is near that share gets nearly 0."""
    left = np.maximum(weights - share * weights.max(), 0)
    return np.asarray(left * (weights.sum() / max(float(left.sum()), 1e-12)))


def _drawn(weights: NDArray[np.float64]) -> list[tuple[int, float]]:
    """The stills that show and their weights, the strongest first. They join and leave at weight 0."""
    total = float(weights.sum())
    if total <= NEGLIGIBLE:
        return []
    shown = _without_faint(weights, FADED) * ((total - NEGLIGIBLE) / ((1 - NEGLIGIBLE) * total))
    return [(int(index), float(shown[index])) for index in np.argsort(-shown) if shown[index] > 0]


def _yaw(rotation: NDArray[np.float32]) -> float:
    """The yaw, in degrees, of a rotation vector (3,)."""
    return angles_from_rotation(Rotation.from_rotvec(rotation.astype(np.float64))).yaw
