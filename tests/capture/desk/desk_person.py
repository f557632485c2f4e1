"""A person at a desk whose field is a formula: a white-lit ellipsoid of a head before flat shoulders, Lambertian."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array
from relit_camera.base.images.image_types import DisplayImage, Points
from relit_camera.capture.desk.desk_recording import CameraPlace, DeskRecording, DeskSetup, PatchGrid, Screen
from relit_camera.capture.desk.person.generic_head import ellipsoid_head
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.lab.evaluate.desk_simulation import (
    SimulatedFrames,
    SimulatedPerson,
    SimulatedWebcam,
    simulate_desk_recording,
)
from relit_camera.subject.reflectance_field import texel_vectors
from tests.capture.instant.canonical_person import canonical_landmarks, canonical_pose

SIZE = 96
PIXELS_PER_CM = 3.2
CENTER = (SIZE / 2, SIZE / 2 - 4)
SETUP = DeskSetup(
    screen=Screen(width_cm=58.5, height_cm=34.4),
    distance_cm=60,
    camera=CameraPlace(up_cm=18),
    patches=PatchGrid(columns=3, rows=2),
)
WEBCAM = SimulatedWebcam(size=(400, 300), noise=2, motion_mm=0, frames_a_pattern=6, fade_frames=2)


@dataclass(frozen=True)
class LambertianField:
    """n · l of a surface with an albedo.

    Attributes:
        normals: (pixels, 3).
        albedo: (pixels, 3).
        shape: height and width.
    """

    normals: Float32Array
    albedo: Float32Array
    shape: tuple[int, int]

    @property
    def size(self) -> tuple[int, int]:
        return self.shape

    def dense(self, start: int, stop: int) -> Float32Array:
        return self.at(texel_vectors(), np.arange(start, stop)).transpose(1, 0, 2)

    def at(self, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> Float32Array:
        cosines = np.maximum(directions.astype(np.float32) @ self.normals[pixels].T, 0)
        return np.asarray(cosines[..., None] * self.albedo[pixels], np.float32)


def face_landmarks(side: int) -> Points:
    """The person's landmarks of `mesh478` in the subject's picture, whose side shows 28 cm."""
    scale = side / 28
    points = canonical_landmarks(canonical_pose(side, pixels_per_cm=scale), side)
    return np.asarray(points - (0, 1.4 * scale), np.float32)


def lambertian_person(skin: float = 1.0, eye_whites: float | None = None) -> SimulatedPerson:
    """The person, with freckles and a brow by which pictures can be aligned.

    Args:
        skin: factor of the albedo of everything but the eyes.
        eye_whites: albedo of the whites of the eyes; None paints no eyes.
    """
    y, x = np.mgrid[:SIZE, :SIZE] + 0.5
    across, up = (x - CENTER[0]) / PIXELS_PER_CM, (CENTER[1] - y) / PIXELS_PER_CM
    head = (across / 7.8) ** 2 + ((up - 1.5) / 11.8) ** 2 < 1
    body = (np.abs(across) < 5.5) & (up < 0) & (up > -13) | (up < -12) & (np.abs(across) < 14)
    matte = (head | body).astype(np.float32)
    shape = ellipsoid_head(CENTER, PIXELS_PER_CM, matte)
    albedo = np.full((SIZE, SIZE, 3), (0.5, 0.36, 0.3))
    spots = np.random.default_rng(3).uniform(0.6, 1.0, (SIZE // 4, SIZE // 4)).repeat(4, 0).repeat(4, 1)
    albedo *= spots[..., None]
    albedo[(np.abs(up - 3) < 0.6) & (np.abs(np.abs(across) - 3) < 1.6)] *= 0.4
    albedo *= skin
    if eye_whites is not None:
        paint_eyes(albedo, eye_whites)
    field = LambertianField(shape.normals.reshape(-1, 3), albedo.reshape(-1, 3).astype(np.float32), (SIZE, SIZE))
    depth = shape.points_cm[..., 2] * PIXELS_PER_CM
    return SimulatedPerson(field, depth, matte, PIXELS_PER_CM, (*CENTER, 7 * PIXELS_PER_CM))


def paint_eyes(albedo: NDArray[np.float64], white: float) -> None:
    """Paint the whites of the eyes, with an iris each, where `face_landmarks` has them."""
    scheme = landmark_scheme("mesh478")
    # In the unit of centimeters from the middle of the face, which lies 1.4 cm above that of the subject's picture.
    points = (face_landmarks(28) - (14, 12.6)) * PIXELS_PER_CM + CENTER
    for eye in (scheme.right_eye, scheme.left_eye):
        cv2.fillPoly(albedo, [np.round(points[list(eye.lids)] - 0.5).astype(np.int32)], (white, white, white))
        x, y = points[eye.iris[0]] - 0.5
        cv2.circle(albedo, (round(float(x)), round(float(y))), 1, (0.05, 0.05, 0.05), -1)


def film(
    person: SimulatedPerson,
    shown: DeskSetup = SETUP,
    said: DeskSetup | None = None,
    webcam: SimulatedWebcam = WEBCAM,
    change: Callable[[int, DisplayImage], DisplayImage] | None = None,
    room_picture: bool = False,
) -> DeskRecording:
    """A recording whose frames are made once."""
    recording = simulate_desk_recording(person, shown, webcam, said, room_picture=room_picture)
    frames = recording.frames
    assert isinstance(frames, SimulatedFrames)
    if change is not None:
        frames = replace(frames, change=change)
    return replace(recording, frames=[frames[index] for index in range(len(frames))])
