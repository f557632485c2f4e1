"""The formats in which a PipeWire camera offers its pictures, and the buffers that it asks for, as PODs."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from fractions import Fraction

from relit_camera.devices.sinks.pipewire.pipewire_library import META_HEADER, MetaHeader
from relit_camera.devices.sinks.pipewire.spa_pods import (
    ChoiceType,
    choice_pod,
    fraction_pod,
    id_pod,
    int_pod,
    object_pod,
    read_object,
    rectangle_pod,
)

PARAM_ENUM_FORMAT, PARAM_FORMAT, PARAM_BUFFERS, PARAM_META = 3, 4, 5, 6
OBJECT_FORMAT, OBJECT_BUFFERS, OBJECT_META = 0x40003, 0x40004, 0x40005
MEDIA_TYPE, MEDIA_SUBTYPE = 1, 2
VIDEO, RAW = 2, 1
VIDEO_FORMAT, VIDEO_SIZE, VIDEO_FRAME_RATE = 0x20001, 0x20003, 0x20004
COLOR_RANGE, COLOR_MATRIX, TRANSFER_FUNCTION, COLOR_PRIMARIES = 0x2000C, 0x2000D, 0x2000E, 0x2000F
"""Keys of a format's properties (spa/param/format.h)."""
FULL_RANGE, LIMITED_RANGE = 1, 2
RGB_MATRIX, BT601_MATRIX = 1, 4
SRGB_TRANSFER = 7
BT709_PRIMARIES = 1
"""Colors (spa/param/video/color.h): what `rgb_to_i420` makes, of pictures that are sRGB."""
BUFFERS, BLOCKS, BLOCK_SIZE, STRIDE, DATA_TYPE = 1, 2, 3, 4, 6
META_TYPE, META_SIZE = 1, 2
MEMORY_POINTER, MEMORY_FILE = 1 << 1, 1 << 2
"""Kinds of memory that can be mapped here: not a graphics card's."""
MOST_BUFFERS = 8
"""Each is a whole picture. Four are asked for: one is written, one on its way, and two with readers."""


@dataclass(frozen=True)
class PixelLayout:
    """How pixels lie in a buffer, without padding.

    Attributes:
        name: as V4L2 and GStreamer call it.
        identifier: SPA's number of it.
        line_bytes: bytes of one pixel in a line (of the first plane).
        picture_bytes: bytes of one pixel in the whole picture.
        color_range: SPA's number.
        color_matrix: SPA's number.
    """

    name: str
    identifier: int
    line_bytes: int
    picture_bytes: Fraction
    color_range: int
    color_matrix: int

    def stride(self, size: tuple[int, int]) -> int:
        """Bytes of a line."""
        return self.line_bytes * size[0]

    def size_bytes(self, size: tuple[int, int]) -> int:
        """Bytes of a picture; width and height are even."""
        return int(self.picture_bytes * size[0] * size[1])


I420 = PixelLayout("I420", 2, 1, Fraction(3, 2), LIMITED_RANGE, BT601_MATRIX)
YUY2 = PixelLayout("YUY2", 4, 2, Fraction(2), LIMITED_RANGE, BT601_MATRIX)
BGRX = PixelLayout("BGRx", 8, 4, Fraction(4), FULL_RANGE, RGB_MATRIX)


def offered_layouts(size: tuple[int, int]) -> tuple[PixelLayout, ...]:
    """The layouts offered for a size, the preferred one first.

    All readers have the layout that the first one chose, and PipeWire 1.4 stops both where a second cannot take it. So
    first is what all can take: browsers take no BGRx. I420 is offered only where readers agree on where its planes lie:
    GStreamer pads their lines to four bytes, browsers do not.
    """
    return (I420 if size[0] % 8 == 0 else YUY2, BGRX)


def format_params(size: tuple[int, int], fps: float) -> list[bytes]:
    """The formats to choose from: one size and one rate, in each layout. Encoded, the preferred one first."""
    rate = Fraction(fps).limit_denominator(1001)
    return [
        object_pod(
            OBJECT_FORMAT,
            PARAM_ENUM_FORMAT,
            {
                MEDIA_TYPE: id_pod(VIDEO),
                MEDIA_SUBTYPE: id_pod(RAW),
                VIDEO_FORMAT: id_pod(layout.identifier),
                VIDEO_SIZE: rectangle_pod(*size),
                VIDEO_FRAME_RATE: fraction_pod(rate),
                COLOR_RANGE: id_pod(layout.color_range),
                COLOR_MATRIX: id_pod(layout.color_matrix),
                TRANSFER_FUNCTION: id_pod(SRGB_TRANSFER),
                COLOR_PRIMARIES: id_pod(BT709_PRIMARIES),
            },
        ).encode()
        for layout in offered_layouts(size)
    ]


def chosen_layout(param: bytes, size: tuple[int, int]) -> PixelLayout:
    """The layout that a reader has chosen.

    Raises:
        ValueError: the format is damaged, or was not offered.
    """
    properties = read_object(param)
    if VIDEO_FORMAT not in properties or VIDEO_SIZE not in properties:
        raise ValueError("a format without layout or size")
    identifier = properties[VIDEO_FORMAT].number
    if properties[VIDEO_SIZE].pair != size:
        raise ValueError(f"a format of the size {properties[VIDEO_SIZE].pair}")
    for layout in offered_layouts(size):
        if layout.identifier == identifier:
            return layout
    raise ValueError(f"a format with layout {identifier}")


def buffer_params(layout: PixelLayout, size: tuple[int, int]) -> list[bytes]:
    """The buffers for a layout, and their metadata: number and time of each picture. Encoded."""
    buffers = object_pod(
        OBJECT_BUFFERS,
        PARAM_BUFFERS,
        {
            BUFFERS: choice_pod(ChoiceType.RANGE, int_pod(4), int_pod(2), int_pod(MOST_BUFFERS)),
            BLOCKS: int_pod(1),
            BLOCK_SIZE: int_pod(layout.size_bytes(size)),
            STRIDE: int_pod(layout.stride(size)),
            DATA_TYPE: choice_pod(ChoiceType.FLAGS, int_pod(MEMORY_POINTER | MEMORY_FILE)),
        },
    )
    meta = object_pod(
        OBJECT_META, PARAM_META, {META_TYPE: id_pod(META_HEADER), META_SIZE: int_pod(ctypes.sizeof(MetaHeader))}
    )
    return [buffers.encode(), meta.encode()]
