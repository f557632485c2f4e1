"""The decoded pictures of a video file, with their times: what every reader of video files iterates over."""

from __future__ import annotations

from collections.abc import Collection, Generator, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, Self, TypeVar

import av

from relit_camera.errors import VideoError
from relit_camera.video.decoding import Turn, frame_rate, open_stream, turn_of

Made = TypeVar("Made")


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


class PictureReader(Generic[Made]):
    """What is made of a video file's pictures, in order of presentation, one in memory at a time. Iterate once.

    Attributes:
        info: what the header says.
    """

    def __init__(self, path: Path, threads: int, only: Collection[int] | None = None) -> None:
        """Open a file.

        Args:
            path: the file (MP4, MOV, MKV, WebM, GIF, AVI …).
            threads: of the decoder.
            only: indices of the pictures to make something of; all if None. The others cost their decoding alone.

        Raises:
            VideoError: the file is missing, empty, cut off, no video, HDR, or of an absurd size.
        """
        self._path, self._only = Path(path), only
        self._container, self._stream = open_stream(self._path)
        self._stream.codec_context.thread_count = threads
        self._damaged = self._decoded = 0
        self._turn = Turn()
        self._made = self._decode()
        try:
            self._first = next(self._made, None)
            if not self._decoded:
                raise VideoError(f"{self._path} holds no frame that can be decoded", "record or convert it again")
            self.info = _info(self._container, self._stream, self._turn)
        except BaseException:
            self._container.close()
            raise

    def _make(self, picture: Any, index: int, time_s: float) -> Made:
        """What is given for a decoded picture, the index-th, at `time_s` from the first."""
        raise NotImplementedError

    def __iter__(self) -> Iterator[Made]:
        """All frames, once.

        Raises:
            VideoError: the size changes; or, after all frames that can be read, there were damaged ones.
        """
        first, self._first = self._first, None
        if first is not None:
            yield first
        yield from self._made

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; iteration ends."""
        self._made.close()
        self._container.close()

    def _decode(self) -> Generator[Made]:
        interval = 1 / frame_rate(self._stream)
        index, start, last_s = 0, None, -interval
        stored: tuple[int, int] | None = None
        for picture in self._pictures():
            seconds = None if picture.pts is None else float(picture.pts * picture.time_base)
            if start is None:
                start = seconds or 0.0
            time_s = last_s if seconds is None else seconds - start
            if time_s <= last_s:
                time_s = last_s + interval
            size = (picture.width, picture.height)
            if stored is None:
                self._turn = turn_of(picture)
            elif stored != size:
                sizes = f"from {stored[0]}x{stored[1]} to {size[0]}x{size[1]}"
                raise VideoError(f"{self._path} changes {sizes} at frame {index}", "cut or convert it to one size")
            self._decoded = index + 1
            if self._only is None or index in self._only:
                yield self._make(picture, index, time_s)
            index, last_s, stored = index + 1, time_s, size
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


def _info(container: Any, stream: Any, turn: Turn) -> VideoInfo:
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
    return VideoInfo(*turn.size(stream.width, stream.height), fps, frames, duration_s)
