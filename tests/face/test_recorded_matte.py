"""Recorded mattes: played back by index, scaled as the frames are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.errors import InputError, NotFoundError
from relit_camera.base.images.image_types import Frame
from relit_camera.base.images.resize import crop_to_fill
from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.face.matte_files import write_mattes
from relit_camera.face.matting import RecordedMatting, matting_factory


def frame(index: int, width: int = 64, height: int = 36) -> Frame:
    return Frame(np.zeros((height, width, 3), np.uint8), index, 0.0, 0.0)


def disc(at: float, width: int = 64, height: int = 36) -> np.ndarray:
    x, y = np.arange(width) + 0.5, (np.arange(height) + 0.5)[:, None]
    return np.clip(9 - np.hypot(x - at, y - height / 2), 0, 1).astype(np.float32)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_mattes(tmp_path / "mattes.npz", [disc(at) for at in (20, 32, 44)])
    return tmp_path / "mattes.npz"


def test_each_frame_has_its_own_and_a_looped_clip_begins_again(path: Path) -> None:
    mattes = RecordedMatting(path)
    for index, at in enumerate((20, 32, 44, 20, 32)):
        np.testing.assert_allclose(mattes.matte(frame(index)) / 255, disc(at), atol=0.5 / 255 + 1e-6)


@pytest.mark.parametrize("size", [(128, 72), (72, 72), (100, 40)])
def test_it_is_scaled_and_cut_as_the_frame_is(path: Path, size: tuple[int, int]) -> None:
    shown = crop_to_fill(np.repeat((disc(32) * 255).astype(np.uint8)[..., None], 3, axis=2), size)
    found = RecordedMatting(path).matte(frame(1, *size))
    assert found.dtype == np.uint8
    assert np.abs(found.astype(int) - shown[..., 0]).mean() < 2.5


def test_a_file_that_holds_none_is_refused(tmp_path: Path) -> None:
    other, text, bare = tmp_path / "other.npz", tmp_path / "text.npz", tmp_path / "bare.npy"
    np.savez(other, alpha=np.zeros((2, 3), np.float32))
    text.write_text("mattes")
    np.save(bare, np.zeros((2, 3, 4), np.uint8))
    reasons = (other, "<f4"), (text, "holds no"), (bare, "holds no"), (tmp_path / "gone.npz", "cannot read")
    for path, words in reasons:
        with pytest.raises(InputError, match=words):
            RecordedMatting(path)


def test_a_damaged_file_is_refused(path: Path) -> None:
    whole = path.read_bytes()
    for damage in (whole[:-40], whole[:80] + b"\xff" * 40 + whole[120:]):
        path.write_bytes(damage)
        with pytest.raises(InputError, match="holds no"):
            RecordedMatting(path)


@pytest.mark.parametrize("name", ["magic", "recorded", "recorded:", "selfie:x"])
def test_an_unknown_matte_is_refused(name: str) -> None:
    with pytest.raises(NotFoundError, match="no matte"):
        matting_factory(name, SessionOptions("cpu"))


def test_a_recorded_matte_is_read_at_once(path: Path) -> None:
    np.testing.assert_allclose(
        matting_factory(f"recorded:{path}", SessionOptions("cpu"))().matte(frame(0)) / 255, disc(20), atol=0.003
    )
