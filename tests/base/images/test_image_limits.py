"""Headers of picture files that could state one size to the check and another to the decoder."""

from __future__ import annotations

import struct

import cv2
import numpy as np
import pytest

from relit_camera.base.errors import ImageError
from relit_camera.base.images.image_limits import (
    MAX_EXR_HEADER_BYTES,
    MAX_FILE_BYTES,
    ImageHeader,
    image_header,
    require_readable_header,
)
from tests.bad_pictures import encoded

WIDTH, HEIGHT = 517, 300


def jpeg_with(before: bytes) -> bytes:
    """A sound JPEG file with something between its start and its first segment."""
    sound = encoded(".jpg", WIDTH, HEIGHT)
    return sound[:2] + before + sound[2:]


def comment_with_frame() -> bytes:
    """A comment that holds frame headers of 64x64 pixels, wherever one begins to read in it."""
    frame = b"\xff\xc0" + struct.pack(">HBHHB", 11, 8, 64, 64, 1) + bytes(3)
    content = frame * 5000
    return b"\xff\xfe" + struct.pack(">H", 2 + len(content)) + content


@pytest.mark.parametrize(
    "marker",
    [b"", b"\xff\x01", b"\xff\xd0", b"\xff\xd7", b"\xff", b"\xff" * 7, b"\xff\xff\x01\xff\xff\xd3"],
    ids=["none", "TEM", "RST0", "RST7", "fill byte", "fill bytes", "several"],
)
def test_the_frame_of_a_jpeg_is_the_one_that_is_decoded(marker: bytes) -> None:
    data = jpeg_with(marker + comment_with_frame())
    decoded = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert image_header(data).size == (WIDTH, HEIGHT)
    assert decoded is None or decoded.shape[:2] == (HEIGHT, WIDTH)


@pytest.mark.parametrize("start", [b"\xff\x00", b"\xff\xd8", b"\xff\xd9", b"\xff\xfe\0\0", b"\xff\xfe\0\1", b"\0"])
def test_what_is_no_segment_of_a_jpeg_is_refused(start: bytes) -> None:
    with pytest.raises(ValueError, match="JPEG"):
        image_header(jpeg_with(start + comment_with_frame()))


def tiff(entries: list[tuple[int, int, int, int]]) -> bytes:
    """A TIFF header of one directory: tag, type, count and value of each entry."""
    return b"II*\0" + struct.pack("<IH", 8, len(entries)) + b"".join(struct.pack("<HHII", *entry) for entry in entries)


def test_a_tiff_file_with_two_sizes_is_refused() -> None:
    sides = [(256, 4, 1, 9000), (257, 4, 1, 9000)]
    assert image_header(tiff(sides)).size == (9000, 9000)
    for repeated in (256, 257):
        with pytest.raises(ValueError, match="size"):
            image_header(tiff([*sides, (repeated, 4, 1, 64)]))


def test_a_side_of_a_tiff_file_stands_in_its_entry() -> None:
    """64 bits (type 16) do not fit: the entry would hold the place where the side is."""
    with pytest.raises(ValueError, match="size"):
        image_header(tiff([(256, 16, 1, 64), (257, 4, 1, 64)]))


@pytest.mark.parametrize("start", [b"P5\n#    WEBP", b"RIFF\0\0\0\0WAVE"], ids=["a picture of another kind", "a sound"])
def test_a_webp_file_is_known_by_both_its_signatures(start: bytes) -> None:
    """The first is a PGM picture of 9000x9000 pixels for OpenCV, with the header of a small WebP file in a comment."""
    webp = encoded(".webp", 64, 64)
    assert image_header(webp).size == (64, 64)
    with pytest.raises(ValueError, match="none of PNG"):
        image_header(start + webp[len(start) : 40].replace(b"\n", b" ") + b"\n9000 9000\n255\n")


@pytest.mark.parametrize(
    ("width", "height", "pixel_bytes", "allowed"),
    [
        (8192, 4096, 8, True),
        (8256, 5504, 6, True),
        (9504, 6336, 6, True),
        (8000, 8000, 4, True),
        (8000, 8000, 6, False),
    ],
    ids=["panorama with alpha", "45 MP", "61 MP", "8 bits", "64 MP of 16 bits"],
)
def test_what_cameras_and_programs_write_may_be_decoded(
    width: int, height: int, pixel_bytes: int, allowed: bool
) -> None:
    header = ImageHeader(width, height, pixel_bytes)
    if allowed:
        assert require_readable_header(lambda: header, "a.png") is header
    else:
        with pytest.raises(ImageError, match="8 bits a channel"):
            require_readable_header(lambda: header, "a.png")


def test_the_largest_panorama_of_four_float_channels_may_be_a_file() -> None:
    assert MAX_FILE_BYTES > 8192 * 4096 * 4 * 4 + MAX_EXR_HEADER_BYTES
