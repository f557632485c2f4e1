"""The source of a benchmark: a video at the size and rate of a webcam that would be used in its place."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import av
import cv2
import numpy as np

from relit_camera.base.images.image_files import encode_display
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.base.video.video_writer import rational_rate

MAX_FRAMES = 240
"""A longer video is cut: it is played again and again anyway."""
JPEG_QUALITY = 90


def prepare_video(video: Path, folder: Path, size: tuple[int, int] | None, fps: float | None) -> tuple[Path, float]:
    """A video of that size and rate, and its rate: the same file if it has both already, else a copy in the folder.

    The copy is Motion JPEG, as webcams give it.

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
        copy = folder / f"{wanted[0]}x{wanted[1]}-{rate:g}.mov"
        if not copy.exists():
            smaller = wanted[0] < info.width
            how = cv2.INTER_AREA if smaller else cv2.INTER_CUBIC
            shown = (frame.image for frame in reader if not size or frame.index < MAX_FRAMES)
            pictures = (np.asarray(cv2.resize(image, wanted, interpolation=how), np.uint8) for image in shown)
            _write_motion_jpeg(copy, wanted, pictures, rate)
    return copy, rate


def _write_motion_jpeg(path: Path, size: tuple[int, int], pictures: Iterable[DisplayImage], fps: float) -> None:
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mjpeg", rate=rational_rate(fps))
        (stream.width, stream.height), stream.pix_fmt = size, "yuvj420p"
        for index, picture in enumerate(pictures):
            packet = av.Packet(encode_display(picture, ".jpg", JPEG_QUALITY))
            packet.stream, packet.time_base = stream, 1 / rational_rate(fps)
            packet.pts = packet.dts = index
            packet.duration = 1
            container.mux(packet)
