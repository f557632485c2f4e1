"""Measures how steady the relit face is: `python -m tests.steadiness SUBJECT CLIP [--minutes 10] [--still]`.

The clip is played forwards and backwards, so that nothing in it jumps, for some minutes of virtual time: as fast as the
pictures can be made. In each mode the change of the relit face from frame to frame is compared with that of the live
face: a picture that pops, flickers or pumps changes more than what it shows. With `--still` its first frame is shown
for ten seconds instead, each time with other noise (sigma 3 codes).

A change is the mean absolute difference of sRGB codes on the face, of 255; `coarse` is that of pictures blurred by a
25th of the face's width, in which noise hardly counts.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.app.wiring import make_pipeline, make_tracker
from relit_camera.base.concurrency.threads import limit_threads
from relit_camera.base.config.look import Look, Mode
from relit_camera.base.config.settings import RelitSettings, TrackerSettings
from relit_camera.base.images.image_types import DisplayImage, Frame, Points
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.cli.arguments import parse_background, parse_lighting
from relit_camera.face.landmarks.landmark_schemes import LandmarkScheme, landmark_scheme
from relit_camera.live.reenactment.source_image import find_source_face
from relit_camera.live.reenactment.warp import inverse_affine, source_from_output
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.subject.subject_file import read_subject

STILL_S, SIGMA = 10.0, 3.0
"""How long a still picture is shown, and the noise on it, in codes."""
START_S = 1.0
"""What comes before is not counted: the neutral face is taken then."""
COARSE = 1 / 25
"""Sigma of the blur, in widths of the face."""


@dataclass
class Changes:
    """Changes of one face from frame to frame; `fine` and `coarse` hold one value a frame."""

    fine: list[float]
    coarse: list[float]
    last: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None

    def add(self, picture: DisplayImage, oval: Points) -> None:
        """Compare a picture with the last one, inside the outline of the face."""
        inside = np.zeros(picture.shape[:2], np.uint8)
        cv2.fillPoly(inside, [np.round(oval).astype(np.int32)], 1)
        now = picture.astype(np.float32)
        soft = cv2.GaussianBlur(now, (0, 0), COARSE * float(np.ptp(oval[:, 0])))
        if self.last is not None:
            for kept, one, other in zip((self.fine, self.coarse), self.last, (now, soft), strict=True):
                kept.append(float(np.abs(other - one)[inside > 0].mean()))
        self.last = now, np.asarray(soft, np.float32)


def talking(frames: list[DisplayImage], fps: float, seconds: float) -> Iterator[Frame]:
    """Frames forwards and backwards, for some time."""
    there_and_back = [*frames, *frames[-2:0:-1]]
    for index in range(round(seconds * fps)):
        yield Frame(there_and_back[index % len(there_and_back)], index, index / fps, index / fps)


def still(frame: DisplayImage, fps: float) -> Iterator[Frame]:
    """One picture with new noise in each frame."""
    random = np.random.default_rng(0)
    for index in range(round(STILL_S * fps)):
        noisy = frame + random.normal(0, SIGMA, frame.shape)
        yield Frame(np.clip(np.rint(noisy), 0, 255).astype(np.uint8), index, index / fps, index / fps)


def watch(frames: Iterator[Frame], subject: Path, environment: str, mode: Mode) -> tuple[Changes, Changes, float]:
    """Changes of the live and of the relit face, and the largest excess of the second over the first that follows."""
    settings = RelitSettings().model_copy(update={"tracker": TrackerSettings(name="mesh")})
    controller = SceneController(settings.storage)
    controller.set_unlit_allowed(True)
    controller.load_configured_subject(str(subject))
    lighting = parse_lighting(controller.register_temporary_environment(environment), "0,0,0", 0.0)
    controller.set_look(Look(lighting=lighting, background=parse_background("none"), mode=mode))
    tracker = make_tracker(settings)
    scheme, pipeline, at_rest = landmark_scheme(tracker.scheme), None, None
    live, relit = Changes([], []), Changes([], [])
    for frame in frames:
        if pipeline is None:
            pipeline = make_pipeline(settings, tracker, frame.size)
            at_rest = placed_oval(subject, scheme, frame.size)
        rendered = pipeline.process(frame, controller.scene)
        if frame.time_s < START_S or rendered.motion is None or at_rest is None:
            continue
        oval = rendered.motion.landmarks[list(scheme.oval)]
        live.add(frame.image, oval)
        relit.add(rendered.image, oval if mode is Mode.LIVE else at_rest)
    if pipeline is not None:
        pipeline.close()
    return live, relit, float(np.max(np.array(relit.coarse) - live.coarse))


def placed_oval(subject: Path, scheme: LandmarkScheme, size: tuple[int, int]) -> Points:
    """The outline of the subject's face as it lies at rest in a picture of that size."""
    person = read_subject(subject)
    face = find_source_face(person, make_tracker(RelitSettings(tracker=TrackerSettings(name="mesh"))))
    output = inverse_affine(source_from_output(person.size, size))
    return np.asarray(face.landmarks[list(scheme.oval)] @ output[:, :2].T + output[:, 2], np.float32)


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(prog="python -m tests.steadiness", description=__doc__)
    parser.add_argument("subject", type=Path)
    parser.add_argument("clip", type=Path)
    parser.add_argument("--environment", default="sunset")
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--still", action="store_true")
    options = parser.parse_args()
    limit_threads()
    with VideoReader(options.clip) as reader:
        fps, pictures = reader.info.fps, [frame.image for _, frame in zip(count(), reader, strict=False)]
    print(f"{'mode':10}{'frames':>8}  change, mean (largest): {'live':>15} {'relit':>15} {'live, coarse':>15} "
          f"{'relit, coarse':>15} {'largest excess':>15}")  # fmt: skip
    for mode in Mode:
        frames = still(pictures[0], fps) if options.still else talking(pictures, fps, 60 * options.minutes)
        live, relit, excess = watch(frames, options.subject, options.environment, mode)
        cells = [
            f"{np.mean(each):.2f} ({np.max(each):.2f})" for each in (live.fine, relit.fine, live.coarse, relit.coarse)
        ]
        print(
            f"{mode!s:10}{len(live.fine):8}{'':26}" + "".join(f"{cell:>16}" for cell in cells) + f"{excess:16.2f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
