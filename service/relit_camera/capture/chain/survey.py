"""The passes over a video that find what its pictures show: flashes, face, ball, head motion, gains, highlights."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.ball.focal import Focal, given_focal, tagged_focal, typical_focal
from relit_camera.capture.ball.focal_tag import read_focal_tag
from relit_camera.capture.ball.sample import MAX_FRAMES, SceneSample, sample_scene
from relit_camera.capture.ball.view import PinholeView
from relit_camera.capture.chain.balls import BallLog, SeenBall, find_all
from relit_camera.capture.chain.options import CaptureOptions, Progress
from relit_camera.capture.face_circle import Circle
from relit_camera.capture.flash.brightness import watch
from relit_camera.capture.flash.classify import Flashes, find_flashes
from relit_camera.capture.flash.kind import Kind
from relit_camera.capture.light.gains import FrameGains, cells_of, find_gains
from relit_camera.capture.light.place import eye_distance
from relit_camera.capture.locate_face import LocatedFace, locate_face
from relit_camera.capture.stabilise.stabilise import Stabilisation, stabilise
from relit_camera.errors import ConfigError, ModelError
from relit_camera.face.detector import FaceDetector
from relit_camera.models.registry import model_path
from relit_camera.space.colour import uint8_from_linear
from relit_camera.video.linear import LinearReader

Indices = NDArray[np.intp]

_STILLS = 8


@dataclass(frozen=True, eq=False)
class Survey:
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
    motion: Stabilisation
    focal: Focal
    balls: tuple[SeenBall, ...]
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
        return np.setdiff1d(self.flashes.indices(Kind.DARK), list(self.motion.lost))


def survey(video: Path, options: CaptureOptions, progress: Progress) -> Survey:
    """Look a video over, four times.

    Raises:
        VideoError: it cannot be read, is cut off or damaged, or shows no face.
        ConfigError: the given face is outside of the picture.
        CaptureError: there is no flash, no mirror ball, or the face goes away; the message says what to do.
    """
    if options.face:
        _refuse_outside(options.face, video)
    seen = watch(
        video, options.gamma, threads=options.threads, progress=lambda done: progress("Looking for flashes", done, None)
    )
    total = len(seen.times_s)
    flashes = find_flashes(seen)
    progress("Looking for the mirror ball", 0, None)
    sample = _sample(video, flashes, options)
    found = find_all(sample, _focal(video, seen.size, options.focal_px), options)
    focal = found[-1].focal
    face = LocatedFace(options.face, "user") if options.face else locate_face(seen, flashes)
    motion = stabilise(
        video,
        flashes,
        face.circle,
        threads=options.threads,
        progress=lambda done: progress("Following the face", done, total),
    )
    bright, dark = (np.setdiff1d(flashes.indices(kind), list(motion.lost)) for kind in (Kind.BRIGHT, Kind.DARK))
    frames = np.union1d(bright, dark)
    logs = [BallLog(ball, sample, PinholeView(ball.outline, seen.size, focal.pixels)) for ball in found]
    cells, stills = [], []
    chosen = frozenset(bright[:: max(1, len(bright) // _STILLS)].tolist())
    is_dark = frozenset(dark.tolist())
    with LinearReader(video, options.gamma, only=frozenset(frames.tolist()), threads=options.threads) as reader:
        for frame in reader:
            for log in logs:
                log.add(frame.index, frame.image, dark=frame.index in is_dark)
            cells.append(cells_of(frame.image))
            if frame.index in chosen:
                stills.append(uint8_from_linear(frame.image))
            progress("Looking at the light", frame.index + 1, total)
    detector = _detector()
    flash = np.array([flashes.frames[index].flash for index in frames])
    return Survey(
        seen.size,
        flashes,
        face,
        detector is not None,
        eye_distance(stills, detector) if detector else None,
        motion,
        focal,
        tuple(log.seen(bright.tolist()) for log in logs),
        bright,
        find_gains(np.stack(cells), flashes.times_s[frames], np.isin(frames, bright), flash),
        frames,
    )


def _refuse_outside(face: Circle, video: Path) -> None:
    """Refuse a face whose middle is not in the video's picture, before a frame is read."""
    with LinearReader(video) as reader:
        width, height = reader.info.width, reader.info.height
    if not (0 <= face.x < width and 0 <= face.y < height):
        what = f"the face at {face.x:g}, {face.y:g} is outside of the picture, which is {width}x{height}"
        raise ConfigError(what, "give --face in pixels of the upright film, or leave it out")


def _sample(video: Path, flashes: Flashes, options: CaptureOptions) -> SceneSample:
    """As many dark frames as bright ones, spread over the video, in which to look for balls."""
    half = MAX_FRAMES // 2
    picked = [
        indices[:: max(1, -(-len(indices) // half))] for indices in map(flashes.indices, (Kind.BRIGHT, Kind.DARK))
    ]
    only = frozenset(np.concatenate(picked).tolist())
    with LinearReader(video, options.gamma, only=only, threads=options.threads) as reader:
        return sample_scene(frame.image for frame in reader)


def _focal(video: Path, size: tuple[int, int], given_px: float | None) -> Focal:
    if given_px is not None:
        return given_focal(given_px)
    tag_mm = read_focal_tag(video)
    return typical_focal(size) if tag_mm is None else tagged_focal(tag_mm, size)


def _detector() -> FaceDetector | None:
    try:
        return FaceDetector(model_path("face_detector_yunet"))
    except ModelError:  # that it is missing, the report's warnings say
        return None
