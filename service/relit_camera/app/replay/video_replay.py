"""Relighting a recorded video: every frame goes through the pipeline once, as fast as it can."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relit_camera.base.errors import VideoError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.base.video.video_writer import VideoWriter
from relit_camera.face.face_state import FaceStatus
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.pipeline import Pipeline
from relit_camera.live.publishing.what_is_shown import Shown
from relit_camera.live.scene.scene import Scene


@dataclass(frozen=True)
class ReplayedFrame:
    """The record of one frame of a replay.

    Attributes:
        index: from 0 in presentation order.
        time_s: presentation time.
        motion: what the face did.
        shown: the kind of picture that was made.
        stage_ms: milliseconds of each stage that it went through.
    """

    index: int
    time_s: float
    motion: FaceMotion | None
    shown: Shown
    stage_ms: dict[str, float]

    def as_json(self) -> dict[str, object]:
        """The frame as the report has it; the pose is relative to neutral, in degrees."""
        angles = self.motion.angles if self.motion else None
        return {
            "index": self.index,
            "time_s": round(self.time_s, 6),
            "state": str(self.motion.status) if self.motion else "none",
            "shown": str(self.shown),
            "pose": {name: round(value, 4) for name, value in angles._asdict().items()} if angles else None,
            "stage_ms": {name: round(value, 3) for name, value in self.stage_ms.items()},
        }


def replay(
    video: Path,
    out: Path | None,
    pipeline_for: Callable[[tuple[int, int]], Pipeline],
    scene_at: Callable[[float], Scene],
    watch: Callable[[int, DisplayImage, DisplayImage], None] = lambda index, live, relit: None,
) -> list[ReplayedFrame]:
    """Relight `video` into `out`, at its own size and rate; odd sides lose their last column or row.

    Args:
        video: to read.
        out: to write, .mp4, .mkv or .mov; None writes nothing.
        pipeline_for: makes the pipeline for an output size (width, height).
        scene_at: the scene at a presentation time in seconds.
        watch: sees each frame's index, live picture and relit picture.

    Returns:
        One record a frame.

    Raises:
        VideoError: the video cannot be read to its end, or no face is in it. Then nothing is written.
    """
    frames: list[ReplayedFrame] = []
    with ExitStack() as files:
        reader = files.enter_context(VideoReader(video))
        size = (reader.info.width // 2 * 2, reader.info.height // 2 * 2)
        writer = files.enter_context(VideoWriter(out, size, reader.info.fps, threads=2)) if out else None
        pipeline = pipeline_for(size)
        files.callback(pipeline.close)
        for frame in reader:
            rendered = pipeline.process(frame, scene_at(frame.time_s))
            frames.append(
                ReplayedFrame(frame.index, frame.time_s, rendered.motion, rendered.shown, pipeline.timer.lap_ms())
            )
            watch(frame.index, frame.image, rendered.image)
            if writer:
                writer.write(np.ascontiguousarray(rendered.image), frame.time_s)
        if not any(f.motion and f.motion.status is FaceStatus.FOUND for f in frames):
            raise VideoError(
                f"no face was found in {video}", "the face must look toward the camera, 60 pixels high or more"
            )
    return frames
