"""The passes over a video that find what its pictures show: flashes, face, ball, head motion, gains, highlights."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import ConfigError, ModelError
from relit_camera.base.images.color import uint8_from_linear
from relit_camera.base.models.model_store import model_path
from relit_camera.base.video.video_readers import LinearVideoReader
from relit_camera.capture.film.ball.scene_sample import MAX_FRAMES, SceneSample, sample_scene
from relit_camera.capture.film.ball.sphere_projection import PinholeView
from relit_camera.capture.film.face_circle import FaceCircle
from relit_camera.capture.film.face_localization import LocatedFace, locate_face
from relit_camera.capture.film.flash.flash_signal import measure_brightness
from relit_camera.capture.film.flash.frame_classification import Flashes, FrameClass, detect_flashes
from relit_camera.capture.film.focal_length import (
    FocalLength,
    focal_length_from_option,
    focal_length_from_tag,
    read_focal_length_tag,
    typical_focal_length,
)
from relit_camera.capture.film.lamp.camera_gains import FrameGains, downsample_for_gains, estimate_gains
from relit_camera.capture.film.lamp.scene_layout import median_eye_distance_px
from relit_camera.capture.film.pipeline.ball_observations import BallRecorder, ObservedBall, find_capture_balls
from relit_camera.capture.film.pipeline.capture_options import CaptureOptions, Progress
from relit_camera.capture.film.stabilization.film_stabilization import Stabilization, stabilize_film
from relit_camera.face.tracking.face_detector import FaceDetector

Indices = NDArray[np.intp]

_STILLS = 8


@dataclass(frozen=True, eq=False)
class FilmAnalysis:
    """What a video shows.

    Attributes:
        size: width and height of its upright pictures.
        flashes: what its frames are.
        face: in the picture in which each pixel is as bright as it ever was.
        detector: whether one that finds the eyes is installed.
        eyes_px: distance of the eyes, None where they are not found.
        motion: where the face went.
        focal: of the camera.
        balls: the mirror balls, one or two.
        bright: growing indices of the bright frames about which the face was found.
        gains: of bright and dark frames, in the order of `frames`.
        frames: growing indices of those.
    """

    size: tuple[int, int]
    flashes: Flashes
    face: LocatedFace
    detector: bool
    eyes_px: float | None
    motion: Stabilization
    focal: FocalLength
    balls: tuple[ObservedBall, ...]
    bright: Indices
    gains: FrameGains
    frames: Indices

    @property
    def views(self) -> list[PinholeView]:
        """How the camera sees the balls."""
        return [PinholeView(ball.found.outline, self.size, self.focal.pixels) for ball in self.balls]

    @property
    def dark(self) -> Indices:
        """Dark frames about which the face was found."""
        return np.setdiff1d(self.flashes.indices(FrameClass.DARK), list(self.motion.lost))


def analyze_film(video: Path, options: CaptureOptions, progress: Progress) -> FilmAnalysis:
    """Look a video over, four times.

    Raises:
        VideoError: it cannot be read, is cut off or damaged, or shows no face.
        ConfigError: the given face is outside of the picture.
        CaptureError: there is no flash, no mirror ball, or the face goes away; the message says what to do.
    """
    if options.face:
        _require_face_inside(options.face, video)
    seen = measure_brightness(
        video, options.gamma, threads=options.threads, progress=lambda done: progress("Looking for flashes", done, None)
    )
    total = len(seen.times_s)
    flashes = detect_flashes(seen)
    progress("Looking for the mirror ball", 0, None)
    sample = _sample(video, flashes, options)
    found = find_capture_balls(sample, _focal(video, seen.size, options.focal_px), options)
    focal = found[-1].focal
    face = LocatedFace(options.face, "user") if options.face else locate_face(seen, flashes)
    motion = stabilize_film(
        video,
        flashes,
        face.circle,
        threads=options.threads,
        progress=lambda done: progress("Following the face", done, total),
    )
    bright, dark = (
        np.setdiff1d(flashes.indices(kind), list(motion.lost)) for kind in (FrameClass.BRIGHT, FrameClass.DARK)
    )
    frames = np.union1d(bright, dark)
    logs = [BallRecorder(ball, sample, PinholeView(ball.outline, seen.size, focal.pixels)) for ball in found]
    cells, stills = [], []
    chosen = frozenset(bright[:: max(1, len(bright) // _STILLS)].tolist())
    is_dark = frozenset(dark.tolist())
    with LinearVideoReader(video, options.gamma, only=frozenset(frames.tolist()), threads=options.threads) as reader:
        for frame in reader:
            for log in logs:
                log.add(frame.index, frame.image, dark=frame.index in is_dark)
            cells.append(downsample_for_gains(frame.image))
            if frame.index in chosen:
                stills.append(uint8_from_linear(frame.image))
            progress("Looking at the light", frame.index + 1, total)
    detector = _detector()
    flash = np.array([flashes.frames[index].flash for index in frames])
    return FilmAnalysis(
        seen.size,
        flashes,
        face,
        detector is not None,
        median_eye_distance_px(stills, detector) if detector else None,
        motion,
        focal,
        tuple(log.seen(bright.tolist()) for log in logs),
        bright,
        estimate_gains(np.stack(cells), flashes.times_s[frames], np.isin(frames, bright), flash),
        frames,
    )


def _require_face_inside(face: FaceCircle, video: Path) -> None:
    """Refuse a face whose middle is not in the video's picture, before a frame is read."""
    with LinearVideoReader(video) as reader:
        width, height = reader.info.width, reader.info.height
    if not (0 <= face.x < width and 0 <= face.y < height):
        what = f"the face at {face.x:g}, {face.y:g} is outside of the picture, which is {width}x{height}"
        raise ConfigError(what, "give --face in pixels of the upright film, or leave it out")


def _sample(video: Path, flashes: Flashes, options: CaptureOptions) -> SceneSample:
    """As many dark frames as bright ones, spread over the video, in which to look for balls."""
    half = MAX_FRAMES // 2
    picked = [
        indices[:: max(1, -(-len(indices) // half))]
        for indices in map(flashes.indices, (FrameClass.BRIGHT, FrameClass.DARK))
    ]
    only = frozenset(np.concatenate(picked).tolist())
    with LinearVideoReader(video, options.gamma, only=only, threads=options.threads) as reader:
        return sample_scene(frame.image for frame in reader)


def _focal(video: Path, size: tuple[int, int], given_px: float | None) -> FocalLength:
    if given_px is not None:
        return focal_length_from_option(given_px)
    tag_mm = read_focal_length_tag(video)
    return typical_focal_length(size) if tag_mm is None else focal_length_from_tag(tag_mm, size)


def _detector() -> FaceDetector | None:
    try:
        return FaceDetector(model_path("face_detector_yunet"))
    except ModelError:  # that it is missing, the report's warnings say
        return None
