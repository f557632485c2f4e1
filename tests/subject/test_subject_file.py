"""The subject file: written whole, read back exactly, refused when damaged."""

from __future__ import annotations

import errno
import json
import mmap
import shutil
from pathlib import Path

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

from relit_camera.app.demo import demo_files
from relit_camera.base.errors import NotFoundError, StorageError, SubjectError
from relit_camera.capture.subject_builder import build_subject
from relit_camera.subject.compression.webp_packing import decode_basis
from relit_camera.subject.subject import Subject
from relit_camera.subject.subject_file import (
    HEADER_KEY,
    MAX_COPIED_BYTES,
    read_metadata,
    read_neutral,
    read_subject,
    write_subject,
)
from relit_camera.subject.subject_store import SubjectStore
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
    for name in ("pixels", "first", "values", "scales", "mixes"):
        np.testing.assert_array_equal(getattr(read.basis, name), getattr(subject.basis, name))
    for name in (
        "normals",
        "albedo",
        "depth",
        "horizons",
        "coefficients",
        "light_directions",
        "light_coefficients",
        "matte",
        "neutral",
    ):
        np.testing.assert_array_equal(getattr(read, name), getattr(subject, name))
    np.testing.assert_array_equal(read.landmarks["mesh478"], subject.landmarks["mesh478"])


def test_what_is_read_stays_in_the_file(path: Path) -> None:
    read = read_subject(path)
    for array in (read.basis.values, read.basis.mixes, read.coefficients, read.landmarks["mesh478"]):
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
        {"basis.values": np.zeros((3, 3, 128), np.float32)},
        {"basis.values": np.zeros((3, 3, 128), np.int8)},
        {"basis.pixels": np.full((2, 128), 256, np.int32)},
        {"normals": np.zeros((16, 16, 2), np.float16)},
        {"horizons": np.zeros((8, 16, 32), np.uint8)},
        {"neutral": np.zeros((16, 16, 3), np.int64)},
        {"landmarks.mesh478": np.zeros((5, 3), np.float32)},
    ],
    ids=[
        "nan",
        "shape",
        "dtype",
        "fewer values",
        "pixels beyond",
        "normals",
        "horizons",
        "foreign dtype",
        "landmarks",
    ],
)
def test_wrong_tensors_are_refused(path: Path, change: dict[str, np.ndarray]) -> None:
    _rewrite(path, change)
    with pytest.raises(SubjectError, match="not a usable subject"):
        read_subject(path)


@pytest.mark.parametrize("disk", ["there", "full"])
def test_a_copied_subject_outlives_its_file(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, disk: str
) -> None:
    if disk == "full":
        monkeypatch.setattr("tempfile.TemporaryFile", _no_space)
    files = sorted(tmp_path.iterdir())
    expected, copied = np.array(read_subject(path).basis.mixes), read_subject(path, copied=True)
    path.write_bytes(b"")
    copied.drop_pages()
    np.testing.assert_array_equal(copied.basis.mixes, expected)
    assert sorted(tmp_path.iterdir()) == files


def _no_space(**_: object) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.slow
@pytest.mark.parametrize("disk", ["free", "full"])
def test_a_decoded_basis_can_be_dropped_from_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, disk: str) -> None:
    path = tmp_path / "demonstration.relit"
    shutil.copyfile(demo_files.SUBJECT, path)
    if disk == "full":
        monkeypatch.setattr("tempfile.TemporaryFile", _no_space)
    copied, expected = read_subject(path, copied=True), read_subject(path).basis.values
    owner: object = copied.basis.values
    while isinstance(owner, np.ndarray):
        owner = owner.base
    assert isinstance(owner, mmap.mmap) == (disk == "free")
    assert not copied.basis.values.flags.writeable
    copied.drop_pages()
    np.testing.assert_array_equal(copied.basis.values, expected)
    assert list(tmp_path.iterdir()) == [path]


def test_what_is_copied_may_be_less_than_what_is_mapped(path: Path) -> None:
    with path.open("ab") as file:
        file.truncate(MAX_COPIED_BYTES + 1)  # takes no room
    with pytest.raises(SubjectError, match="larger than 1 GiB; build it again at a smaller size"):
        read_subject(path, copied=True)
    with pytest.raises(SubjectError, match="not a usable subject"):
        read_subject(path)


def test_header_and_neutral_picture_are_read_alone(subject: Subject, path: Path) -> None:
    _rewrite(path, {"coefficients": np.full((3, 2048), np.nan, np.float32)})
    assert read_metadata(path) == subject.metadata
    neutral = read_neutral(path)
    np.testing.assert_array_equal(neutral, subject.neutral)
    path.write_bytes(b"")  # it is no view of the file
    np.testing.assert_array_equal(neutral, subject.neutral)
    for read in (read_metadata, read_neutral):
        with pytest.raises(SubjectError, match="not a usable subject"):
            read(path)


@pytest.mark.parametrize("neutral", [np.zeros((17, 16, 3), np.uint8), np.zeros((16, 16, 3), np.int8), None])
def test_a_neutral_picture_of_another_kind_is_refused(path: Path, neutral: np.ndarray | None) -> None:
    tensors = {name: tensor for name, tensor in load_file(path).items() if name != "neutral"}
    header = read_metadata(path).model_dump_json()
    save_file(tensors if neutral is None else {**tensors, "neutral": neutral}, path, {HEADER_KEY: header})
    with pytest.raises(SubjectError, match="'neutral'"):
        read_neutral(path)


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

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(StorageError, match="free some space"):
        write_subject(tmp_path / "s.relit", subject)
    assert list(tmp_path.iterdir()) == []


def test_the_store_names_what_is_near(path: Path, tmp_path: Path) -> None:
    store = SubjectStore(tmp_path / "store")
    store.folder.mkdir()
    shutil.copy(path, store.folder / "anna.relit")
    (store.folder / ".anna.unfinished-0x1y2z3a.relit").touch()  # a write under way
    assert store.names() == ["anna"]
    assert store.resolve("anna")[0] == "anna"
    assert store.resolve(str(path))[0] == "s"
    with pytest.raises(NotFoundError, match="did you mean 'anna'"):
        store.resolve("ana")
    store.remove("anna")
    assert store.names() == []


def test_a_file_of_version_1_is_read(subject: Subject, path: Path) -> None:
    """As it was: one set of principal pictures for all pixels."""
    meta = subject.metadata
    pictures = subject.pictures(np.eye(meta.components, dtype=np.float32)).transpose(3, 0, 1, 2).astype(np.float16)
    tensors = {name: tensor for name, tensor in load_file(path).items() if not name.startswith("basis.")}
    old = json.loads(meta.model_dump_json(exclude={"texel_psnr_db", "map_psnr_db", "bytes_share"}))
    header = {HEADER_KEY: json.dumps({**old, "format_version": 1})}
    save_file({**tensors, "basis": np.ascontiguousarray(pictures)}, path, header)
    read = read_subject(path)
    assert read.metadata.bytes_share is None
    light = subject.light_coefficients[:, [7]]
    np.testing.assert_allclose(read.pictures(light), subject.pictures(light), atol=2e-3)


@pytest.mark.slow
def test_the_demonstration_is_read_as_it_was_shipped() -> None:
    """Format version 1, its principal pictures as WebP: what it showed before, it shows."""
    read = read_subject(demo_files.SUBJECT)
    assert read.metadata.format_version == 1
    with safe_open(demo_files.SUBJECT, framework="numpy") as file:
        encoded = file.get_tensor("basis_webp")
    height, width = read.matte.shape
    pictures = decode_basis(encoded, (3, read.metadata.components, height, width)).astype(np.float32)
    light = read.coefficients[:, 1000]
    expected = np.einsum("ckhw,k->hwc", pictures, light) * (read.matte[..., None] > 0)
    np.testing.assert_allclose(read.pictures(light[:, None])[0], expected, atol=1e-4)
