"""Reading video files through FFmpeg's libraries (PyAV), one frame in memory at a time."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import av

from relit_camera.errors import VideoError
from relit_camera.space.images import Frame
from relit_camera.stream.decoding import UprightRgb, frame_rate, open_stream


@dataclass(frozen=True)
class VideoInfo:
    """What a video file says of itself.

    Attributes:
        width, height: of the upright pictures, in stored pixels (a pixel aspect ratio is not applied).
        fps: average frames a second; 30 if the file gives no credible rate.
        frames: number announced, or reckoned from the duration; None if the file tells neither. How many there are,
            only reading shows.
        duration_s: 0 if the file does not tell.
    """

    width: int
    height: int
    fps: float
    frames: int | None
    duration_s: float


def probe(path: Path) -> VideoInfo:
    """Size, rate and length of a video file, from its header and first frame.

    Raises:
        VideoError: as `VideoReader`.
    """
    with VideoReader(path) as video:
        return video.info


class VideoReader:
    """The frames of a video file (MP4, MOV, MKV, WebM, GIF, AVI …) in order of presentation, upright. Iterate once.

    Frames are uint8 sRGB RGB, not writable; `time_s` is the presentation time from the first frame and grows strictly,
    also where the rate varies. A rotation or mirroring flag is applied. Colours are converted by the matrix and range
    that the file names; where it names no matrix, BT.709 is taken for HD and BT.601 for less, as players do.

    Attributes:
        info: what the header says.

    Raises:
        VideoError: on opening if the file is missing, empty, cut off, no video, HDR, or of an absurd size; while
            iterating if the size changes, or, after all frames that can be read, if there were damaged ones.
    """

    def __init__(self, path: Path, *, accurate: bool = True, threads: int = 1) -> None:
        """Open a file.

        Args:
            path: the file.
            accurate: convert colours to within half a code value; otherwise faster, about one code value too dark.
            threads: of the decoder.
        """
        self._path = Path(path)
        self._container, self._stream = open_stream(self._path)
        self._stream.codec_context.thread_count = threads
        self._upright_rgb = UprightRgb(accurate)
        self._damaged = 0
        self._frames = self._decode()
        try:
            self._first = next(self._frames, None)
            if self._first is None:
                raise VideoError(f"{self._path} holds no frame that can be decoded", "record or convert it again")
            self.info = _info(self._container, self._stream, self._first.size)
        except BaseException:
            self._container.close()
            raise

    def __iter__(self) -> Iterator[Frame]:
        """All frames, once."""
        first, self._first = self._first, None
        if first is not None:
            yield first
        yield from self._frames

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; iteration ends."""
        self._frames.close()
        self._container.close()

    def _decode(self) -> Generator[Frame]:
        interval = 1 / frame_rate(self._stream)
        index, start, last_s = 0, None, -interval
        size: tuple[int, int] | None = None
        for picture in self._pictures():
            seconds = None if picture.pts is None else float(picture.pts * picture.time_base)
            if start is None:
                start = seconds or 0.0
            time_s = last_s if seconds is None else seconds - start
            if time_s <= last_s:
                time_s = last_s + interval
            frame = Frame(self._upright_rgb(picture), index, time.monotonic(), time_s)
            if size is not None and frame.size != size:
                sizes = f"from {size[0]}x{size[1]} to {frame.size[0]}x{frame.size[1]}"
                raise VideoError(f"{self._path} changes {sizes} at frame {index}", "cut or convert it to one size")
            yield frame
            index, last_s, size = index + 1, time_s, frame.size
        if self._damaged:
            raise VideoError(
                f"{self._path} is damaged: {index} frames could be read, {self._damaged} not, or only in part",
                "copy it again, or cut the damaged part away",
            )

    def _pictures(self) -> Iterator[Any]:
        """Decode pictures. Damage before the first is no damage: a recorded stream may begin between key frames."""
        begun = False
        try:
            for packet in self._container.demux(self._stream):
                pictures = _decoded(packet)
                self._damaged += begun and pictures is None
                for picture in pictures or ():
                    self._damaged += begun and picture.is_corrupt
                    begun = True
                    yield picture
        except av.FFmpegError:
            self._damaged += 1


def _decoded(packet: Any) -> list[Any] | None:
    """Decode the pictures that a packet completes, or None if it is damaged."""
    if packet.is_corrupt:
        return None
    try:
        return list(packet.decode())
    except av.FFmpegError:
        return None


def _info(container: Any, stream: Any, size: tuple[int, int]) -> VideoInfo:
    fps = frame_rate(stream)
    frames = stream.frames or None
    if stream.duration:
        duration_s = float(stream.duration * stream.time_base)
    elif container.duration:
        duration_s = container.duration / av.time_base
    else:
        duration_s = frames / fps if frames else 0.0
    if frames is None and duration_s:
        frames = round(duration_s * fps)
    return VideoInfo(*size, fps, frames, duration_s)
