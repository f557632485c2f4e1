"""The pass over a film that reads gains, highlights and the distance of the eyes from its bright and dark frames."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from relit_camera.base.array_types import Indices
from relit_camera.base.images.color import uint8_from_linear
from relit_camera.base.video.video_readers import LinearVideoFrame
from relit_camera.capture.film.ball.ball_detection import DetectedBall
from relit_camera.capture.film.ball.ball_tracking import BallRecorder, ObservedBall
from relit_camera.capture.film.ball.frame_sample import FrameSample
from relit_camera.capture.film.ball.sphere_projection import PinholeView
from relit_camera.capture.film.face_localization import median_eye_distance_px
from relit_camera.capture.film.flash.frame_classification import Flashes, FrameClass
from relit_camera.capture.film.olat.camera_gains import FrameGains, downsample_for_gains, estimate_gains
from relit_camera.face.detection.face_detector import FaceDetector

_PORTRAITS = 8
"""Bright frames in which the eyes are looked for."""


@dataclass(frozen=True, eq=False)
class UsableFrames:
    """The bright and dark frames in which the face was found.

    Attributes:
        bright, dark: growing indices.
    """

    bright: Indices
    dark: Indices

    @classmethod
    def from_flashes(cls, flashes: Flashes, lost: frozenset[int]) -> UsableFrames:
        """The frames of these flashes but those in which the face is lost."""
        without = list(lost)
        return cls(
            np.setdiff1d(flashes.indices(FrameClass.BRIGHT), without),
            np.setdiff1d(flashes.indices(FrameClass.DARK), without),
        )

    @property
    def all(self) -> Indices:
        """Growing indices of both."""
        return np.union1d(self.bright, self.dark)


@dataclass(frozen=True, eq=False)
class FilmMeasurements:
    """What the usable frames show of camera and light.

    Attributes:
        gains: the camera's, of `UsableFrames.all` in order.
        balls: the mirror balls with their highlights.
        eyes_px: median distance of the pupils; None where they were not found.
    """

    gains: FrameGains
    balls: tuple[ObservedBall, ...]
    eyes_px: float | None


def measure_film(
    film: Iterable[LinearVideoFrame],
    usable: UsableFrames,
    flashes: Flashes,
    balls: Sequence[DetectedBall],
    sample: FrameSample,
    detector: FaceDetector | None,
) -> FilmMeasurements:
    """Read the usable frames of a film.

    Args:
        film: the frames `usable.all` in order.
        usable: which of them are bright and dark.
        flashes: of the film.
        balls: those found in the sample.
        sample: of the film's frames.
        detector: of faces, None where it is not installed.
    """
    focal_px = balls[-1].focal.pixels
    recorders = [BallRecorder(ball, sample, PinholeView(ball.outline, sample.size, focal_px)) for ball in balls]
    cells, portraits = [], []
    chosen = frozenset(usable.bright[:: max(1, len(usable.bright) // _PORTRAITS)].tolist())
    dark = frozenset(usable.dark.tolist())
    for frame in film:
        for recorder in recorders:
            recorder.add(frame.index, frame.image, dark=frame.index in dark)
        cells.append(downsample_for_gains(frame.image))
        if frame.index in chosen:
            portraits.append(uint8_from_linear(frame.image))
    frames = usable.all
    flash = np.array([flashes.frames[index].flash for index in frames])
    return FilmMeasurements(
        estimate_gains(np.stack(cells), flashes.times_s[frames], np.isin(frames, usable.bright), flash),
        tuple(recorder.observed(usable.bright.tolist()) for recorder in recorders),
        median_eye_distance_px(portraits, detector) if detector else None,
    )
