"""Check whether public face models detect and track the studio's people, and the error of their landmarks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from relit_camera.base.array_types import Float64Array
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.face.detection.face_detector import FaceDetector
from relit_camera.face.face_state import FaceStatus, Tracker
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.tracking.trackers import track_still
from relit_studio.cameras.studio_camera import Camera
from relit_studio.people.face.landmarks import landmarks
from relit_studio.people.person import Person
from relit_studio.people.posture import Posture

MAX_LANDMARK_ERROR = 0.15
"""Mean landmark error, as a fraction of the distance of the outer eye corners, below which a face counts as tracked."""


@dataclass(frozen=True)
class Detectability:
    """Detections of the models in one picture.

    Attributes:
        yaw_deg, pitch_deg: the true pose.
        detected: the detector found a face, and the true face's middle lies in its box.
        errors: by tracker, the points' mean distance from the truth in distances of the outer eye corners; None where
            the tracker found no face.
    """

    yaw_deg: float
    pitch_deg: float
    detected: bool
    errors: Mapping[str, float | None]

    def tracked(self, tracker: str) -> bool:
        """Whether the tracker found the face, with its landmarks on it."""
        error = self.errors[tracker]
        return error is not None and error < MAX_LANDMARK_ERROR


def check_detectability(
    picture: DisplayImage,
    person: Person,
    posture: Posture,
    camera: Camera,
    detector: FaceDetector,
    trackers: Sequence[Tracker],
) -> Detectability:
    """Run the detector and each tracker on one picture of a person (uint8 sRGB)."""
    places = landmarks(person, posture)
    found = detector.detect(picture)
    detected = False
    if found is not None:
        x, y = camera.project(places["openseeface66"]).mean(axis=0) - found.box[:2]
        detected = bool(0 <= x <= found.box[2] and 0 <= y <= found.box[3])
    errors: dict[str, float | None] = {}
    for tracker in trackers:
        state = track_still(picture, tracker)
        if state.status is FaceStatus.LOST:
            errors[tracker.name] = None
        else:
            true = places[tracker.scheme]
            distance = np.linalg.norm(state.landmarks - camera.project(true), axis=1).mean()
            errors[tracker.name] = float(distance / _eyes_px(true, tracker.scheme, camera))
    return Detectability(posture.angles.yaw, posture.angles.pitch, detected, errors)


def detectability_table(seen: Sequence[Detectability]) -> list[dict[str, float | str | int | None]]:
    """Rows of fractions and mean errors, of all pictures and by absolute yaw; an error is None if none was tracked."""
    yaws = sorted({abs(each.yaw_deg) for each in seen})
    groups = [("all", list(seen))] + [(f"yaw ±{yaw:g}°", [s for s in seen if abs(s.yaw_deg) == yaw]) for yaw in yaws]
    rows = []
    for name, group in groups:
        row: dict[str, float | str | int | None] = {
            "frames": name,
            "count": len(group),
            "detected": float(np.mean([each.detected for each in group])),
        }
        for tracker in group[0].errors:
            good = [each.errors[tracker] for each in group if each.tracked(tracker)]
            row[f"{tracker} followed"] = len(good) / len(group)
            row[f"{tracker} error"] = float(np.mean(np.array(good, float))) if good else None
        rows.append(row)
    return rows


def _eyes_px(points: Float64Array, scheme: str, camera: Camera) -> float:
    """Distance of the outer eye corners, in pixels, as a frontal view would show it."""
    known = landmark_scheme(scheme)
    right, left = points[known.right_eye.outer], points[known.left_eye.outer]
    distance_cm = camera.position_cm[2] - (right[2] + left[2]) / 2
    return float(np.linalg.norm(right - left) * camera.focal_px / distance_cm)
