"""Picture files: mattes."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from relit_camera.space.picture_files import read_mask

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
