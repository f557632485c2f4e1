"""What is so in each frame of a driving video: for the tracker `recorded`, and to measure against."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relit_camera.face.schemes import landmark_scheme
from relit_camera.face.state import FaceState, FaceStatus, HeadPose
from relit_camera.space.images import Frame
from relit_studio.camera import Camera
from relit_studio.drive.performance import posture_at
from relit_studio.people.expressions import Expression
from relit_studio.people.landmarks import canonical_origin, landmarks
from relit_studio.people.person import Person
from relit_studio.people.posture import Posture, turned

_BROW_INNER = "browInnerUp"


@dataclass(eq=False)
class TruthTracker:
    """Says of any frame of the performance what is so, by the frame's time."""

    person: Person
    camera: Camera
    name: str = "truth"
    scheme: str = "mesh478"

    def track(self, frame: Frame) -> FaceState:
        """The true state at the frame's time."""
        return true_state(self.person, self.camera, posture_at(frame.time_s), self.scheme)

    def reset(self) -> None:
        """Nothing is kept between frames."""


def true_state(person: Person, camera: Camera, posture: Posture, scheme: str = "mesh478") -> FaceState:
    """What a perfect tracker would say of this posture; openings are measured in the picture."""
    known = landmark_scheme(scheme)
    points = camera.project(landmarks(person, posture)[scheme])
    return FaceState(
        status=FaceStatus.FOUND,
        confidence=1.0,
        scheme=scheme,
        landmarks=points,
        pose=head_pose(person, camera, posture),
        eyes=known.eyes_opening(points),
        mouth=known.mouth_opening(points),
        blendshapes=blendshapes(posture.expression),
    )


def head_pose(person: Person, camera: Camera, posture: Posture) -> HeadPose:
    """The canonical face's pose before the camera: the identity when the head is upright.

    The translation is in the canonical face's centimetres, so that its points project onto the head.
    """
    origin, scale = canonical_origin(person.model)
    moved = turned(origin[None], posture.rotation)[0]
    return HeadPose(posture.rotation, (moved - camera.position_cm) / scale, camera.focal_px)


def blendshapes(expression: Expression) -> dict[str, float]:
    """Weights by ARKit's names, 0..1; where ARKit has no sides, the mean of both."""
    sides = {"_L": "Left", "_R": "Right"}
    named: dict[str, list[float]] = {}
    for name, weight in expression.items():
        stem, side = name[:-2], name[-2:]
        joint = stem == _BROW_INNER and side in sides
        key = stem if joint else stem + sides.get(side, side)
        named.setdefault(key, []).append(weight)
    return {key: float(np.clip(np.mean(weights), 0, 1)) for key, weights in named.items()}
