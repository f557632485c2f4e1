"""A head that is nobody's: the subject by which somebody is relit of whom no picture was taken yet.

Only the light on a live picture is exchanged, so what it says of color matters little; its shape is that of the mean
face with a mean skull, neck and chest, which the live face's landmarks bend to theirs.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import cv2
import numpy as np

from relit_camera.base.config.look import ANYONE
from relit_camera.base.images.image_types import Mask, Points
from relit_camera.base.rotations import Rotation
from relit_camera.capture.instant.face_selection import SCHEME
from relit_camera.capture.instant.head_shape import FOCAL_LENGTHS, HEAD
from relit_camera.capture.instant.instant_capture import capture_from_picture
from relit_camera.capture.instant.median_picture import MedianPicture
from relit_camera.face.head_pose import HeadPose, project
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.subject.subject import Subject

SIDE_PX, SIDE_CM = 112, 44.0
"""Of its picture; a person's own has more, but only detail that a stranger does not have anyway."""
SCHEMES = (SCHEME, "openseeface66")
"""Schemes of the landmarks that it keeps: those of all trackers."""
SKIN = (172, 130, 108)
"""sRGB of its picture, in even light."""
FRAME_LUMINANCE = 0.2
"""Of the room behind it: that of a well exposed picture."""
SOFT_PX = 1.0
"""Blur of its outline."""
SHOULDERS_CM = ((6.5, 2.0), (6.2, -11.0), (19.0, -16.0), (22.0, -40.0))
"""Right half of the outline of neck and shoulders, x and y in head axes."""


@lru_cache(maxsize=1)
def anyone() -> Subject:
    """The subject; it is made at the first call, in half a second of processor time."""
    scheme, size = landmark_scheme(SCHEME), (SIDE_PX, SIDE_PX)
    focal_px = FOCAL_LENGTHS * SIDE_PX
    pose = HeadPose(Rotation.identity(), np.array([0.0, 0.0, -focal_px * SIDE_CM / SIDE_PX]), focal_px)
    landmarks = project(scheme.canonical, pose, size).astype(np.float32)
    subject = capture_from_picture(
        MedianPicture(
            image=np.full((SIDE_PX, SIDE_PX, 3), SKIN, np.uint8),
            matte=_matte(landmarks, pose, size),
            landmarks=landmarks,
            frame_luminance=FRAME_LUMINANCE,
            frames=1,
        ),
        ANYONE,
    ).subject
    marks = {name: project(landmark_scheme(name).canonical, pose, size).astype(np.float32) for name in SCHEMES}
    of_nobody = {"method": ANYONE, "rung": None, "expected_db": None}
    return replace(subject, landmarks=marks, metadata=subject.metadata.model_copy(update=of_nobody))


def _matte(landmarks: Points, pose: HeadPose, size: tuple[int, int]) -> Mask:
    """Face, skull, neck and shoulders, (height, width)."""
    across, up, _ = HEAD.skull_radii
    angles = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    x, y, _ = HEAD.skull_center
    skull = np.stack([x + across * np.cos(angles), y + up * np.sin(angles), np.zeros(90)], axis=1)
    right = np.array([(x, y, 0.0) for x, y in SHOULDERS_CM])
    body = np.concatenate([right, right[::-1] * (-1, 1, 1)])
    outlines = [cv2.convexHull(landmarks)[:, 0], project(skull, pose, size), project(body, pose, size)]
    drawn = np.zeros(size[::-1], np.float32)
    for outline in outlines:
        cv2.fillPoly(drawn, [np.round(outline).astype(np.int32)], 1.0)
    return np.asarray(cv2.GaussianBlur(drawn, (0, 0), SOFT_PX), np.float32)
