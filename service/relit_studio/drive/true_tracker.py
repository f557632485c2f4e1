"""True face state of each frame of a driving video: as a tracker, and as JSON to compare with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from relit_camera.base.images.image_types import Frame
from relit_camera.face.face_state import LOST, FaceState, FaceStatus
from relit_camera.face.head_pose import HeadPose
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_studio.cameras.studio_camera import Camera
from relit_studio.drive.performance import ActorState
from relit_studio.drive.take import Take
from relit_studio.people.face.expressions import Expression
from relit_studio.people.face.landmarks import canonical_origin
from relit_studio.people.person import Person
from relit_studio.people.posture import turned

_BROW_INNER = "browInnerUp"
_LOST, _UNCERTAIN = 0.35, 0.65
"""Visible fractions of the face below which its state is lost, and below which it is uncertain."""


@dataclass(eq=False)
class TruthTracker:
    """Tracker that gives the true face state of a take at the frame's time."""

    take: Take
    name: str = "truth"
    scheme: str = "mesh478"

    def track(self, frame: Frame) -> FaceState:
        """The true state at the frame's time."""
        return true_state(self.take, self.take.performance.state_at(frame.time_s), self.scheme)

    def reset(self) -> None:
        """Nothing is kept between frames."""


def true_state(take: Take, actor: ActorState, scheme: str = "mesh478") -> FaceState:
    """Face state as a perfect tracker gives it; eye and mouth openings are measured in the picture.

    Its confidence is the fraction of the face that is visible: with little of it the face is uncertain, then lost.
    """
    points = take.landmarks(actor, scheme)
    visible = take.visibility(actor, points).visible_fraction
    if visible < _LOST:
        return LOST
    known, seen = landmark_scheme(scheme), take.camera.project(points)
    return FaceState(
        status=FaceStatus.FOUND if visible >= _UNCERTAIN else FaceStatus.UNCERTAIN,
        confidence=visible,
        scheme=scheme,
        landmarks=seen,
        pose=head_pose(take.person, take.camera, actor),
        eyes=known.eyes_opening(seen),
        mouth=known.mouth_opening(seen),
        blendshapes=blendshapes(actor.posture.expression),
    )


def frame_truth(take: Take, time_s: float) -> dict[str, Any]:
    """Truth of a frame as JSON; it tells the position of the face even while it is not visible."""
    actor = take.performance.state_at(time_s)
    points = take.landmarks(actor, "openseeface66")
    seen = take.visibility(actor, points)
    return {
        "time_s": time_s,
        "pose_deg": actor.posture.angles._asdict(),
        "shift_cm": list(actor.shift_cm),
        "expression": dict(actor.posture.expression),
        "landmarks66_px": take.camera.project(points).astype(float).round(3).tolist(),
        "landmarks66_hidden": np.flatnonzero(seen.hidden).tolist(),
        "found": seen.visible_fraction >= _LOST,
        "visible_share": round(seen.visible_fraction, 4),
        "covered_share": round(seen.covered_fraction, 4),
    }


def head_pose(person: Person, camera: Camera, actor: ActorState) -> HeadPose:
    """Pose of the canonical face in front of the camera; the rotation is the identity when the head is upright.

    The translation is in the canonical face's centimeters, so that its points project onto the head.
    """
    origin, scale = canonical_origin(person.model)
    rotation = actor.posture.rotation
    moved = turned(origin[None], rotation)[0] + actor.shift_cm
    return HeadPose(rotation, (moved - camera.position_cm) / scale, camera.focal_px)


def blendshapes(expression: Expression) -> dict[str, float]:
    """Weights 0..1 by ARKit's names; the mean of both sides where ARKit has no sides."""
    sides = {"_L": "Left", "_R": "Right"}
    named: dict[str, list[float]] = {}
    for name, weight in expression.items():
        stem, side = name[:-2], name[-2:]
        joint = stem == _BROW_INNER and side in sides
        key = stem if joint else stem + sides.get(side, side)
        named.setdefault(key, []).append(weight)
    return {key: float(np.clip(np.mean(weights), 0, 1)) for key, weights in named.items()}
