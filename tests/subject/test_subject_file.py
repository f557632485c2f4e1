"""The subject file: written whole, read back exactly, refused when damaged."""

from __future__ import annotations

import json
import mmap
import shutil
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import load_file, save_file

from relit_camera.capture.build import build_subject
from relit_camera.errors import NotFoundError, StorageError, SubjectError
from relit_camera.subject.compress import compress
from relit_camera.subject.field import FactoredField
from relit_camera.subject.file import HEADER_KEY, read_subject, write_subject
from relit_camera.subject.store import SubjectStore
from relit_camera.subject.subject import Subject
from tests.synthetic import sphere_samples


@pytest.fixture(scope="module")
def subject() -> Subject:
    points = {"mesh478": np.random.default_rng(0).random((478, 2), dtype=np.float32)}
    return build_subject(sphere_samples(60, 16), "barycentric", "lights.lp", landmarks=points)


@pytest.fixture
def path(subject: Subject, tmp_path: Path) -> Path:
    write_subject(tmp_path / "s.relit", subject)
    return tmp_path / "s.relit"


def test_what_is_written_is_read(subject: Subject, path: Path) -> None:
    read = read_subject(path)
    assert read.metadata == subject.metadata
    for name in ("basis", "coefficients", "light_directions", "light_coefficients", "matte", "neutral"):
        np.testing.assert_array_equal(getattr(read, name), getattr(subject, name))
    np.testing.assert_array_equal(read.landmarks["mesh478"], subject.landmarks["mesh478"])


def test_what_is_read_stays_in_the_file(path: Path) -> None:
    read = read_subject(path)
    for array in (read.basis, read.coefficients, read.landmarks["mesh478"]):
        assert not array.flags.writeable
        owner: object = array
        while isinstance(owner, np.ndarray):
            owner = owner.base
        assert isinstance(owner, mmap.mmap)


def _rewrite(path: Path, change: dict[str, np.ndarray] | None = None, header: dict[str, object] | None = None) -> None:
    tensors = load_file(path)
    metadata = json.loads(read_subject(path).metadata.model_dump_json())
    save_file({**tensors, **(change or {})}, path, {HEADER_KEY: json.dumps({**metadata, **(header or {})})})


def test_another_version_is_one_clear_error(path: Path) -> None:
    _rewrite(path, header={"format_version": 7})
    with pytest.raises(SubjectError, match="format version 7"):
        read_subject(path)


@pytest.mark.parametrize(
    "change",
    [
        {"coefficients": np.full((3, 2048), np.nan, np.float32)},
        {"matte": np.zeros((3, 3), np.float32)},
        {"basis": np.zeros((3, 1, 16, 16), np.float32)},
        {"neutral": np.zeros((16, 16, 3), np.int64)},
        {"landmarks.mesh478": np.zeros((5, 3), np.float32)},
    ],
    ids=["nan", "shape", "dtype", "foreign dtype", "landmarks"],
)
def test_wrong_tensors_are_refused(path: Path, change: dict[str, np.ndarray]) -> None:
    _rewrite(path, change)
    with pytest.raises(SubjectError, match="not a usable subject"):
        read_subject(path)


@pytest.mark.parametrize("keep", [0, 7, 100, 0.5, 0.99])
def test_a_truncated_file_is_refused(path: Path, keep: float) -> None:
    data = path.read_bytes()
    path.write_bytes(data[: int(keep if keep >= 1 or keep == 0 else keep * len(data))])
    with pytest.raises(SubjectError):
        read_subject(path)


def test_a_file_of_something_else_is_refused(path: Path) -> None:
    save_file({"weights": np.zeros(3, np.float32)}, path)
    with pytest.raises(SubjectError, match="no Relit Camera header"):
        read_subject(path)


def test_a_full_disk_leaves_nothing(subject: Subject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("relit_camera.subject.file.save_file", full)
    with pytest.raises(StorageError, match="free some space"):
        write_subject(tmp_path / "s.relit", subject)
    assert list(tmp_path.iterdir()) == []


def test_the_store_names_what_is_near(path: Path, tmp_path: Path) -> None:
    store = SubjectStore(tmp_path / "store")
    store.folder.mkdir()
    shutil.copy(path, store.folder / "anna.relit")
    (store.folder / ".anna.0x1y.relit").touch()  # a write under way
    assert store.names() == ["anna"]
    assert store.resolve("anna")[0] == "anna"
    assert store.resolve(str(path))[0] == "s"
    with pytest.raises(NotFoundError, match="did you mean 'anna'"):
        store.resolve("ana")
    store.remove("anna")
    assert store.names() == []


def test_compression_takes_no_more_than_the_error_asks() -> None:
    """A field of true rank 5 in 40 lights needs five pictures."""
    rng = np.random.default_rng(1)
    hidden = rng.random((5, 12, 10, 3), dtype=np.float32)
    mix = rng.random((40, 5), dtype=np.float32)
    pictures = np.tensordot(mix, hidden, axes=(1, 0))
    weights = rng.random((40, 2048), dtype=np.float32) / 40
    field = FactoredField(pictures, np.tile([0.0, 0.0, 1.0], (40, 1)), lambda texels: weights)
    compressed = compress(field, np.ones((12, 10), np.float32))
    assert compressed.basis.shape[1] == 5
    assert compressed.psnr_db >= 50
    restored = np.einsum("ckhw,kl->lhwc", compressed.basis.astype(np.float32), compressed.coefficients)
    expected = np.einsum("nhwc,nl->lhwc", pictures, weights)
    np.testing.assert_allclose(restored, expected, atol=2e-3 * expected.max())
