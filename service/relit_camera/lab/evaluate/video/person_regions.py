"""Parts of a person in a picture, by landmarks and matte: face, mouth, eyes, far cheek, hair, neck, body and rim."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import Mask, Points
from relit_camera.base.rotations import angles_from_rotation
from relit_camera.face.head_pose import HeadPose
from relit_camera.face.landmarks.landmark_schemes import Indices, LandmarkScheme

Region = NDArray[np.bool_]

INSIDE = 0.5
"""Matte from which a pixel is the person's."""
OPEN_MOUTH, SHUT_EYES = 0.12, 0.07
"""Opening of the mouth from which it counts as open, and of the lids below which they count as shut."""
FAR_CHEEK_DEG = 25.0
"""Yaw from which the half of the face that turns away counts by itself."""
BOX_MARGIN = 0.2
"""Eye distances round lips or lids that their box takes in."""
RIM = 0.25
"""Eye distances inside the person's outline that count as its rim."""


def person_regions(matte: Mask, landmarks: Points, scheme: LandmarkScheme, pose: HeadPose) -> dict[str, Region]:
    """The parts of the person in one frame, (height, width) each; those that are not seen or do not apply are left out.

    `person`, `face`, `hair` (and ears), `neck` (and collar), `body` (neck and shoulders), `rim`, `mouth` while it is
    open, `eyes` while they are shut, `far cheek` while the head is turned away.

    Args:
        matte: (height, width) 0..1.
        landmarks: (count, 2) pixels, where they truly are.
        scheme: of them.
        pose: of the head.
    """
    person = matte > INSIDE
    span = scheme.eye_span(landmarks)
    oval = _filled(landmarks[list(scheme.oval)], matte.shape)
    # The line through the jaw's corners parts what is above, hair and ears, from neck and body.
    up = scheme.eye_centers(landmarks).mean(axis=0) - landmarks[list(scheme.lips)].mean(axis=0)
    up = up / max(float(np.linalg.norm(up)), 1e-6)
    lips = landmarks[list(scheme.lips)].mean(axis=0)
    rows, columns = np.indices(matte.shape)
    above = (columns + 0.5 - lips[0]) * up[0] + (rows + 0.5 - lips[1]) * up[1] > 0
    chin = landmarks[list(scheme.oval)][:, 1].max()
    beside = np.abs(columns + 0.5 - lips[0]) < 1.6 * span
    reach = max(round(RIM * span), 1)
    core = cv2.erode(person.astype(np.uint8), np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)) > 0
    parts = {
        "person": person,
        "face": person & oval,
        "hair": person & above & ~oval,
        "neck": person & ~above & ~oval & beside & (rows < chin + 1.2 * span),
        "body": person & ~above & ~oval,
        "rim": person & ~core,
    }
    if scheme.mouth_opening(landmarks) > OPEN_MOUTH:
        parts["mouth"] = person & _box(landmarks, scheme.lips, BOX_MARGIN * span, matte.shape)
    if max(scheme.eyes_opening(landmarks)) < SHUT_EYES:
        eyes = [
            _box(landmarks, eye.lids, BOX_MARGIN * span, matte.shape) for eye in (scheme.right_eye, scheme.left_eye)
        ]
        parts["eyes"] = person & (eyes[0] | eyes[1])
    yaw = angles_from_rotation(pose.rotation).yaw
    if abs(yaw) >= FAR_CHEEK_DEG:
        # The half beyond the line from the forehead's middle to the chin, on the side that the nose points to.
        side = np.array([up[1], -up[0]]) * -np.sign(yaw)
        middle = landmarks[list(scheme.rigid)].mean(axis=0)
        beyond = (columns + 0.5 - middle[0]) * side[0] + (rows + 0.5 - middle[1]) * side[1] > 0
        parts["far cheek"] = person & oval & beyond
    return {name: part for name, part in parts.items() if part.any()}


def _filled(points: Points, shape: tuple[int, ...]) -> Region:
    drawn = np.zeros(shape, np.uint8)
    cv2.fillPoly(drawn, [np.round(points - 0.5).astype(np.int32)], 1)
    return drawn > 0


def _box(landmarks: Points, group: Indices, margin: float, shape: tuple[int, ...]) -> Region:
    points = landmarks[list(group)]
    left, top = np.floor(points.min(axis=0) - margin).astype(int)
    right, bottom = np.ceil(points.max(axis=0) + margin).astype(int)
    box = np.zeros(shape, bool)
    box[max(top, 0) : max(bottom, 0), max(left, 0) : max(right, 0)] = True
    return box
