"""The face in every frame of a film: where it is, what it does, and how well it is seen."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import CaptureError
from relit_camera.base.images.color import linear_from_uint8, luminance
from relit_camera.base.images.image_types import DisplayImage, Frame, Points
from relit_camera.base.rotations import Rotation
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.capture.instant.face_selection import TRACKER, face_sharpness
from relit_camera.face.face_state import FaceState, FaceStatus
from relit_camera.face.head_pose import HeadPose, unproject
from relit_camera.face.landmarks.landmark_schemes import LandmarkScheme, landmark_scheme
from relit_camera.face.motion.neutral_face import NeutralFace, NeutralSample, is_frontal, neutral_face_of
from relit_camera.face.tracking.trackers import TrackerOptions, open_tracker

Progress = Callable[[str, int, int | None], None]
STAGE = "Following the face"


@dataclass(frozen=True)
class FilmTunables:
    """What a film must be like.

    Attributes:
        longest_s: seconds of it that are looked at.
        min_frames: with a face.
        min_height_px: height of the face's landmarks.
        min_luminance: linear mean of the face, below which noise is most of it.
        threads: of the decoder.
    """

    longest_s: float = 120.0
    min_frames: int = 24
    min_height_px: float = 60.0
    min_luminance: float = 0.008
    threads: int = 2


TUNABLES = FilmTunables()


@dataclass(frozen=True)
class TrackedFace:
    """The face in one frame.

    Attributes:
        index: of the frame, in order of presentation.
        time_s: of the frame.
        landmarks: (count, 2) float32 pixels.
        points: (count, 3) float64 head-space centimetres.
        pose: of the head, relative to the camera.
        eyes: mean opening of the eyes.
        mouth: opening of the mouth.
        sharpness: see `face_sharpness`.
    """

    index: int
    time_s: float
    landmarks: Points
    points: NDArray[np.float64]
    pose: HeadPose
    eyes: float
    mouth: float
    sharpness: float


@dataclass(frozen=True)
class TrackedFilm:
    """The faces in a film, and the neutral one.

    Attributes:
        name: of the film, as people call it.
        size: (width, height) of its pictures.
        scheme: of the landmarks.
        faces: in order of time, the whole face in the picture.
        neutral: the least active face.
    """

    name: str
    size: tuple[int, int]
    scheme: LandmarkScheme
    faces: tuple[TrackedFace, ...]
    neutral: NeutralFace

    def expression(self, face: TrackedFace) -> NDArray[np.float64]:
        """Head-space points (count, 3) of a face minus the neutral ones, centimetres."""
        return np.asarray(face.points - self.neutral.points)

    def rotation(self, face: TrackedFace) -> Rotation:
        """Of the head since the neutral pose."""
        return face.pose.rotation * self.neutral.pose.rotation.inv()


class FaceCollection:
    """The faces in the frames of a film, as they come: of a file, or of a webcam."""

    def __init__(self, scheme: str, name: str) -> None:
        """Begin a film.

        Args:
            scheme: name of the landmarks' scheme.
            name: what the film is called in messages.
        """
        self._name = name
        self._scheme = landmark_scheme(scheme)
        self._faces: list[TrackedFace] = []
        self._lights: list[float] = []
        self._read = 0
        self._size = (0, 0)

    def add(self, frame: Frame, state: FaceState) -> TrackedFace | None:
        """Take the face that a tracker found in the next frame, of one size; None where it is not seen whole."""
        self._size = frame.size
        self._read += 1
        if state.status is not FaceStatus.FOUND or state.pose is None or not _is_inside(state.landmarks, frame.size):
            return None
        face = _tracked(state, state.pose, self._scheme, frame.image, frame.index, frame.time_s)
        self._faces.append(face)
        self._lights.append(_face_light(frame.image, state.landmarks))
        return face

    def film(self) -> TrackedFilm:
        """The faces so far.

        Raises:
            CaptureError: too few frames show one, none from the front, or it is too small or in the dark.
        """
        _require_usable(self._faces, self._lights, self._read, self._name)
        frontal = [face for face in self._faces if is_frontal(face.pose)]
        if not frontal:
            raise CaptureError(
                f"the face in {self._name} never looks toward the camera", "look into the camera for a second or two"
            )
        neutral = neutral_face_of(
            [NeutralSample(face.time_s, NeutralFace(face.points, face.pose), face.eyes, face.mouth) for face in frontal]
        )
        return TrackedFilm(self._name, self._size, self._scheme, tuple(self._faces), neutral)


def track_film(path: Path, progress: Progress = lambda stage, done, total: None, first: int = 0) -> TrackedFilm:
    """Follow the face through a film, two minutes of it at most.

    Args:
        path: the film.
        progress: called with the stage's name, what is done, and the total.
        first: index of the first frame that is looked at.

    Raises:
        VideoError: the film cannot be read.
        CaptureError: as `FaceCollection.film`.
        ModelError: the tracker's networks are not there.
    """
    tracker = open_tracker(TRACKER, TrackerOptions(blendshapes=False))
    faces = FaceCollection(tracker.scheme, path.name)
    begins_s: float | None = None
    with VideoReader(path, threads=TUNABLES.threads, only=range(first, sys.maxsize)) as reader:
        for frame in reader:
            begins_s = frame.time_s if begins_s is None else begins_s
            if frame.time_s - begins_s > TUNABLES.longest_s:
                break
            progress(STAGE, frame.index + 1, reader.info.frames)
            faces.add(frame, tracker.track(frame))
    return faces.film()


def _tracked(
    state: FaceState, pose: HeadPose, scheme: LandmarkScheme, image: DisplayImage, index: int, time_s: float
) -> TrackedFace:
    points = unproject(state.landmarks, pose, scheme, (image.shape[1], image.shape[0]))
    sharpness = face_sharpness(image, state.landmarks)
    return TrackedFace(index, time_s, state.landmarks, points, pose, sum(state.eyes) / 2, state.mouth, sharpness)


def _is_inside(landmarks: Points, size: tuple[int, int]) -> bool:
    return bool((landmarks > 0).all() and (landmarks < size).all())


def _face_light(image: DisplayImage, landmarks: Points) -> float:
    """Mean linear luminance at the landmarks."""
    at = (landmarks - np.float32(0.5))[None]
    codes = cv2.remap(image, at, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return float(luminance(linear_from_uint8(np.asarray(codes, np.uint8))).mean())


def _require_usable(faces: list[TrackedFace], lights: list[float], read: int, name: str) -> None:
    if not faces:
        raise CaptureError(f"no face was found in {name}", "look into the camera, your whole face in the picture")
    if len(faces) < TUNABLES.min_frames:
        raise CaptureError(
            f"a face was found in {len(faces)} of the {read} frames of {name}, at least {TUNABLES.min_frames} are "
            "needed",
            "film half a minute, your whole face in the picture",
        )
    height = float(np.median([np.ptp(face.landmarks[:, 1]) for face in faces]))
    if height < TUNABLES.min_height_px:
        raise CaptureError(
            f"the face in {name} is {height:.0f} pixels high, at least {TUNABLES.min_height_px:.0f} are needed",
            "come nearer to the camera, or choose a larger picture size",
        )
    if float(np.median(lights)) < TUNABLES.min_luminance:
        raise CaptureError(f"it is too dark in {name}: the face is nearly black", "switch a light on")
