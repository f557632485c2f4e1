"""The moving person as each mode shows them, against the truth: figures by part, and a sheet to look at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relit_camera.app.replay.video_replay import replay
from relit_camera.app.wiring import make_pipeline, make_tracker
from relit_camera.base.config.look import Lighting, Look, Mode
from relit_camera.base.config.settings import RelitSettings, SourceSettings, TrackerSettings
from relit_camera.base.images.contact_sheet import contact_sheet
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.capture.instant.frame_reading import read_frames
from relit_camera.capture.instant.instant_capture import capture_instant
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.tracking.track_recording import RecordedTracker
from relit_camera.face.tracking.trackers import TrackerOptions
from relit_camera.lab.evaluate.video.moving_face_accuracy import PartAccuracy, PartFigures
from relit_camera.lab.evaluate.video.person_regions import Region, person_regions
from relit_camera.light.environments.environment_panorama import Environment
from relit_camera.live.scene.scene import Scene
from relit_camera.subject.subject import Subject

FILMED, INSTANT = "filmed", "live, instant"
"""The rows of the picture as filmed, and of mode live with a subject made of the clip."""
FIRST_FRAME = 2
"""From here on frames count, so that the rows compare with those of a mode live that eased in at the start."""
SHEET_FRAMES = 6


@dataclass(frozen=True)
class TrueFrame:
    """A frame of the truth, and where the parts of the person are in it."""

    image: DisplayImage
    parts: Mapping[str, Region]


def read_truth(folder: Path) -> list[TrueFrame]:
    """The frames of a rendered truth (see `MovingTruth.truth`).

    Raises:
        VideoError: a video cannot be read.
        TrackError: the track cannot be read.
    """
    track = RecordedTracker(TrackerOptions(argument=str(folder / "track.json")))
    scheme = landmark_scheme(track.scheme)
    frames = []
    with VideoReader(folder / "clip.mp4") as clip, VideoReader(folder / "matte.mp4") as mattes:
        for frame, matte in zip(clip, mattes, strict=True):
            state = track.track(frame)
            assert state.pose is not None
            person = np.asarray(matte.image[..., 1] / 255, np.float32)
            frames.append(TrueFrame(frame.image, person_regions(person, state.landmarks, scheme, state.pose)))
    return frames


def capture_from_clip(clip: Path) -> Subject:
    """An instant subject made of a person before a webcam, as they would make it in their own room.

    Raises:
        VideoError: the clip cannot be read.
        CaptureError: nobody can be captured from it, such as in too little light.
        ModelError: the networks are not there.
    """
    read = read_frames(str(clip / "clip.mp4"), SourceSettings())
    return capture_instant(read.frames, clip.name).subject


def evaluate_mode(
    clip: Path, truth: Sequence[TrueFrame], subject: Subject, light: Environment, mode: Mode, tracker: str
) -> tuple[PartFigures, list[DisplayImage]]:
    """The figures of a clip as a mode shows it in a light, and the pictures that were compared.

    Args:
        clip: folder of the person before a webcam.
        truth: the frames of the same performance in that light.
        subject: the person.
        light: what is wanted.
        mode: of the camera.
        tracker: name of the tracker.

    Raises:
        VideoError: the clip cannot be read, no face is found in it, or it is not of the truth's length.
        ModelError: the tracker's networks are missing.
    """
    settings = RelitSettings(tracker=TrackerSettings(name=tracker))
    lighting = Lighting(environment=light.name)
    scene = Scene(Look(lighting=lighting, mode=mode), light, subject=subject, unlit_allowed=True, avatar_allowed=True)
    follower = make_tracker(settings)
    figures, shown = PartAccuracy(), []

    def watch(index: int, live: DisplayImage, relit: DisplayImage) -> None:
        if index >= FIRST_FRAME:
            shown.append(figures.add(relit, truth[index].image, truth[index].parts))

    replay(clip / "clip.mp4", None, lambda size: make_pipeline(settings, follower, size), lambda _: scene, watch)
    return figures.figures(), shown


def evaluate_filmed(clip: Path, truth: Sequence[TrueFrame]) -> tuple[PartFigures, list[DisplayImage]]:
    """The figures of the clip as it was filmed, and its pictures.

    Raises:
        VideoError: the clip cannot be read.
    """
    figures, shown = PartAccuracy(), []
    with VideoReader(clip / "clip.mp4") as frames:
        for frame, true in list(zip(frames, truth, strict=True))[FIRST_FRAME:]:
            figures.add(frame.image, true.image, true.parts)
            shown.append(frame.image)
    return figures.figures(), shown


def error_sheet(truth: Sequence[TrueFrame], rows: Mapping[str, Sequence[DisplayImage]]) -> DisplayImage:
    """Some frames of the truth and of each row, cut about the person; below each row twice its error about gray."""
    chosen = range(0, len(truth) - FIRST_FRAME, max((len(truth) - FIRST_FRAME) // SHEET_FRAMES, 1))
    true = [truth[FIRST_FRAME + index] for index in chosen]
    columns = np.flatnonzero(np.any([each.parts["person"].any(axis=0) for each in true], axis=0))
    across = slice(columns[0], columns[-1] + 1)
    pictures, labels = [[each.image[:, across] for each in true]], ["truth"]
    for name, shown in rows.items():
        pictures.append([np.ascontiguousarray(shown[index][:, across]) for index in chosen])
        errors = [_error(shown[index], each.image) for index, each in zip(chosen, true, strict=True)]
        pictures.append([np.ascontiguousarray(error[:, across]) for error in errors])
        labels += [name, "error"]
    return contact_sheet(pictures, labels, cell_width=across.stop - across.start)


def _error(shown: DisplayImage, truth: DisplayImage) -> DisplayImage:
    return np.asarray(np.clip(128 + 2 * (shown.astype(np.int16) - truth), 0, 255), np.uint8)
