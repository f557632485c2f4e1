"""Measures mode live from the first frame on, against truth: `python -m tests.first_second SUBJECT CLIP TRUTH MATTE
--environment NAME [--tracker recorded:TRACK.json] [--every N]`.

CLIP is the live video, TRUTH a video of the same performance in the light of the environment, MATTE one that is bright
where the person is; --every says that both have only every N-th frame of the clip. Printed is, frame by frame, the PSNR
of sRGB codes within the matte, one gain of light a frame: of the live frame itself, and of what is shown where the
picture as filmed may be shown and where it may not.
"""

from __future__ import annotations

import argparse
from itertools import takewhile
from pathlib import Path

import cv2
import numpy as np

from relit_camera.app.wiring import make_pipeline, make_tracker
from relit_camera.base.concurrency.threads import limit_threads
from relit_camera.base.config.look import Look, Mode
from relit_camera.base.config.settings import RelitSettings, TrackerSettings
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.cli.arguments import parse_background, parse_lighting
from relit_camera.lab.evaluate.video.moving_face_accuracy import codes_psnr, with_best_gain
from relit_camera.live.scene.scene_controller import SceneController


def read_frames(video: Path, seconds: float) -> list[Frame]:
    """The frames of a video up to a time."""
    with VideoReader(video) as frames:
        return list(takewhile(lambda frame: frame.time_s <= seconds, frames))


def relit(
    frames: list[Frame], subject: Path, environment: str, tracker: str, unlit_allowed: bool
) -> list[DisplayImage]:
    """What mode live shows of them, the room left as it is."""
    settings = RelitSettings().model_copy(update={"tracker": TrackerSettings(name=tracker)})
    controller = SceneController(settings.storage)
    controller.set_unlit_allowed(unlit_allowed)
    controller.load_configured_subject(str(subject))
    lighting = parse_lighting(controller.register_temporary_environment(environment), "0,0,0", 0.0)
    controller.set_look(Look(lighting=lighting, background=parse_background("none"), mode=Mode.LIVE))
    pipeline = make_pipeline(settings, make_tracker(settings), frames[0].size)
    try:
        return [pipeline.process(frame, controller.scene).image for frame in frames]
    finally:
        pipeline.close()


def accuracy(shown: DisplayImage, truth: DisplayImage, matte: DisplayImage) -> float:
    """PSNR in dB of codes within the matte, one gain of light."""
    seen = np.asarray(cv2.resize(shown, truth.shape[1::-1], interpolation=cv2.INTER_AREA), np.uint8)
    inside = matte[..., 1] > 127
    return codes_psnr(with_best_gain(seen, truth, inside), truth, inside)


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(prog="python -m tests.first_second", description=__doc__)
    for name in ("subject", "clip", "truth", "matte"):
        parser.add_argument(name, type=Path)
    parser.add_argument("--environment", required=True)
    parser.add_argument("--tracker", default="mesh")
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=1.0)
    options = parser.parse_args()
    limit_threads()
    live, truth, mattes = (read_frames(path, options.seconds) for path in (options.clip, options.truth, options.matte))
    ways = {"live": [frame.image for frame in live]}
    for name, allowed in (("as filmed allowed", True), ("as filmed private", False)):
        ways[name] = relit(live, options.subject, options.environment, options.tracker, allowed)
    table = {
        name: [
            accuracy(shown, known.image, matte.image)
            for shown, known, matte in zip(pictures[:: options.every], truth, mattes, strict=True)
        ]
        for name, pictures in ways.items()
    }
    print("time, s  " + "  ".join(f"{name:>18}" for name in table))
    for index, row in enumerate(zip(*table.values(), strict=True)):
        print(f"{live[index * options.every].time_s:7.3f}  " + "  ".join(f"{value:18.1f}" for value in row))
    print("   mean  " + "  ".join(f"{np.mean(values):18.2f}" for values in table.values()))


if __name__ == "__main__":
    main()
