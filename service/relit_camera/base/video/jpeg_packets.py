"""Motion JPEG by OpenCV's JPEG decoder, which gives RGB in less time than FFmpeg's takes to give YCbCr."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import cv2
import numpy as np

from relit_camera.base.images.image_types import DisplayImage

_END_OF_IMAGE = b"\xff\xd9"
_BT601_625 = 5
"""Matrix code point of ITU-T H.273, which FFmpeg gives to every JPEG picture that does not say otherwise."""


@dataclass(frozen=True, eq=False)
class JpegPicture:
    """A decoded packet, with what readers ask of PyAV's pictures.

    Attributes:
        image: uint8 RGB (height, width, 3).
        pts: presentation time in units of `time_base`.
        is_corrupt: never; without its end there is no picture.
    """

    image: DisplayImage
    pts: int | None
    time_base: Fraction
    is_corrupt: ClassVar[bool] = False

    @property
    def width(self) -> int:
        """In pixels."""
        return int(self.image.shape[1])

    @property
    def height(self) -> int:
        """In pixels."""
        return int(self.image.shape[0])


def is_plain_jpeg(codec: str, picture: Any) -> bool:
    """Whether a picture that FFmpeg decoded is a JPEG as others decode it: BT.601 in full range, and not interlaced."""
    usual = picture.format.name.startswith("yuvj") and picture.colorspace == _BT601_625
    return codec == "mjpeg" and usual and not picture.interlaced_frame


def is_cut_short(packet: Any) -> bool:
    """Whether a packet holds a JPEG without its end, of which FFmpeg would show a part."""
    return packet.is_corrupt or (packet.size > 0 and bytes(packet).rfind(_END_OF_IMAGE) < 0)


def decode_jpeg_packet(packet: Any) -> list[JpegPicture]:
    """The picture in a packet; none in the empty one at the end of a file, and where OpenCV cannot decode it."""
    image = None
    if packet.size > 0:
        image = cv2.imdecode(np.frombuffer(packet, np.uint8), cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION)
    return [] if image is None else [JpegPicture(np.asarray(image, np.uint8), packet.pts, packet.time_base)]
