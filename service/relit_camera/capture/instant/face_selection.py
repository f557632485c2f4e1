"""The face in some frames: which of them show it best, and what would make it better."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float64Array
from relit_camera.base.errors import CaptureError
from relit_camera.base.images.affine import opencv_affine
from relit_camera.base.images.image_types import DisplayImage, Frame, Points
from relit_camera.face.detection.installed_detector import open_face_detector
from relit_camera.face.face_state import FaceState
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.landmarks.rotated_crop import bounding_box
from relit_camera.face.tracking.trackers import TrackerOptions, open_tracker, track_still

TRACKER = "mesh"
SCHEME = "mesh478"
FOREHEAD, CHIN = 10, 152
"""Landmarks whose distance is the height of the face."""
INTERVAL_S = 0.1
"""Time between frames that the tracker is told."""
FRONT_PX = 48
"""Side of the picture in which light and symmetry of a face are judged."""
WHITE, BLACK = 250, 12
"""Codes from which and to which nothing is seen of a face."""


@dataclass(frozen=True)
class SelectionTunables:
    """What counts as a face that a subject can be made of, and what as a fault of one.

    The faults were weighed by looking at the moments that they choose in recordings of people at webcams and phones.

    Attributes:
        min_height_px, good_height_px: of the face, from forehead to chin; below the second one a better one is advised.
        max_turn_deg, good_turn_deg: of the nose away from the camera.
        open_eyes: opening below which eyes are shut, or look down.
        wide_eyes: opening from which eyes are open, whoever's they are.
        open_mouth: opening of the mouth from which it is open, in eye spans.
        turn_fault_deg: turn that is one fault; half of it is a quarter.
        eye_fault, mouth_fault: missing opening of the eyes, as a share, and opening of the mouth that are one fault.
        light_fault: share of the face that is white or black that is one fault.
        symmetry_fault: difference of the face's sides that is one fault: a turned face has it, one lit from the side,
            and one with a hand before it.
        shape_fault: change of shape to the typical face that is one fault.
        typical: percentile of a face's changes of shape to the better half of all: low, as there are other expressions.
        max_shape_change: largest mean distance of aligned landmarks, in heights of the face: another expression.
        further_faults: that a face may have beyond those of the best.
        max_jump: distance between two frames, in heights of the face, from which it is another person's.
        max_growth: factor between the heights in two frames from which it is another person's.
        most: frames that are used.
        second_face: height of another face, in heights of the largest, from which there are two.
        checked_for_others: frames in which other faces are looked for.
    """

    min_height_px: float = 45.0
    good_height_px: float = 60.0
    max_turn_deg: float = 35.0
    good_turn_deg: float = 25.0
    open_eyes: float = 0.12
    wide_eyes: float = 0.3
    open_mouth: float = 0.08
    turn_fault_deg: float = 15.0
    eye_fault: float = 0.25
    mouth_fault: float = 0.05
    light_fault: float = 0.2
    symmetry_fault: float = 0.15
    shape_fault: float = 0.01
    typical: float = 40.0
    max_shape_change: float = 0.012
    further_faults: float = 1.0
    max_jump: float = 1.0
    max_growth: float = 1.5
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
        mouth: its opening, in eye spans.
    """

    image: DisplayImage
    landmarks: Points
    turn_deg: float
    eyes: float
    mouth: float

    @property
    def height_px(self) -> float:
        """Height of the face."""
        return float(np.linalg.norm(self.landmarks[FOREHEAD] - self.landmarks[CHIN]))


@dataclass(frozen=True)
class FaceSelection:
    """The faces that a subject is made of, the best first, and what would make it better, as lines for people."""

    faces: list[SeenFace]
    warnings: tuple[str, ...]


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


def select_faces(frames: Sequence[DisplayImage], states: Sequence[FaceState], source: str) -> FaceSelection:
    """The frames that show one person best and alike: typical of them, from the front, eyes open, mouth shut, sharp.

    A source that has no such moment gives the nearest it has, and a warning.

    Args:
        frames: in order of time.
        states: see `follow_face`.
        source: where they come from, for messages.

    Raises:
        CaptureError: no face, or one that is too small or turned away in all frames.
        ModelError: the networks are not there.
    """
    seen = [
        SeenFace(image, state.landmarks, state.pose.turn_deg, float(np.mean(state.eyes)), state.mouth)
        for image, state in zip(frames, states, strict=True)
        if state.visible and state.pose is not None
    ]
    if not seen:
        raise CaptureError(f"no face was found in {source}", "look into the camera, your face in even light")
    faces = _usable(_one_person(seen), source)
    faults = _faults(faces)
    change = _shape_changes(faces)
    better = faults <= np.median(faults)
    # Of expressions that come and go each is unlike the others; the face at rest is like itself, again and again.
    faults += np.percentile(change[:, better], TUNABLES.typical, axis=1) / TUNABLES.shape_fault
    best = int(np.argmin(faults))
    alike = [
        faces[index]
        for index in np.argsort(change[:, best], kind="stable")[: TUNABLES.most]
        if change[index, best] <= TUNABLES.max_shape_change and faults[index] <= faults[best] + TUNABLES.further_faults
    ]
    checked = [faces[int(index)] for index in np.linspace(0, len(faces) - 1, TUNABLES.checked_for_others)]
    return FaceSelection(alike, _advice(faces[best], checked))


def _one_person(seen: list[SeenFace]) -> list[SeenFace]:
    """The faces of whoever is seen largest and longest: a face that jumps, or changes its size, is somebody else's."""
    people = [[seen[0]]]
    for face in seen[1:]:
        last = people[-1][-1]
        jump = float(np.linalg.norm(face.landmarks.mean(axis=0) - last.landmarks.mean(axis=0)))
        growth = face.height_px / last.height_px
        same = jump < TUNABLES.max_jump * last.height_px and 1 / TUNABLES.max_growth < growth < TUNABLES.max_growth
        if same:
            people[-1].append(face)
        else:
            people.append([face])
    return max(people, key=lambda person: sum(face.height_px for face in person))


def _usable(faces: list[SeenFace], source: str) -> list[SeenFace]:
    """Those that are large enough and not turned away; CaptureError where there are none."""
    height = max(face.height_px for face in faces)
    if height < TUNABLES.min_height_px:
        raise CaptureError(
            f"the face in {source} is {height:.0f} pixels high, at least {TUNABLES.min_height_px:.0f} are needed",
            "come nearer to the camera, or choose a larger picture size",
        )
    large = [face for face in faces if face.height_px >= TUNABLES.min_height_px]
    usable = [face for face in large if face.turn_deg <= TUNABLES.max_turn_deg]
    if not usable:
        least = min(face.turn_deg for face in large)
        raise CaptureError(
            f"the face in {source} is turned away by {least:.0f} degrees or more", "look straight into the camera"
        )
    return usable


def _faults(faces: list[SeenFace]) -> Float64Array:
    """How far each face is from one that is seen clearly from the front, eyes open, mouth shut, in even light."""
    eyes = np.array([face.eyes for face in faces])
    mouth = np.array([face.mouth for face in faces])
    turn = np.array([face.turn_deg for face in faces])
    sharpness = np.array([face_sharpness(face.image, face.landmarks) for face in faces])
    shut = 1 - np.minimum(eyes / np.clip(np.percentile(eyes, 90), 1e-6, TUNABLES.wide_eyes), 1)
    blur = -np.log2(np.clip(sharpness / max(float(np.percentile(sharpness, 90)), 1e-6), 1e-3, 1))
    return np.asarray(
        (turn / TUNABLES.turn_fault_deg) ** 2
        + (shut / TUNABLES.eye_fault) ** 2
        + mouth / TUNABLES.mouth_fault
        + blur
        + [_front_faults(face) for face in faces]
    )


def _front_faults(face: SeenFace) -> float:
    """Faults of the face as seen from the front: what is white or black, and how its sides differ."""
    front, inside = _front(face)
    lost = (front.max(axis=2) >= WHITE) | (front.max(axis=2) <= BLACK)
    stops = np.log2(cv2.cvtColor(front, cv2.COLOR_RGB2GRAY) + np.float32(8))
    detail = cv2.GaussianBlur(stops, (0, 0), 1) - cv2.GaussianBlur(stops, (0, 0), FRONT_PX / 6)
    sides = np.abs(detail - detail[:, ::-1])[inside].mean() / max(float(detail[inside].std()), 1e-3)
    return float(lost[inside].mean() / TUNABLES.light_fault + sides / TUNABLES.symmetry_fault)


def _front(face: SeenFace) -> tuple[DisplayImage, NDArray[np.bool_]]:
    """The face (side, side, 3), its landmarks near those of the canonical face, and where both of its sides lie."""
    flat = landmark_scheme(SCHEME).canonical[:, :2] * [1, -1]
    low, high = flat.min(axis=0), flat.max(axis=0)
    target = (((flat - (low + high) / 2) / (high - low).max() + 0.5) * FRONT_PX).astype(np.float32)
    scale = min(2 * FRONT_PX / face.height_px, 1.0)
    crop, corner = _cropped(face.image, face.landmarks)
    size = max(round(scale * crop.shape[1]), 1), max(round(scale * crop.shape[0]), 1)
    small = cv2.resize(crop, size, interpolation=cv2.INTER_AREA)
    affine = _similarity(np.float32(scale) * (face.landmarks - corner), target)
    side = (FRONT_PX, FRONT_PX)
    front = np.asarray(cv2.warpAffine(small, opencv_affine(affine), side, borderMode=cv2.BORDER_REPLICATE), np.uint8)
    inside = np.zeros(side, np.uint8)
    cv2.fillConvexPoly(inside, cv2.convexHull(target.astype(np.int32)), 1)
    return front, (inside & inside[:, ::-1]) > 0


def _advice(best: SeenFace, checked: Sequence[SeenFace]) -> tuple[str, ...]:
    """What would make a better subject, from the best face and some frames in which others are looked for."""
    warnings = []
    detector = open_face_detector()
    crowded = 0
    for face in checked:
        heights = sorted((found.box[3] for found in detector.detect_all(face.image)), reverse=True)
        crowded += len(heights) > 1 and heights[1] > TUNABLES.second_face * heights[0]
    if crowded > len(checked) / 2:
        warnings.append("two people are in the picture: the larger face was taken")
    if best.height_px < TUNABLES.good_height_px:
        warnings.append(f"the face is only {best.height_px:.0f} pixels high: come nearer for a better subject")
    if best.turn_deg > TUNABLES.good_turn_deg:
        warnings.append(
            f"the face is turned by {best.turn_deg:.0f} degrees: look straight into the camera for a better subject"
        )
    if best.eyes < TUNABLES.open_eyes:
        warnings.append("the eyes are shut: capture again with them open")
    if best.mouth > TUNABLES.open_mouth:
        warnings.append("the mouth is open: capture again with it shut")
    return tuple(warnings)


def face_sharpness(image: DisplayImage, landmarks: Points) -> float:
    """Mean square of the Laplacian over the face's box, by that of its brightness."""
    gray = cv2.cvtColor(_cropped(image, landmarks)[0], cv2.COLOR_RGB2GRAY)
    return float(cv2.Laplacian(gray, cv2.CV_32F).var() / max(float(gray.astype(np.float32).var()), 1.0))


def _cropped(image: DisplayImage, landmarks: Points) -> tuple[DisplayImage, Points]:
    """The part of a picture that the landmarks' box has, of a pixel at least, and the corner of it."""
    x, y, width, height = bounding_box(landmarks)
    rows, columns = image.shape[:2]
    left, top = min(max(int(x), 0), columns - 1), min(max(int(y), 0), rows - 1)
    right, bottom = max(int(x + width) + 1, left + 1), max(int(y + height) + 1, top + 1)
    return np.ascontiguousarray(image[top:bottom, left:right]), np.array([left, top], np.float32)


def align_to(face: SeenFace, reference: SeenFace) -> Float64Array:
    """The similarity (2, 3) that brings the rigid landmarks of a face nearest to those of another."""
    return _similarity(face.landmarks, reference.landmarks)


def _similarity(points: Points, onto: Points) -> Float64Array:
    """The similarity (2, 3) that brings the rigid ones of landmarks nearest to those of others."""
    rigid = landmark_scheme(SCHEME).rigid_indices
    affine, _ = cv2.estimateAffinePartial2D(points[rigid], onto[rigid], method=cv2.LMEDS)
    return np.eye(2, 3) if affine is None else np.asarray(affine, np.float64)


def _shape_changes(faces: Sequence[SeenFace]) -> Float64Array:
    """Mean distances (face, reference) of landmarks aligned by the rigid ones, in heights of the reference.

    One half is of the lips, which are few, and tell most of the expression.
    """
    scheme = landmark_scheme(SCHEME)
    rigid, lips = scheme.rigid_indices, np.array(scheme.lips)
    # As complex numbers, of which one is a similarity about the origin: (faces, landmarks).
    points = np.stack([face.landmarks for face in faces]).astype(np.float64) @ np.array([1, 1j])
    points -= points[:, rigid].mean(axis=1, keepdims=True)
    fixed = points[:, rigid]
    sizes = np.maximum((np.abs(fixed) ** 2).sum(axis=1), 1e-9)
    changes = []
    for reference, face in zip(points, faces, strict=True):
        similarity = (fixed.conj() @ reference[rigid]) / sizes
        distance = np.abs(points * similarity[:, None] - reference)
        changes.append((distance.mean(axis=1) + distance[:, lips].mean(axis=1)) / 2 / max(face.height_px, 1.0))
    return np.stack(changes, axis=1)
