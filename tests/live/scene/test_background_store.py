"""Stored background pictures."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from relit_camera.base.errors import ImageError, NotFoundError, StorageError
from relit_camera.live.scene.background_store import MAX_SIDE_PX, BackgroundStore


def encoded(picture: np.ndarray, suffix: str = ".png") -> bytes:
    return bytes(cv2.imencode(suffix, picture[..., ::-1])[1])


def red_and_blue(height: int = 60, width: int = 120) -> np.ndarray:
    picture = np.zeros((height, width, 3), np.uint8)
    picture[:, : width // 2, 0] = 255
    picture[:, width // 2 :, 2] = 255
    return picture


def photograph(orientation: int) -> bytes:
    """A JPEG with an EXIF orientation, as phones write it."""
    jpeg = encoded(red_and_blue(), ".jpg")
    entry = struct.pack(">HHIHH", 0x0112, 3, 1, orientation, 0)
    exif = b"Exif\0\0MM\0*" + struct.pack(">IH", 8, 1) + entry + struct.pack(">I", 0)
    return jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + jpeg[2:]


def test_a_picture_comes_back_as_it_was(tmp_path: Path) -> None:
    store = BackgroundStore(tmp_path / "new folder")
    store.add("beach", io.BytesIO(encoded(red_and_blue())))
    assert store.names() == ["beach"]
    assert np.abs(store.load("beach").astype(int) - red_and_blue()).mean() < 3


def test_a_photograph_is_turned_upright_and_loses_its_metadata(tmp_path: Path) -> None:
    store = BackgroundStore(tmp_path)
    store.add("phone", io.BytesIO(photograph(orientation=6)))
    picture = store.load("phone")
    assert picture.shape == (120, 60, 3)  # 6: turned a quarter clockwise to be seen, so that red is above
    assert picture[:50, :, 0].mean() > 240
    assert picture[70:, :, 2].mean() > 240
    assert b"Exif" not in (tmp_path / "phone.jpg").read_bytes()


def test_a_large_picture_is_scaled_down(tmp_path: Path) -> None:
    store = BackgroundStore(tmp_path)
    store.add("wide", io.BytesIO(encoded(red_and_blue(20, MAX_SIDE_PX + 160), ".jpg")))
    assert store.load("wide").shape[1] == MAX_SIDE_PX


def test_a_picture_takes_the_place_of_one_of_its_name(tmp_path: Path) -> None:
    (tmp_path / "beach.png").write_bytes(encoded(red_and_blue()))
    store = BackgroundStore(tmp_path)
    store.add("beach", io.BytesIO(encoded(np.full((8, 8, 3), 40, np.uint8))))
    assert [path.name for path in tmp_path.iterdir()] == ["beach.jpg"]
    assert abs(store.load("beach").mean() - 40) < 2


@pytest.mark.parametrize("data", [b"", b"text", encoded(red_and_blue())[:100]])
def test_what_is_no_picture_is_refused_and_leaves_what_was(tmp_path: Path, data: bytes) -> None:
    store = BackgroundStore(tmp_path)
    store.add("beach", io.BytesIO(encoded(red_and_blue())))
    with pytest.raises(ImageError, match="the file cannot be read as a picture"):
        store.add("beach", io.BytesIO(data))
    assert np.abs(store.load("beach").astype(int) - red_and_blue()).mean() < 3
    assert [path.name for path in tmp_path.iterdir()] == ["beach.jpg"]


def test_other_files_are_no_backgrounds(tmp_path: Path) -> None:
    for name in ("notes.txt", ".hidden.jpg", "sky.hdr"):
        (tmp_path / name).write_bytes(b"x")
    assert BackgroundStore(tmp_path).names() == []
    assert BackgroundStore(tmp_path / "none").names() == []


def test_unknown_names_are_told_a_close_one(tmp_path: Path) -> None:
    store = BackgroundStore(tmp_path)
    store.add("beach", io.BytesIO(encoded(red_and_blue())))
    with pytest.raises(NotFoundError) as caught:
        store.load("beech")
    assert caught.value.cure == "did you mean 'beach'?"
    with pytest.raises(NotFoundError):
        store.remove("beech")
    store.remove("beach")
    assert store.names() == []


def test_a_folder_that_cannot_be_made_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(StorageError):
        BackgroundStore(tmp_path / "file" / "backgrounds").add("beach", io.BytesIO(encoded(red_and_blue())))
