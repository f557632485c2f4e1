"""A head whose field is a formula, and a tracker that knows where its face is in any picture of all of it."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

from relit_camera.base.images.image_types import Frame
from relit_camera.capture.instant.head_shape import fit_head_shape
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.capture.subject_builder import build_subject
from relit_camera.face.face_state import FaceState, FaceStatus
from relit_camera.face.head_pose import fit_pose
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.lab.evaluate.ladder.known_person import KnownPerson
from relit_camera.light.directions import fibonacci_directions
from tests.capture.instant.canonical_person import canonical_landmarks, canonical_pose, person_matte

SIZE, PIXELS_PER_CM = 64, 1.8
LIGHTS = 60


class KnownFace:
    """A tracker for square pictures of the whole head."""

    name, scheme = "known", "mesh478"

    def track(self, frame: Frame) -> FaceState:
        scheme = landmark_scheme(self.scheme)
        landmarks = head_landmarks() * np.float32(frame.size[0] / SIZE)
        pose = fit_pose(landmarks, scheme, frame.size)
        return FaceState(FaceStatus.FOUND, 1.0, self.scheme, landmarks, pose)

    def reset(self) -> None:
        """Nothing is kept between frames."""


@cache
def head_landmarks() -> np.ndarray:
    """Of the head, in its pictures of `SIZE` pixels."""
    return canonical_landmarks(canonical_pose(SIZE, 0.0, PIXELS_PER_CM), SIZE)


@cache
def head_samples() -> OlatSamples:
    """A matt, colored head with a darker right half, without shadows, under lights all round."""
    matte = cv2.GaussianBlur(person_matte(SIZE, PIXELS_PER_CM), (0, 0), 0.7)
    normals = fit_head_shape(head_landmarks(), matte).geometry.normals
    albedo = np.where(np.arange(SIZE)[None, :, None] < SIZE // 2, (0.5, 0.35, 0.28), (0.3, 0.2, 0.15))
    directions = fibonacci_directions(LIGHTS)
    shade = np.maximum(np.einsum("hwc,lc->lhw", normals, directions), 0) + 0.03
    pictures = shade[..., None] * albedo * matte[..., None]
    return OlatSamples(pictures.astype(np.float32), directions, matte)


@cache
def known_head() -> KnownPerson:
    """The head as a person whose field is known."""
    samples = head_samples()
    landmarks = {KnownFace.scheme: head_landmarks()}
    subject = build_subject(samples, "barycentric", "head", landmarks=landmarks, with_geometry=False)
    return KnownPerson("head", samples, subject)
