"""What counts as recognized, with trackers whose errors are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.base.rotations import Angles
from relit_camera.face.detection.face_detector import Detection
from relit_camera.face.face_state import LOST, FaceState, FaceStatus
from relit_studio.cameras.studio_camera import Camera
from relit_studio.people.face.landmarks import landmarks
from relit_studio.people.person import Person
from relit_studio.people.posture import Posture
from relit_studio.stills.detectability import (
    MAX_LANDMARK_ERROR,
    Detectability,
    check_detectability,
    detectability_table,
)

CAMERA = Camera(512)
POSTURE = Posture(Angles(30.0, 5.0, 0.0))
PICTURE: DisplayImage = np.zeros((512, 512, 3), np.uint8)


@dataclass
class OffTracker:
    """Says the truth, so many pixels too far to the right; or nothing."""

    person: Person
    off_px: float | None
    name: str = "off"
    scheme: str = "mesh478"

    def track(self, frame: Frame) -> FaceState:
        if self.off_px is None:
            return LOST
        true = CAMERA.project(landmarks(self.person, POSTURE)[self.scheme])
        return FaceState(FaceStatus.FOUND, 1.0, self.scheme, true + np.array([self.off_px, 0], np.float32))

    def reset(self) -> None:
        """Nothing is kept."""


@dataclass
class BoxDetector:
    """Sees a face in this box, or none."""

    box: tuple[float, float, float, float] | None

    def detect(self, image: DisplayImage) -> Detection | None:
        return None if self.box is None else Detection(self.box, np.zeros((2, 2), np.float32), 1.0)


def seen(person: Person, off_px: float | None, box: tuple[float, float, float, float] | None) -> Detectability:
    return check_detectability(PICTURE, person, POSTURE, CAMERA, BoxDetector(box), [OffTracker(person, off_px)])  # type: ignore[arg-type]


def test_errors_are_in_distances_of_the_eyes(person: Person) -> None:
    assert seen(person, 0.0, None).errors["off"] == pytest.approx(0, abs=1e-6)
    corners = landmarks(person, POSTURE)["mesh478"][[33, 263]]
    distance_cm = CAMERA.position_cm[2] - corners[:, 2].mean()
    eyes_px = np.linalg.norm(corners[0] - corners[1]) * CAMERA.focal_px / distance_cm
    assert 60 < eyes_px < 160
    found = seen(person, 0.1 * eyes_px, None)
    assert found.errors["off"] == pytest.approx(0.1, rel=1e-3)
    assert found.tracked("off")


def test_points_beside_the_face_do_not_count(person: Person) -> None:
    assert not seen(person, 60.0, None).tracked("off")
    assert not seen(person, None, None).tracked("off")


def test_a_box_must_hold_the_face(person: Person) -> None:
    x, y = CAMERA.project(landmarks(person, POSTURE)["openseeface66"]).mean(axis=0)
    assert seen(person, 0.0, (x - 50, y - 50, 100, 100)).detected
    assert not seen(person, 0.0, (x + 50, y - 50, 100, 100)).detected
    assert not seen(person, 0.0, None).detected


def test_the_table_counts_by_yaw() -> None:
    seen = [
        Detectability(yaw, 0.0, detected, {"off": error})
        for yaw, detected, error in (
            (0, True, 0.02),
            (-30, True, 0.04),
            (30, False, None),
            (30, True, 2 * MAX_LANDMARK_ERROR),
        )
    ]
    everything, frontal, turned = detectability_table(seen)
    assert [row["count"] for row in (everything, frontal, turned)] == [4, 1, 3]
    assert everything["detected"] == 0.75
    assert everything["off followed"] == 0.5
    assert everything["off error"] == pytest.approx(0.03)
    assert turned["off followed"] == pytest.approx(1 / 3)


def test_who_is_never_followed_has_no_error() -> None:
    everything, _ = detectability_table([Detectability(0.0, 0.0, False, {"off": None})])
    assert everything["off followed"] == 0
    assert everything["off error"] is None  # JSON has no NaN
