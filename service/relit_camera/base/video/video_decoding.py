"""Decoding with FFmpeg's libraries (PyAV): opening and checking files, orientation, color conversion, scaling."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.video.reformatter import ColorRange, Interpolation, VideoReformatter
from numpy.typing import NDArray

from relit_camera.base.errors import VideoError
from relit_camera.base.video.video_truncation import is_truncated

MIN_SIDE, MAX_SIDE = 16, 8192
MAX_PIXELS = 36_000_000
"""Of a video's picture: 8K, and a little more. Decoders hold several at a time."""
MAX_FPS = 240
DECODER_LIMITS = {"max_pixels": str(MAX_PIXELS)}
"""For FFmpeg, which decodes the first pictures while it opens a file, and may find larger ones than the file states."""

HDR_TRANSFER_FUNCTIONS = {16: "PQ", 18: "HLG"}
"""Transfer curves not meant for an ordinary screen, by their code points in ITU-T H.273."""

BT709, BT601 = 1, 5
SWSCALE_MATRICES = {1: BT709, 4: 4, 5: BT601, 6: BT601, 7: 7, 9: 9, 10: 9}
"""The scaler's matrix of each matrix code point of ITU-T H.273."""

SWS_AREA = 0x20
SWS_FULL_CHROMA = 0x2000
SWS_ACCURATE_ROUNDING = 0x40000
ACCURATE_INTERPOLATION = Interpolation.BILINEAR.value | SWS_FULL_CHROMA | SWS_ACCURATE_ROUNDING
"""Within half a code value. FFmpeg's default is about nine times as fast, and on average one code value too dark."""


def open_stream(path: Path) -> tuple[Any, Any]:
    """Open a file. Returns PyAV's container and its first real video stream.

    Raises:
        VideoError: missing, empty, cut off, no video, HDR, or of an absurd size.
    """
    if not path.is_file():
        raise VideoError(f"no video at {path}", "check the path")
    if path.stat().st_size == 0:
        raise VideoError(f"{path} is empty", "record or copy it again")
    cut_off = False
    try:
        cut_off = is_truncated(path)
        # FFmpeg takes what stands before a colon for a protocol. Titles and the like may be in any encoding.
        container = av.open(str(path.absolute()), options=DECODER_LIMITS, metadata_errors="replace")
    except (av.FFmpegError, OSError, ValueError) as error:
        if cut_off:
            raise VideoError(f"{path} is cut off: 0 frames can be read", "record or copy it again") from error
        reason = getattr(error, "strerror", None) or error
        raise VideoError(f"{path} cannot be read as a video: {reason}", "use MP4, MOV, MKV, WebM or GIF") from error
    try:
        stream = _video_stream(container, path)
        if cut_off:
            _require_all_frames(container, stream, path)
    except BaseException:
        container.close()
        raise
    return container, stream


def frame_rate(stream: Any) -> float:
    """Average frames a second of a stream; 30 where the file states no credible rate."""
    rates: list[Fraction | None] = [stream.average_rate, stream.guessed_rate]
    return float(next((rate for rate in rates if rate and 0 < rate <= MAX_FPS), 30))


@dataclass(frozen=True)
class Orientation:
    """Quarter turns and mirrorings of a display matrix: first the axes are exchanged, then the picture is flipped."""

    transposed: bool = False
    flip_x: bool = False
    flip_y: bool = False

    def size(self, width: int, height: int) -> tuple[int, int]:
        """Width and height of the upright picture."""
        return (height, width) if self.transposed else (width, height)

    def upright(self, image: NDArray) -> NDArray:
        """A view of a stored picture (height, width, …) in upright orientation."""
        turned = image.swapaxes(0, 1) if self.transposed else image
        return turned[:: -1 if self.flip_y else 1, :: -1 if self.flip_x else 1]


def orientation_of(picture: Any) -> Orientation:
    """The orientation in a decoded picture's display matrix (ISO/IEC 14496-12, 6.2.2), to quarter turns and mirrorings.

    Call it once a file: PyAV's answer and the picture refer to each other until the next garbage collection.
    """
    display_matrix = picture.side_data.get("DISPLAYMATRIX")
    if display_matrix is None:
        return Orientation()
    a, b, _, c, d = np.frombuffer(display_matrix, np.int32)[:5].astype(int)
    if abs(a) < abs(b):  # x' = c·y and y' = b·x
        return Orientation(True, bool(c < 0), bool(b < 0))
    return Orientation(False, bool(a < 0), bool(d < 0))


class PixelConverter:
    """Converts decoded pictures to code values (height, width, 3) or, of luma, (height, width), uint8 or uint16."""

    def __init__(self, *, accurate: bool = True, pixels: str = "rgb24", longer_side: int | None = None) -> None:
        """Set up.

        Args:
            accurate: convert to within half a code value; otherwise faster, about one code value too dark.
            pixels: FFmpeg's name of the pixel format to return: rgb24, rgb48le (uint16, which keeps the precision of
                10 bits), gray or gray16le (luma alone).
            longer_side: scale down (by area, in code values) so that the longer side has this many pixels.
        """
        self._reformatter = VideoReformatter()
        self._interpolation = ACCURATE_INTERPOLATION if accurate else None
        self._format = pixels
        self._longer_side = longer_side

    def __call__(self, picture: Any) -> NDArray:
        """Convert the picture; returns a new array."""
        width, height = picture.width, picture.height
        interpolation = self._interpolation
        if self._longer_side is not None and self._longer_side < max(width, height):
            scale = self._longer_side / max(width, height)
            width, height = max(1, round(width * scale)), max(1, round(height * scale))
            interpolation = SWS_AREA | SWS_FULL_CHROMA | SWS_ACCURATE_ROUNDING
        rgb = self._reformatter.reformat(
            picture,
            width=width,
            height=height,
            format=self._format,
            dst_colorspace=None,
            interpolation=interpolation,
            **_source_color_encoding(picture),
        )
        return np.asarray(rgb.to_ndarray())


def white_code_value(picture: Any, deep: bool) -> int:
    """The RGB code that `PixelConverter` returns for white.

    Args:
        picture: a decoded picture.
        deep: whether it is converted to uint16.
    """
    if not deep:
        return 255
    # FFmpeg's scaler makes 16 bits of luma and chroma by appending eight bits to the 8-bit code.
    return 65535 if picture.format.is_rgb else 255 << 8


def _video_stream(container: Any, path: Path) -> Any:
    cover = av.stream.Disposition.attached_pic
    streams = [stream for stream in container.streams.video if not stream.disposition & cover]
    if not streams or streams[0].codec_context is None:
        raise VideoError(f"{path} holds no moving picture", "choose a video file")
    if container.format.name.endswith("_pipe") or container.format.name == "image2":
        raise VideoError(f"{path} is a picture, not a video", "choose a video file")
    stream = streams[0]
    stream.codec_context.options = DECODER_LIMITS
    width, height = stream.width, stream.height
    sides_fit = min(width, height) >= MIN_SIDE and max(width, height) <= MAX_SIDE
    if not sides_fit or width * height > MAX_PIXELS:
        limits = f"a side of {MIN_SIDE} to {MAX_SIDE} pixels is possible, {MAX_PIXELS // 10**6} million in all"
        size = f"is {width}x{height} pixels" if width and height else "states no size, or too large a one"
        raise VideoError(f"{path} {size}; {limits}", "scale it")
    curve = HDR_TRANSFER_FUNCTIONS.get(stream.codec_context.color_trc)
    if curve:
        cure = "record with HDR video switched off, or convert it to SDR (BT.709)"
        raise VideoError(f"{path} is an HDR video ({curve}); its colors cannot be measured", cure)
    return stream


def _require_all_frames(container: Any, stream: Any, path: Path) -> None:
    try:
        whole = sum(packet.size > 0 and not packet.is_corrupt for packet in container.demux(stream))
        container.seek(0)
    except av.FFmpegError as error:
        raise VideoError(f"{path} is cut off", "record or copy it again") from error
    announced = stream.frames if container.format.name.startswith("mov") else 0  # other containers only estimate it
    if announced and whole >= announced:
        return  # only sound is truncated
    total = f" of {announced}" if announced else ""
    raise VideoError(f"{path} is cut off: {whole}{total} frames can be read", "record or copy it again")


def _source_color_encoding(picture: Any) -> dict[str, Any]:
    """Arguments for the reformatter: the picture's color matrix and range."""
    if picture.format.is_rgb or picture.format.name in ("pal8", "gray"):
        return {}
    hd = max(picture.width / 16, picture.height / 9) * 9 > 576
    default = BT709 if hd else BT601
    full = picture.color_range == ColorRange.JPEG.value or picture.format.name.startswith("yuvj")
    return {
        "src_colorspace": SWSCALE_MATRICES.get(picture.colorspace, default),
        "src_color_range": ColorRange.JPEG if full else ColorRange.MPEG,
    }
