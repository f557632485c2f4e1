"""Control points, which carry the motion: chosen landmarks, and anchors on skull, hair, neck and shoulders."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.face.head_pose import HeadPose, project
from relit_camera.face.landmarks.landmark_schemes import Indices, LandmarkScheme
from relit_camera.live.reenactment.dense_motion import Influence, box_around
from relit_camera.live.reenactment.source_image import SourceFace

MAX_LANDMARKS = 180
SKULL_CENTER = np.array([0.0, 3.0, -5.0])
"""Middle of the skull in head axes, cm. The canonical face spans y −9…8 and z −3…8 with the nose in front."""
SKULL_RADII = ((8.6, 11.5), (11.0, 14.5))
"""Half width and half height, cm, of two rings round the skull: the outline and beyond the hair."""
EARS_AND_JAW = np.array(
    [
        (s * x, y, z)
        for s in (-1, 1)
        for x, y, z in ((7.7, 2.5, -3.0), (7.9, -0.5, -3.0), (7.2, -4.0, -3.0), (6.2, -7.0, -2.5))
    ]
)
"""Ears and the jaw behind the face's outline, head axes, cm: they turn with the head."""
NECK_PIVOT = np.array([0.0, -7.0, -7.0])
"""Where the head turns on the neck, head axes, cm."""
SHOULDER_ANCHORS_CM = np.array([(x, y) for y in (-7.5, -12.0) for x in (-16.0, -11.0, -5.5, 0.0, 5.5, 11.0, 16.0)])
"""Points of neck and shoulders (cm from the pivot, picture plane) that stay where they are while the head turns."""
CROWN_OFFSET_CM = 6.0
_SKULL_AXIS = np.stack([SKULL_CENTER, SKULL_CENTER + [0, CROWN_OFFSET_CM, 0]])
_RIGID_POINTS = np.vstack([_SKULL_AXIS, EARS_AND_JAW])
# From one temple over the crown to the other: below are face and neck.
_RING_ANGLES = np.linspace(-0.12, np.pi + 0.12, 13)
_SKULL_RINGS = np.vstack(
    [np.column_stack([a * np.cos(_RING_ANGLES), b * np.sin(_RING_ANGLES)]) for a, b in SKULL_RADII]
)
"""Points of the outline (count, 2): cm to the right and up from the skull's center."""
SKULL_ABOVE_EARS, BEYOND_HAIR, SHOULDERS = np.s_[2:11], np.s_[13:26], np.s_[34:48]
"""Rows of `head_and_shoulder_anchors`: the skull's outline above the ears, the ring beyond the hair, the shoulders."""
SLIT_OFFSET = 3.0
"""Distance from the slit, in radii, at which the influence of closed lids and lips is centred: one side's influence
gives way to the other's within a third of the radius."""
FEATURE_REACH = 0.6
"""Radius of landmarks inside the outline by the distance of their neighbours: with 1 the nose, nearer to the camera
than all round it, falls 15 % short when the head turns. Of outline and anchors it is 1, or the hairline tears."""
FEATURE_MARGIN = 0.12
"""Eye distances round an eye or the mouth that its own flow takes in."""


@dataclass(frozen=True)
class ControlPoints:
    """Where the control points lie in the source image, and how far each one reaches.

    Attributes:
        chosen: indices of the landmarks among them, (landmarks,) int.
        source: (count, 2) float64 source pixels: chosen landmarks, then anchors.
        radius: (count,) float64 source pixels.
        pairs: (count, 2) int control points of upper and lower lids and inner lips that lie over each other.
        irises: control points of each iris, with its eye's pairs as rows of `pairs`.
        unit: the eye distance in source pixels.
    """

    chosen: NDArray[np.intp]
    source: NDArray[np.float64]
    radius: NDArray[np.float64]
    pairs: NDArray[np.intp]
    irises: tuple[tuple[NDArray[np.intp], NDArray[np.intp]], ...]
    unit: float

    def influence(self, target: NDArray[np.float64], up: NDArray[np.float64]) -> Influence:
        """How the points act when they must lie at `target` (count, 2); `up` is the face's upward unit vector there.

        Where a lid or lip meets its partner, their opposite motions would average, and a shut eye would show the
        eyeball. So each acts from its own side of the slit: its Gaussian is centred aside, as strong at the slit as
        before. Lids and lips that would cross meet in the middle. An iris behind shut lids moves nothing.
        """
        target, center = target.copy(), target.copy()
        strength = (self.unit / self.radius) ** 2
        upper, lower = self.pairs.T
        gap = (target[upper] - target[lower]) @ up
        crossing = np.minimum(gap, 0)[:, None] * up / 2
        target[upper] -= crossing
        target[lower] += crossing
        for side, sign in ((upper, 1.0), (lower, -1.0)):
            closeness = np.clip(1 - gap / (2 * self.radius[side]), 0, 1)
            center[side] = target[side] + (sign * SLIT_OFFSET * closeness * self.radius[side])[:, None] * up
            strength[side] *= np.exp((SLIT_OFFSET * closeness) ** 2 / 2)
        before = np.linalg.norm(self.source[upper] - self.source[lower], axis=1)
        for iris, rows in self.irises:
            if len(iris) and gap[rows].mean() < 0.5 * before[rows].mean():
                strength[iris] = 0
        return Influence(target, center, strength)


def control_points(face: SourceFace, anchors: NDArray[np.float64]) -> ControlPoints:
    """The control points of a source image: chosen landmarks and `anchors` (count, 2), for what has no landmarks."""
    scheme = face.scheme
    chosen = select_landmarks(scheme, face.landmarks.astype(np.float64))
    source = np.vstack([face.landmarks[chosen], anchors]).astype(np.float64)
    # A point reaches about as far as its neighbours are: fine on lips and lids, coarse on cheeks and hair.
    distance = np.sort(np.linalg.norm(source[:, None] - source[None], axis=2), axis=1)[:, 1:4].mean(axis=1)
    reach = np.ones(len(source))
    reach[: len(chosen)][~np.isin(chosen, scheme.oval)] = FEATURE_REACH
    span = scheme.eye_span(face.landmarks)
    place = {int(landmark): index for index, landmark in enumerate(chosen)}
    pairs: list[tuple[int, int]] = []
    irises = []
    for eye in (scheme.right_eye, scheme.left_eye):
        inner = eye.lids.index(eye.inner)
        upper, lower = eye.lids[1:inner], eye.lids[:inner:-1]
        rows = np.arange(len(pairs), len(pairs) + len(upper))
        pairs += [(place[u], place[v]) for u, v in zip(upper, lower, strict=True)]
        irises.append((np.array([place[i] for i in eye.iris], dtype=np.intp), rows))
    lips = zip(scheme.upper_lip_inner, scheme.lower_lip_inner, strict=True)
    pairs += [(place[u], place[v]) for u, v in lips if u != v]
    radius = np.clip(reach * distance, 0.03 * span, 0.5 * span)
    return ControlPoints(chosen, source, radius, np.array(pairs), tuple(irises), span)


def feature_boxes(face: SourceFace, landmarks: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Boxes (4,) round both eyes and the mouth, where the flow needs a fine grid, in the order of `feature_landmarks`.

    Args:
        face: the source image's face.
        landmarks: (count, 2) where all landmarks are.
    """
    margin = FEATURE_MARGIN * face.scheme.eye_span(face.landmarks)
    return [box_around(landmarks[list(group)], margin) for group in feature_landmarks(face.scheme)]


def feature_landmarks(scheme: LandmarkScheme) -> tuple[Indices, ...]:
    """Lids of both eyes, and lips."""
    return scheme.right_eye.lids, scheme.left_eye.lids, scheme.lips


def select_landmarks(scheme: LandmarkScheme, landmarks: NDArray[np.float64]) -> NDArray[np.intp]:
    """All points of lips, eyes, brows and outline, then others spread as evenly as can be, up to a limit."""
    if scheme.count <= MAX_LANDMARKS:
        return np.arange(scheme.count)
    kept = sorted({*scheme.lips, *scheme.eyes, *scheme.right_brow, *scheme.left_brow, *scheme.oval})
    distance = np.linalg.norm(landmarks[:, None] - landmarks[None, kept], axis=2).min(axis=1)
    while len(kept) < MAX_LANDMARKS:
        farthest = int(distance.argmax())
        kept.append(farthest)
        distance = np.minimum(distance, np.linalg.norm(landmarks - landmarks[farthest], axis=1))
    return np.array(sorted(kept))


def head_and_shoulder_anchors(pose: HeadPose, size: tuple[int, int]) -> NDArray[np.float64]:
    """Anchors (count, 2) of a person seen whole: what turns with the head, then neck and shoulders."""
    return np.vstack([rigid_head_anchors(pose, size), shoulder_anchors(pose, size)])


def rigid_head_anchors(pose: HeadPose, size: tuple[int, int]) -> NDArray[np.float64]:
    """Anchors (count, 2) of skull, hair, ears and jaw."""
    seen = project(_RIGID_POINTS, pose, size).astype(np.float64)
    return np.vstack([_skull_rings(seen[:2], pose), seen[2:]])


def skull_outline(pose: HeadPose, size: tuple[int, int]) -> NDArray[np.float64]:
    """Points (count, 2) round the head's outline in the picture.

    The outline of a round head does not turn with it: it follows the skull's centre, its size and its roll only.
    """
    return _skull_rings(project(_SKULL_AXIS, pose, size).astype(np.float64), pose)


def _skull_rings(axis: NDArray[np.float64], pose: HeadPose) -> NDArray[np.float64]:
    """The points of `skull_outline` from where the skull's center and its crown are seen, (2, 2)."""
    center, above = axis
    way = above - center
    up = way / max(math.hypot(*way), 1e-6)
    depth = pose.depth_of(SKULL_CENTER)
    rings = _SKULL_RINGS @ np.array([[-up[1], up[0]], up])
    return np.asarray(center + rings * (pose.focal_px / max(depth, 1.0)))


def shoulder_anchors(pose: HeadPose, size: tuple[int, int]) -> NDArray[np.float64]:
    """Points (count, 2) of neck and shoulders in the picture, below the neck's pivot."""
    pivot = project(NECK_PIVOT[None], pose, size)[0]
    depth = pose.depth_of(NECK_PIVOT)
    return np.asarray(pivot + SHOULDER_ANCHORS_CM * [1, -1] * (pose.focal_px / max(depth, 1.0)))
