"""Readers of video files: sRGB frames for people and networks, linear light for measuring, and luma alone.

Luma is enough to track a face, and takes a fraction of the time of color.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Generator, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, Self, TypeVar

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import VideoError
from relit_camera.base.images.color import Gamma, decode
from relit_camera.base.images.image_types import Frame, LinearImage
from relit_camera.base.video.jpeg_packets import JpegPicture, decode_jpeg_packet, is_cut_short, is_plain_jpeg
from relit_camera.base.video.video_decoding import (
    Orientation,
    PixelConverter,
    frame_rate,
    open_stream,
    orientation_of,
    white_code_value,
)

FrameT = TypeVar("FrameT")


@dataclass(frozen=True)
class VideoInfo:
    """Facts in the header of a video file.

    Attributes:
        width, height: of the upright pictures, in stored pixels (a pixel aspect ratio is not applied).
        fps: average frames a second; 30 if the file states no credible rate.
        frames: number stated, or computed from the duration; None if the file states neither. The true number is known
            only after reading.
        duration_s: 0 if the file does not state it.
    """

    width: int
    height: int
    fps: float
    frames: int | None
    duration_s: float


class FrameReader(Generic[FrameT]):
    """Iterates over what a subclass makes of a video file's pictures, in order of presentation, once.

    One picture is in memory at a time.

    Attributes:
        info: facts in the header.
    """

    def __init__(self, path: Path, threads: int, only: Collection[int] | None = None) -> None:
        """Open a file.

        Args:
            path: the file (MP4, MOV, MKV, WebM, GIF, AVI …).
            threads: of the decoder.
            only: indices of the pictures to return; all if None. The others are only decoded.

        Raises:
            VideoError: the file is missing, empty, cut off, no video, HDR, or of an absurd size.
        """
        self._path, self._only = Path(path), only
        self._container, self._stream = open_stream(self._path)
        self._stream.codec_context.thread_count = threads
        self._damaged = self._decoded = 0
        self._orientation = Orientation()
        self._made = self._decode()
        try:
            self._first = next(self._made, None)
            if not self._decoded:
                raise VideoError(f"{self._path} holds no frame that can be decoded", "record or convert it again")
            self.info = _video_info(self._container, self._stream, self._orientation)
        except BaseException:
            self._container.close()
            raise

    def _make(self, picture: Any, index: int, time_s: float) -> FrameT:
        """Convert a decoded picture, the index-th, at `time_s` seconds from the first."""
        raise NotImplementedError

    def __iter__(self) -> Iterator[FrameT]:
        """All frames, once.

        Raises:
            VideoError: the size changes; or, after all frames that can be read, some were damaged.
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

    def _decode(self) -> Generator[FrameT]:
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
                self._orientation = orientation_of(picture)
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
        """Decode pictures. Damage before the first does not count: a recorded stream may begin between key frames."""
        begun = False
        try:
            for packet in self._container.demux(self._stream):
                pictures = self._decode_packet(packet)
                self._damaged += begun and pictures is None
                for picture in pictures or ():
                    self._damaged += begun and picture.is_corrupt
                    begun = True
                    yield picture
        except av.FFmpegError:
            self._damaged += 1

    def _decode_packet(self, packet: Any) -> list[Any] | None:
        """Decode the pictures that a packet completes, or None if it is damaged."""
        if packet.is_corrupt:
            return None
        try:
            return list(packet.decode())
        except av.FFmpegError:
            return None


def _video_info(container: Any, stream: Any, turn: Orientation) -> VideoInfo:
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


def probe_video(path: Path) -> VideoInfo:
    """Size, rate and length of a video file, from its header and first frame.

    Raises:
        VideoError: as `VideoReader`.
    """
    with VideoReader(path) as video:
        return video.info


class VideoReader(FrameReader[Frame]):
    """The frames of a video file (MP4, MOV, MKV, WebM, GIF, AVI …) in order of presentation, upright. Iterate once.

    Frames are uint8 sRGB RGB, not writable; `time_s` is the presentation time from the first frame and grows strictly,
    also where the rate varies. A rotation or mirroring flag is applied. Colors are converted by the matrix and range
    that the file names; where it names no matrix, BT.709 is taken for HD and BT.601 for less, as players do.

    Raises:
        VideoError: on opening if the file is missing, empty, cut off, no video, HDR, or of an absurd size; while
            iterating if the size changes, or, after all frames that can be read, if there were damaged ones.
    """

    def __init__(
        self, path: Path, *, accurate: bool = True, threads: int = 1, only: Collection[int] | None = None
    ) -> None:
        """Open a file.

        Args:
            path: the file.
            accurate: convert colors to within half a code value; otherwise faster, about one code value too dark, or
                Motion JPEG as `jpeg_packets` does.
            threads: of the decoder.
            only: indices of the frames to return; all if None.
        """
        self._accurate, self._plain_jpeg = accurate, False
        self._convert = PixelConverter(accurate=accurate)
        super().__init__(path, threads, only)

    def _decode_packet(self, packet: Any) -> list[Any] | None:
        if self._plain_jpeg and is_cut_short(packet):
            return None
        if self._plain_jpeg and (pictures := decode_jpeg_packet(packet)):
            return pictures  # what OpenCV cannot decode is FFmpeg's
        decoded = super()._decode_packet(packet)
        if decoded and not self._accurate:
            # FFmpeg decodes the first picture in any case: it tells orientation and colors.
            self._plain_jpeg = is_plain_jpeg(self._stream.codec_context.name, decoded[0])
        return decoded

    def _make(self, picture: Any, index: int, time_s: float) -> Frame:
        codes = picture.image if isinstance(picture, JpegPicture) else self._convert(picture)
        image = np.ascontiguousarray(self._orientation.upright(codes))
        image.setflags(write=False)
        return Frame(image, index, time.monotonic(), time_s)


@dataclass(frozen=True)
class LinearVideoFrame:
    """One picture of a video file.

    Attributes:
        image: (height, width, 3) float32 linear RGB; the file's white is 1.
        index: counts from 0 in the order of presentation.
        time_s: presentation time from the first frame, seconds; grows strictly, also where the rate varies.
    """

    image: LinearImage
    index: int
    time_s: float


class LinearVideoReader(FrameReader[LinearVideoFrame]):
    """The frames of a video file as linear light, upright, in order of presentation. Iterate once.

    A file of 10 or 12 bits is converted with 16 bits, so that no precision is lost.

    Raises:
        VideoError: as `VideoReader`.
    """

    def __init__(
        self,
        path: Path,
        gamma: Gamma = "srgb",
        *,
        longer_side: int | None = None,
        only: Collection[int] | None = None,
        threads: int = 1,
    ) -> None:
        """Open a file.

        Args:
            path: the file.
            gamma: curve of its code values.
            longer_side: scale down so that the longer side has this many pixels. It is cheap, since it is done with
                the color conversion, but averages code values, not light.
            only: indices of the frames to return; all if None.
            threads: of the decoder.
        """
        self._gamma, self._longer_side = gamma, longer_side
        self._convert: PixelConverter | None = None
        self._table: NDArray[np.float32] = np.zeros(0, np.float32)
        super().__init__(path, threads, only)

    def _make(self, picture: Any, index: int, time_s: float) -> LinearVideoFrame:
        if self._convert is None:
            deep = any(component.bits > 8 for component in picture.format.components)
            self._convert = PixelConverter(pixels="rgb48le" if deep else "rgb24", longer_side=self._longer_side)
            values = np.arange(65536 if deep else 256, dtype=np.float32) / np.float32(white_code_value(picture, deep))
            self._table = decode(np.minimum(values, 1), self._gamma)
        codes = np.ascontiguousarray(self._orientation.upright(self._convert(picture)))
        image = self._table[codes] if codes.dtype == np.uint16 else cv2.LUT(codes, self._table)
        return LinearVideoFrame(np.asarray(image, np.float32), index, time_s)


@dataclass(frozen=True)
class LumaVideoFrame:
    """The luma of one picture.

    Attributes:
        image: (height, width) float32 code values, 1 is white.
        index: counts from 0 in the order of presentation.
        time_s: presentation time from the first frame, seconds.
    """

    image: NDArray[np.float32]
    index: int
    time_s: float


class LumaVideoReader(FrameReader[LumaVideoFrame]):
    """The luma of a video file's frames, upright, in order of presentation. Iterate once.

    Raises:
        VideoError: as `VideoReader`.
    """

    def __init__(self, path: Path, *, only: Collection[int] | None = None, threads: int = 1) -> None:
        """Open a file.

        Args:
            path: the file.
            only: indices of the frames to return; all if None.
            threads: of the decoder.
        """
        self._convert: PixelConverter | None = None
        super().__init__(path, threads, only)

    def _make(self, picture: Any, index: int, time_s: float) -> LumaVideoFrame:
        if self._convert is None:
            deep = any(component.bits > 8 for component in picture.format.components)
            # Without color to convert the fast conversion is as exact.
            self._convert = PixelConverter(accurate=False, pixels="gray16le" if deep else "gray")
        codes = self._orientation.upright(self._convert(picture))
        white = 65535 if codes.dtype == np.uint16 else 255
        return LumaVideoFrame(np.ascontiguousarray(codes, np.float32) / np.float32(white), index, time_s)
