"""Recorded mattes that mean harm."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.errors import InputError
from relit_camera.base.images.image_types import Frame
from relit_camera.face.matting import RecordedMatting


def npz(path: Path, header_shape: tuple[int, ...], content: bytes, dtype: str = "|u1") -> Path:
    """A zip with an array's header and other content than that says."""
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": dtype, "fortran_order": False, "shape": header_shape})
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("alpha.npy", head.getvalue() + content)
    return path


def pickled(path: Path) -> Path:
    np.savez(path, alpha=np.array([{"a": 1}], dtype=object), allow_pickle=True)
    return path


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda path: npz(path, (4000, 1000, 1000), bytes(100_000_000)), "3814 MiB, more than 1024"),
        (lambda path: npz(path, (1 << 40, 1 << 20, 1), b""), "MiB, more than 1024"),
        (lambda path: npz(path, (10, 64, 64), bytes(100)), "holds no recorded mattes"),
        (lambda path: npz(path, (-10, 64, 64), bytes(100)), "holds no recorded mattes"),
        (lambda path: npz(path, (0, 64, 64), b""), "(0, 64, 64)"),
        (lambda path: npz(path, (1, 4, 4), bytes(16 * 8), "<f8"), "<f8"),
        (pickled, "|O"),
    ],
    ids=["a bomb", "2^60 bytes", "short", "negative", "empty", "floats", "pickle"],
)
def test_they_are_refused_before_memory_is_taken(tmp_path: Path, make: object, said: str) -> None:
    assert callable(make)
    with pytest.raises(InputError) as caught:
        RecordedMatting(make(tmp_path / "a.npz"))
    assert said in caught.value.what
    assert "\n" not in str(caught.value)


def test_what_is_read_is_what_was_looked_at(tmp_path: Path) -> None:
    """A zip may hold `alpha` beside `alpha.npy`."""
    path, content = npz(tmp_path / "a.npz", (1, 2, 2), bytes([1, 2, 3, 4])), io.BytesIO()
    np.lib.format.write_array(content, np.zeros((64, 64, 64), np.uint8))
    with zipfile.ZipFile(path, "a") as file:
        file.writestr("alpha", content.getvalue())
    matte = RecordedMatting(path).matte(Frame(np.zeros((2, 2, 3), np.uint8), 0, 0.0, 0.0))
    np.testing.assert_array_equal(matte, [[1, 2], [3, 4]])
