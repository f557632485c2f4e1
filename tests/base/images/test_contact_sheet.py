from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.errors import ImageError
from relit_camera.base.images.contact_sheet import contact_sheet


def flat(value: int, height: int = 30, width: int = 40) -> np.ndarray:
    return np.full((height, width, 3), value, np.uint8)


def test_pictures_stand_in_rows_and_columns() -> None:
    sheet = contact_sheet([[flat(10), flat(60)], [flat(110), flat(160)]], cell_width=40)
    assert sheet.shape == (64, 84, 3)
    assert [int(sheet[y, x, 0]) for y in (15, 49) for x in (20, 64)] == [10, 60, 110, 160]


def test_labels_are_written_beside_the_pictures_not_on_them() -> None:
    rows = [[flat(60), flat(60)], [flat(60), flat(60)]]
    bare = contact_sheet(rows, cell_width=80)
    sheet = contact_sheet(rows, ["live", "relit"], ["first", "a label far too long for its column"], cell_width=80)
    top, left = sheet.shape[0] - bare.shape[0], sheet.shape[1] - bare.shape[1]
    np.testing.assert_array_equal(sheet[top:, left:], bare)
    for band in (sheet[:top, left : left + 80], sheet[:top, left + 84 :], sheet[top : top + 60, :left]):
        assert (band > 150).mean() > 0.003


def test_a_picture_of_another_shape_is_fitted_whole() -> None:
    sheet = contact_sheet([[flat(60, 40, 40), flat(200, 40, 10)]], cell_width=40)
    assert sheet.shape == (40, 84, 3)
    bright = np.flatnonzero(sheet[20, :, 0] == 200)
    assert (bright.min(), bright.max()) == (44 + 15, 44 + 24)


def test_small_pictures_keep_their_pixels_as_squares() -> None:
    checks = np.tile(np.array([[0, 255], [255, 0]], np.uint8), (2, 2))[..., None].repeat(3, axis=2)
    assert set(np.unique(contact_sheet([[checks]], cell_width=40))) == {0, 255}


def test_rows_may_be_short_and_cells_empty() -> None:
    sheet = contact_sheet([[flat(60), None, flat(90)], [flat(120)]], cell_width=40)
    assert sheet.shape == (64, 128, 3)
    assert len(np.unique(sheet[34:, 44:])) == 1


def test_what_cannot_be_laid_out_is_refused() -> None:
    with pytest.raises(ImageError, match="no pictures"):
        contact_sheet([[None], []])
    with pytest.raises(ImageError, match="contact sheet has shape"):
        contact_sheet([[flat(3).astype(np.float32)]])
    with pytest.raises(ValueError, match="1 row labels for 2 rows"):
        contact_sheet([[flat(1)], [flat(2)]], ["only"])
