"""Expression stills for a subject from a film of that person: from the frames to the stills."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relit_camera.app.captures.expressions.identity_check import IdentityTunables, shape_distance_cm, what_differs
from relit_camera.base.errors import CaptureError
from relit_camera.base.images.image_types import DisplayImage, Frame, Points
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.capture.expressions.film_tracking import FaceCollection, TrackedFace, TrackedFilm, track_film
from relit_camera.capture.expressions.still_crops import StillCropper
from relit_camera.capture.expressions.still_selection import Selection, select_stills
from relit_camera.capture.instant.face_selection import INTERVAL_S, SCHEME
from relit_camera.face.face_state import FaceState
from relit_camera.face.tracking.trackers import TrackerOptions, open_tracker
from relit_camera.light.light_map import LightMap
from relit_camera.light.light_map_rotation import rotate_light_map
from relit_camera.live.modes.room_light_estimator import RoomLightEstimator
from relit_camera.live.reenactment.source_image import SourceFace, find_source_face
from relit_camera.subject.expression_stills import ExpressionStill
from relit_camera.subject.subject import Subject

LIGHT_FRAMES, LIGHT_TIME_S = 40, 1.0
"""Frames that the room's light is estimated from, spread over the film, and the time between them that the estimator is
told, so that it fits the light to each."""
SAME_PERSON_S = 2.0
"""A face may not be another person's within this time of a still, before or after it."""
STAGE = "Estimating the light of the room"
Progress = Callable[[str, int, int | None], None]


@dataclass(frozen=True)
class ExpressionCapture:
    """Stills for a subject, and what they show.

    Attributes:
        stills: in order of time.
        selection: of the frames that they were made of.
    """

    stills: tuple[ExpressionStill, ...]
    selection: Selection


def capture_expressions(
    video: Path, subject: Subject, progress: Progress = lambda stage, done, total: None, first: int = 0
) -> ExpressionCapture:
    """Take expression stills of a subject from a film of that person in constant light.

    Args:
        video: the film; two minutes of it are looked at.
        subject: the person.
        progress: called with a stage's name, what is done, and the total.
        first: index of the first frame that is looked at.

    Raises:
        VideoError: the film cannot be read.
        CaptureError: no face is in it, another person's, or one that is too small, too dark or does too little.
        SubjectError: no face is found in the subject.
        ModelError: the networks are not there.
    """
    face = _source_face(subject)
    film = track_film(video, progress, first)
    selection = select_stills(film)
    with VideoReader(video, threads=2, only=frames_for_stills(film, selection)) as reader:
        pictures = ((frame.index, frame.image) for frame in reader)
        return _take_stills(subject, face, film, selection, pictures, progress)


def frames_for_stills(film: TrackedFilm, selection: Selection) -> set[int]:
    """Indices of the frames that stills are made of: the chosen ones, and those that the room's light is read from."""
    return {face.index for face in selection.faces} | _light_frames(film)


def take_stills(
    subject: Subject, film: TrackedFilm, selection: Selection, pictures: Iterable[tuple[int, DisplayImage]]
) -> ExpressionCapture:
    """Make the stills of a film whose faces are tracked and chosen.

    Args:
        subject: the person.
        film: its faces.
        selection: those that become stills.
        pictures: index and picture of the frames of `frames_for_stills`, in order of time.

    Raises:
        CaptureError: the face is another person's.
        SubjectError: no face is found in the subject.
        ModelError: the networks are not there.
    """
    return _take_stills(subject, _source_face(subject), film, selection, pictures)


def stills_of_frames(
    subject: Subject, frames: Sequence[DisplayImage], states: Sequence[FaceState], called: str
) -> ExpressionCapture:
    """Take expression stills from frames in memory, some tenths of a second apart.

    Args:
        subject: the person.
        frames: (height, width, 3) uint8, of one size, in order of time.
        states: the face in each, see `follow_face`.
        called: what they come from, for messages.

    Raises:
        CaptureError, SubjectError, ModelError: as `capture_expressions`.
    """
    faces = FaceCollection(SCHEME, called)
    for index, (image, state) in enumerate(zip(frames, states, strict=True)):
        faces.add(Frame(image, index, index * INTERVAL_S, index * INTERVAL_S), state)
    film = faces.film()
    return take_stills(subject, film, select_stills(film), enumerate(frames))


def _source_face(subject: Subject) -> SourceFace:
    return find_source_face(subject, open_tracker("mesh", TrackerOptions(blendshapes=False)))


def _light_frames(film: TrackedFilm) -> set[int]:
    spread = np.unique(np.linspace(0, len(film.faces) - 1, LIGHT_FRAMES).astype(int))
    return {film.faces[i].index for i in spread}


def _take_stills(
    subject: Subject,
    face: SourceFace,
    film: TrackedFilm,
    selection: Selection,
    pictures: Iterable[tuple[int, DisplayImage]],
    progress: Progress = lambda stage, done, total: None,
) -> ExpressionCapture:
    chosen, probed = {each.index: each for each in selection.faces}, _light_frames(film)
    last = max(chosen.keys() | probed)
    cropper = StillCropper(selection.faces, film.scheme, face.scheme.eye_span(face.landmarks))
    crops: dict[int, tuple[DisplayImage, Points]] = {}
    room = _RoomLight(subject, face, film)
    for index, picture in pictures:
        progress(STAGE, index, last)
        if index in probed:
            room.add(picture, index)
        if index in chosen:
            crops[index] = cropper.crop(picture, chosen[index])
        if index >= last:
            break
    _require_same_person(film, selection.faces, face, room.residual)
    stills = tuple(
        ExpressionStill(
            image,
            landmarks,
            film.expression(chosen[index]).astype(np.float32),
            film.rotation(chosen[index]).as_rotvec().astype(np.float32),
            rotate_light_map(room.light_map, film.rotation(chosen[index])),
        )
        for index, (image, landmarks) in crops.items()
    )
    return ExpressionCapture(stills, selection)


class _RoomLight:
    """The light of the room of a film, with the subject's field as probe.

    Attributes:
        light_map: (32, 64, 3) float32, after the frames so far.
    """

    def __init__(self, subject: Subject, face: SourceFace, film: TrackedFilm) -> None:
        self._estimator = RoomLightEstimator(subject, face)
        self._faces = {each.index: each for each in film.faces}
        self._film = film
        self._frames = 0
        self.light_map: LightMap = np.zeros((0, 0, 3), np.float32)
        self._residuals: list[float] = []

    def add(self, image: DisplayImage, index: int) -> None:
        """Fit the light to one more frame."""
        face = self._faces[index]
        estimate = self._estimator.update(image, face.landmarks, self._film.rotation(face), LIGHT_TIME_S * self._frames)
        self._frames += 1
        self.light_map = estimate.light_map
        self._residuals.append(estimate.residual)

    @property
    def residual(self) -> float:
        """How badly the light explains the face, see `RoomLightEstimate`: the median of the frames so far."""
        return float(np.median(self._residuals))


def _require_same_person(film: TrackedFilm, chosen: Sequence[TrackedFace], face: SourceFace, residual: float) -> None:
    """Raise CaptureError where shape and skin of the neutral face, or of a chosen one, are not the subject's.

    A grimace and a turn change the shape: of the frames round a chosen one the least distance counts.
    """
    times = np.array([each.time_s for each in film.faces])
    distances_cm = np.array([shape_distance_cm(each.points, face) for each in film.faces])
    shape_cm = shape_distance_cm(film.neutral.points, face)
    for each in chosen:
        near = np.abs(times - each.time_s) <= SAME_PERSON_S
        shape_cm = max(shape_cm, float(distances_cm[near].min()))
    differs = what_differs(shape_cm, residual, IdentityTunables())
    if differs is not None:
        raise CaptureError(
            f"the face in {film.name} is not the subject's: {differs}",
            "film the person whose subject it is, in soft light from the front",
        )
