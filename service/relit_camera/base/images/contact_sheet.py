"""Contact sheets: labeled pictures in rows and columns, for people to look at."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from relit_camera.base.errors import ImageError
from relit_camera.base.images.image_types import DisplayImage, check_image
from relit_camera.base.images.resize import letterbox

_FONT = cv2.FONT_HERSHEY_SIMPLEX
_TEXT_HEIGHT = 13
_MARGIN = 8
_LABEL_HEIGHT = _TEXT_HEIGHT + 2 * _MARGIN
"""Height of the band above the cells that holds their labels."""

_GAP = 4
_PAGE_GRAY, _CELL_GRAY, _TEXT_GRAY = 28, 44, 225


def contact_sheet(
    rows: Sequence[Sequence[DisplayImage | None]],
    row_labels: Sequence[str] = (),
    column_labels: Sequence[str] = (),
    cell_width: int = 240,
) -> DisplayImage:
    """Lay pictures out in rows and columns, uint8 sRGB.

    Every cell has the shape of the first picture; others are fitted in whole. Rows may differ in length, None leaves a
    cell empty, and enlarged pixels stay squares.

    Args:
        rows: uint8 sRGB pictures of any size.
        row_labels: one a row, or none; ASCII, since OpenCV's font has no more.
        column_labels: one a column, or none.
        cell_width: in pixels.

    Raises:
        ImageError: there is no picture at all, or one is not uint8 (height, width, 3).
        ValueError: the number of labels is neither that of the rows or columns nor 0.
    """
    pictures = [picture for row in rows for picture in row if picture is not None]
    if not pictures:
        raise ImageError("a contact sheet of no pictures", "give it at least one")
    for picture in pictures:
        check_image(picture, np.uint8, "picture on the contact sheet")
    columns = max(len(row) for row in rows)
    for kind, labels, count in (("row", row_labels, len(rows)), ("column", column_labels, columns)):
        if len(labels) not in (0, count):
            raise ValueError(f"{len(labels)} {kind} labels for {count} {kind}s")

    cell = (cell_width, max(1, round(cell_width * pictures[0].shape[0] / pictures[0].shape[1])))
    left = max((_text_width(label) for label in row_labels), default=-2 * _MARGIN) + 2 * _MARGIN
    top = _LABEL_HEIGHT if column_labels else 0
    shape = (top + len(rows) * (cell[1] + _GAP) - _GAP, left + columns * (cell[0] + _GAP) - _GAP, 3)
    sheet = np.full(shape, _PAGE_GRAY, dtype=np.uint8)
    for j, label in enumerate(column_labels):
        _write(sheet, label, left + j * (cell[0] + _GAP), _MARGIN, cell[0])
    for i, row in enumerate(rows):
        y = top + i * (cell[1] + _GAP)
        if row_labels:
            _write(sheet, row_labels[i], _MARGIN, y + (cell[1] - _TEXT_HEIGHT) // 2, left)
        for j, shown in enumerate(row):
            if shown is not None:
                x = left + j * (cell[0] + _GAP)
                # Enlarged without interpolation, so that the sheet shows the pixels as they are.
                sheet[y : y + cell[1], x : x + cell[0]] = letterbox(shown, cell, (_CELL_GRAY,) * 3, cv2.INTER_NEAREST)
    return sheet


def _text_width(text: str) -> int:
    return int(cv2.getTextSize(text, _FONT, _text_scale(), 1)[0][0])


def _text_scale() -> float:
    return float(cv2.getFontScaleFromHeight(_FONT, _TEXT_HEIGHT, 1))


def _write(sheet: DisplayImage, text: str, x: int, y: int, width: int) -> None:
    """Write a line with its upper left corner at (x, y), smaller where it would be wider than `width`."""
    scale = _text_scale() * min(1.0, width / max(1, _text_width(text)))
    cv2.putText(sheet, text, (x, y + _TEXT_HEIGHT), _FONT, scale, (_TEXT_GRAY,) * 3, 1, cv2.LINE_AA)
