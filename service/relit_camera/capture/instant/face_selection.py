"""The face in some frames: which of them show it well, and what stands in the way where none does."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from relit_camera.base.errors import CaptureError
from relit_camera.base.images.image_types import DisplayImage, Frame, Points
from relit_camera.face.detection.installed_detector import open_face_detector
from relit_camera.face.face_state import FaceState
from relit_camera.face.landmarks.landmark_schemes import LandmarkScheme, landmark_scheme
from relit_camera.face.landmarks.rotated_crop import bounding_box
from relit_camera.face.tracking.trackers import TrackerOptions, open_tracker, track_still

TRACKER = "mesh"
SCHEME = "mesh478"
FOREHEAD, CHIN = 10, 152
"""Landmarks whose distance is the height of the face."""
INTERVAL_S = 0.1
"""Time between frames that the tracker is told."""


@dataclass(frozen=True)
class SelectionTunables:
    """What counts as a face that a subject can be made of.

    Attributes:
        min_height_px: of the face, from forehead to chin.
        max_turn_deg: of the nose away from the camera, in the frame that shows the face best.
        turn_spread_deg: how much further it may be turned in the other frames.
        min_eye_opening: of the median opening.
        min_sharpness: of that of a sharp frame.
        max_shape_change: largest mean distance of aligned landmarks, in heights of the face: another expression.
        most: frames that are used.
        second_face: height of another face, in heights of the largest, from which there are two.
        checked_for_others: frames in which other faces are looked for.
    """

    min_height_px: float = 60.0
    max_turn_deg: float = 25.0
    turn_spread_deg: float = 5.0
    min_eye_opening: float = 0.7
    min_sharpness: float = 0.4
    max_shape_change: float = 0.012
    most: int = 15
    second_face: float = 0.6
    checked_for_others: int = 3


TUNABLES = SelectionTunables()


@dataclass(frozen=True)
class SeenFace:
    """A face in one frame.

    Attributes:
        image: the frame.
        landmarks: (478, 2) pixels of it.
        turn_deg: angle between nose and camera.
        eyes: their mean opening.
    """

    image: DisplayImage
    landmarks: Points
    turn_deg: float
    eyes: float

    @property
    def height_px(self) -> float:
        """Height of the face."""
        return float(np.linalg.norm(self.landmarks[FOREHEAD] - self.landmarks[CHIN]))


def follow_face(frames: Sequence[DisplayImage]) -> list[FaceState]:
    """The face in each of some frames, in order of time, or in a picture alone.

    Raises:
        ModelError: the networks are not there.
    """
    tracker = open_tracker(TRACKER, TrackerOptions(blendshapes=False))
    if len(frames) == 1:
        return [track_still(frames[0], tracker)]
    now = time.monotonic()
    return [tracker.track(Frame(image, index, now, index * INTERVAL_S)) for index, image in enumerate(frames)]


def select_faces(frames: Sequence[DisplayImage], states: Sequence[FaceState], source: str) -> list[SeenFace]:
    """The frames that show one face from the front, eyes open, sharp, and as alike as may be; the best first.

    Args:
        frames: in order of time.
        states: see `follow_face`.
        source: where they come from, for messages.

    Raises:
        CaptureError: no face, two, one that is too small or turned away.
        ModelError: the networks are not there.
    """
    seen = [
        SeenFace(image, state.landmarks, state.pose.turn_deg, float(np.mean(state.eyes)))
        for image, state in zip(frames, states, strict=True)
        if state.visible and state.pose is not None
    ]
    if not seen:
        raise CaptureError(f"no face was found in {source}", "look into the camera, your face in even light")
    _require_one_face([seen[int(index)].image for index in np.linspace(0, len(seen) - 1, 3)], source)
    height = float(np.median([face.height_px for face in seen]))
    if height < TUNABLES.min_height_px:
        raise CaptureError(
            f"the face in {source} is {height:.0f} pixels high, at least {TUNABLES.min_height_px:.0f} are needed",
            "come nearer to the camera, or choose a larger picture size",
        )
    least = min(face.turn_deg for face in seen)
    if least > TUNABLES.max_turn_deg:
        raise CaptureError(
            f"the face in {source} is turned away by {least:.0f} degrees or more", "look straight into the camera"
        )
    frontal = [face for face in seen if face.turn_deg <= least + TUNABLES.turn_spread_deg]
    opening = float(np.median([face.eyes for face in seen]))
    awake = [face for face in frontal if face.eyes >= TUNABLES.min_eye_opening * opening] or frontal
    sharpness = [face_sharpness(face.image, face.landmarks) for face in awake]
    sharp = [
        face
        for face, value in zip(awake, sharpness, strict=True)
        if value >= TUNABLES.min_sharpness * float(np.percentile(sharpness, 90))
    ]
    best = min(sharp, key=_mouth_width)
    alike = sorted((_shape_change(face, best), index) for index, face in enumerate(sharp))
    return [sharp[index] for change, index in alike[: TUNABLES.most] if change <= TUNABLES.max_shape_change]


def _require_one_face(images: Sequence[DisplayImage], source: str) -> None:
    """Raise CaptureError where most pictures show another face about as large as the largest."""
    detector = open_face_detector()
    crowded = 0
    for image in images:
        heights = sorted((face.box[3] for face in detector.detect_all(image)), reverse=True)
        crowded += len(heights) > 1 and heights[1] > TUNABLES.second_face * heights[0]
    if crowded > len(images) / 2:
        raise CaptureError(f"there are two faces in {source}", "let one person alone be in the picture")


def _mouth_width(face: SeenFace) -> float:
    """Width of the mouth and its opening, in eye spans: least where nobody smiles or speaks."""
    scheme = landmark_scheme(SCHEME)
    corners = face.landmarks[[scheme.upper_lip_outer[0], scheme.upper_lip_outer[-1]]]
    width = float(np.linalg.norm(corners[0] - corners[1])) / scheme.eye_span(face.landmarks)
    return width + scheme.mouth_opening(face.landmarks)


def face_sharpness(image: DisplayImage, landmarks: Points) -> float:
    """Mean square of the Laplacian over the face's box, by that of its brightness."""
    x, y, width, height = bounding_box(landmarks)
    rows, columns = image.shape[:2]
    left, right = max(int(x), 0), min(int(x + width) + 1, columns)
    top, bottom = max(int(y), 0), min(int(y + height) + 1, rows)
    gray = cv2.cvtColor(np.ascontiguousarray(image[top:bottom, left:right]), cv2.COLOR_RGB2GRAY)
    if gray.size == 0:
        return 0.0
    return float(cv2.Laplacian(gray, cv2.CV_32F).var() / max(float(gray.astype(np.float32).var()), 1.0))


def align_to(face: SeenFace, reference: SeenFace, scheme: LandmarkScheme | None = None) -> np.ndarray:
    """The similarity (2, 3) that brings the rigid landmarks of a face nearest to those of another."""
    rigid = (scheme or landmark_scheme(SCHEME)).rigid_indices
    affine, _ = cv2.estimateAffinePartial2D(face.landmarks[rigid], reference.landmarks[rigid], method=cv2.LMEDS)
    return np.eye(2, 3) if affine is None else np.asarray(affine, np.float64)


def _shape_change(face: SeenFace, reference: SeenFace) -> float:
    """Mean distance of aligned landmarks, in heights of the face."""
    affine = align_to(face, reference)
    moved = face.landmarks @ affine[:, :2].T + affine[:, 2]
    return float(np.linalg.norm(moved - reference.landmarks, axis=1).mean()) / max(reference.height_px, 1.0)
