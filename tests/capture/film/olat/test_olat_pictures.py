"""The room's light subtracted, in a film whose room grows brighter all the time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relit_camera.capture.alignment.rigid_transform import RigidTransform
from relit_camera.capture.film.olat.head_crop import HeadCrop
from relit_camera.capture.film.olat.olat_pictures import OlatPictures, RoomSubtraction, read_olat_pictures
from tests.capture.film.generated_film import write_film

SIZE, FLASH = (64, 48), 0.3
BRIGHT = np.array([6, 7, 8, 60, 61, 62])


def room(index: np.ndarray) -> np.ndarray:
    """Its light, linear: it grows ever faster."""
    return 0.1 + 0.3 * (index / 66) ** 2


def read(path: Path, *, subtract: bool = True) -> OlatPictures:
    """Two flashes far apart, with dark frames only between and about them."""
    index = np.arange(66)
    light = room(index) + FLASH * np.isin(index, BRIGHT)
    codes = np.round(255 * light ** (1 / 2.2)).astype(np.uint8)
    film = write_film(path, np.tile(codes[:, None, None, None], (1, *SIZE[::-1], 3)))
    crop = HeadCrop(0, 0, 48, 48, SIZE)
    still, plain = {int(each): RigidTransform() for each in index}, {int(each): np.ones(3) for each in index}
    dark = np.setdiff1d(index, BRIGHT)
    return read_olat_pictures(film, 2.2, crop, still, plain, BRIGHT, dark, subtract=subtract)


def test_the_room_is_that_about_each_flash(tmp_path: Path) -> None:
    found = read(tmp_path / "film.mp4")
    pictures = found.pictures.astype(np.float32).mean(axis=(1, 2, 3))
    np.testing.assert_allclose(pictures, FLASH, atol=0.012)
    assert found.room.mean() == pytest.approx(room(BRIGHT).mean(), abs=0.01)
    as_is = read(tmp_path / "film.mp4", subtract=False).pictures.astype(np.float32).mean(axis=(1, 2, 3))
    np.testing.assert_allclose(as_is, FLASH + room(BRIGHT), atol=0.012)


def test_few_frames_are_held() -> None:
    picture = np.zeros((4, 4, 3), np.float32)
    subtraction = RoomSubtraction(np.empty((len(BRIGHT), 4, 4, 3), np.float16), np.zeros((4, 4, 3)), subtract=True)
    rows, held = {int(index): row for row, index in enumerate(BRIGHT)}, []
    for index in range(66):
        if index in rows:
            subtraction.add_bright(rows[index], index / 30, picture)
        else:
            subtraction.add_dark(index / 30, picture)
        held.append(subtraction.held)
    assert 0 < max(held) < 8
    subtraction.finish()
