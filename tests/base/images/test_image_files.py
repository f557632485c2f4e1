"""Picture files: their sizes, and mattes."""

from __future__ import annotations

import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from relit_camera.base.errors import ImageError
from relit_camera.base.images import image_files, image_limits
from relit_camera.base.images.image_files import decode_display, read_linear, read_mask, write_linear
from relit_camera.base.images.image_limits import image_header_of_file

GREY = np.array([[0, 51, 255], [102, 255, 0]], np.uint8)


@pytest.mark.parametrize(
    "channels",
    [
        (GREY,),
        (GREY, GREY, GREY),
        (GREY, GREY, GREY, np.full_like(GREY, 255)),  # an opaque alpha marks nobody
        (np.full_like(GREY, 9), np.zeros_like(GREY), np.zeros_like(GREY), GREY),
    ],
    ids=["grey", "colour", "opaque alpha", "alpha"],
)
def test_a_matte_in_any_channels(channels: tuple[np.ndarray, ...], tmp_path: Path) -> None:
    path = tmp_path / "matte.png"
    cv2.imwrite(str(path), cv2.merge(channels))
    np.testing.assert_allclose(read_mask(path), GREY / 255, atol=1e-6)


CODED = {
    "png": (".png", [], 3),
    "jpg": (".jpg", [], 3),
    "bmp": (".bmp", [], 3),
    "tiff": (".tiff", [], 3),
    "lossy webp": (".webp", [cv2.IMWRITE_WEBP_QUALITY, 80], 3),
    "lossless webp": (".webp", [cv2.IMWRITE_WEBP_QUALITY, 101], 3),
    "webp with alpha": (".webp", [cv2.IMWRITE_WEBP_QUALITY, 80], 4),
    "hdr": (".hdr", [], 3),
}


@pytest.mark.parametrize("name", CODED)
def test_the_header_tells_the_size_and_too_large_is_refused_unread(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    suffix, options, channels = CODED[name]
    picture = np.random.default_rng(0).integers(0, 256, (300, 517, channels), dtype=np.uint8)
    path = tmp_path / f"a{suffix}"
    assert cv2.imwrite(str(path), picture.astype(np.float32) if suffix == ".hdr" else picture, options)
    assert image_header_of_file(path).size == (517, 300)
    assert read_linear(path).shape == (300, 517, 3)
    monkeypatch.setattr(image_limits, "MAX_IMAGE_PIXELS", 517 * 300 - 1)
    monkeypatch.setattr(cv2, "imdecode", None)  # calling it would raise TypeError
    for read in (read_linear, read_mask):
        with pytest.raises(ImageError, match="517x300 pixels, more than"):
            read(path)
    for length in range(20, -1, -4):
        path.write_bytes(path.read_bytes()[:length])
        with pytest.raises(ImageError, match="cannot be read"):
            read_linear(path)


def test_openexr_too_large_is_refused_unread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.exr"
    write_linear(path, np.ones((30, 51, 3), np.float32))
    monkeypatch.setattr(image_limits, "MAX_IMAGE_PIXELS", 51 * 30 - 1)
    monkeypatch.setattr(image_files, "_read_exr", None)
    with pytest.raises(ImageError, match="51x30 pixels, more than"):
        read_linear(path)


def test_tiff_of_the_other_byte_order_and_bmp_from_the_top(tmp_path: Path) -> None:
    entries = [(256, 3, 1, 517 << 16), (257, 4, 1, 300)]
    directory = b"".join(struct.pack(">HHII", *entry) for entry in entries)
    (tmp_path / "a.tif").write_bytes(b"MM\0*" + struct.pack(">IH", 8, 2) + directory)
    assert image_header_of_file(tmp_path / "a.tif").size == (517, 300)
    (tmp_path / "a.bmp").write_bytes(b"BM" + bytes(12) + struct.pack("<Iii", 40, 517, -300))
    assert image_header_of_file(tmp_path / "a.bmp").size == (517, 300)


def test_what_is_no_picture_is_said(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(b"GIF89a" + bytes(100))
    with pytest.raises(ImageError, match="none of PNG, JPEG, WebP, BMP and TIFF"):
        read_linear(path)


def test_codes_of_16_bits_are_shown_as_the_nearest_of_8() -> None:
    codes = np.arange(1 << 16, dtype=np.uint16).reshape(256, 256)
    shown = decode_display(cv2.imencode(".png", codes)[1].tobytes())
    np.testing.assert_array_equal(shown, np.rint(codes / 257)[..., None].repeat(3, axis=2))
