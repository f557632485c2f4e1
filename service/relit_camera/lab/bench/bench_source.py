"""The source of a benchmark: a video at the size and rate of a webcam that would be used in its place."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from relit_camera.base.video.video_readers import VideoReader
from relit_camera.base.video.video_writer import VideoWriter

MAX_FRAMES = 240
"""A longer video is cut: it is played again and again anyway."""


def prepare_video(video: Path, folder: Path, size: tuple[int, int] | None, fps: float | None) -> tuple[Path, float]:
    """A video of that size and rate, and its rate: the same file if it has both already, else a copy in the folder.

    Args:
        video: a film of a face.
        folder: for the copy.
        size: (width, height) to scale it to, for its decoding is measured too; None keeps it as it is, and uncut, for a
            recorded track that belongs to it.
        fps: frames a second to play it with; its own if None.

    Raises:
        VideoError: the video cannot be read.
    """
    with VideoReader(video) as reader:
        info = reader.info
        wanted, rate = size or (info.width, info.height), fps or info.fps
        if wanted == (info.width, info.height) and rate == info.fps:
            return video, rate
        copy = folder / f"{wanted[0]}x{wanted[1]}-{rate:g}.mp4"
        if copy.exists():
            return copy, rate
        with VideoWriter(copy, wanted, rate, threads=2) as writer:
            for frame in reader:
                if size and frame.index >= MAX_FRAMES:
                    break
                smaller = wanted[0] < info.width
                how = cv2.INTER_AREA if smaller else cv2.INTER_CUBIC
                writer.write(np.asarray(cv2.resize(frame.image, wanted, interpolation=how), np.uint8))
    return copy, rate
