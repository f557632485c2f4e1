"""Expression stills in a subject file: they come back, and damaged ones are refused with the reason."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

from relit_camera.base.errors import SubjectError
from relit_camera.subject.compression.webp_packing import encode_basis, pack_subject
from relit_camera.subject.expression_stills import MAX_STILLS, PREFIX, ExpressionStill, still_tensors, stills_of_tensors
from relit_camera.subject.subject import Subject
from relit_camera.subject.subject_file import HEADER_KEY, read_subject, write_stills, write_subject
from tests.live.people import close_up


def still(seed: int, side: int = 48) -> ExpressionStill:
    rng = np.random.default_rng(seed)
    ramp = np.linspace(0, 200, side)
    image = np.dstack([np.add.outer(ramp, 50 * np.sin(ramp / 20 + seed))] * 3).clip(0, 255).astype(np.uint8)
    return ExpressionStill(
        image,
        rng.random((478, 2), np.float32) * side,
        rng.random((478, 3), np.float32),
        rng.random(3, np.float32),
        rng.random((32, 64, 3), np.float32),
    )


def packed() -> Subject:
    """The person as a packed subject."""
    return pack_subject(close_up(), 4)


def two_rows(values: np.ndarray) -> np.ndarray:
    """A tensor (count,) as one of shape (2, …)."""
    return np.append(values, np.zeros(-len(values) % 2, np.uint8)).reshape(2, -1)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_subject(tmp_path / "s.relit", replace(close_up(), stills=(still(0), still(1))))
    return tmp_path / "s.relit"


def test_what_is_written_is_read(path: Path) -> None:
    read = read_subject(path).stills
    assert len(read) == 2
    for found, written in zip(read, (still(0), still(1)), strict=True):
        np.testing.assert_array_equal(found.landmarks, written.landmarks)
        np.testing.assert_array_equal(found.expression, written.expression)
        np.testing.assert_array_equal(found.rotation, written.rotation)
        np.testing.assert_allclose(found.light, written.light, rtol=1e-3, atol=1e-6)
        assert np.abs(found.image.astype(int) - written.image).mean() < 2


def test_a_small_subject_keeps_its_stills(tmp_path: Path) -> None:
    write_subject(tmp_path / "s.relit", replace(packed(), stills=(still(0),)), small=True)
    assert len(read_subject(tmp_path / "s.relit").stills) == 1


@pytest.mark.parametrize("form", ["local", "packed", "global float16"])
def test_other_stills_leave_all_else_as_it_was(tmp_path: Path, form: str) -> None:
    """The basis too, in whatever form the file holds it."""
    before, after = tmp_path / "s.relit", tmp_path / "t.relit"
    person = packed() if form == "packed" else close_up()
    write_subject(before, replace(person, stills=(still(2),)), small=form == "packed")
    if form == "global float16":
        with safe_open(before, framework="numpy") as file:
            header = json.loads(file.metadata()[HEADER_KEY])
        tensors = {name: each for name, each in load_file(before).items() if not name.startswith("basis.")}
        shape = (3, header["components"], header["height"], header["width"])
        tensors["basis"] = np.random.default_rng(0).normal(0, 2, shape).astype(np.float16)
        save_file(tensors, before, {HEADER_KEY: json.dumps(header | {"format_version": 1})})
    write_stills(before, after, (still(0), still(1)))
    assert len(read_subject(after).stills) == 2
    old, new = load_file(before), load_file(after)
    assert old.keys() == new.keys()
    for name, values in old.items():
        if not name.startswith(PREFIX):
            np.testing.assert_array_equal(new[name], values, strict=True)
    write_stills(before, before, (still(0), still(1)))
    assert before.read_bytes() == after.read_bytes()


def test_pictures_that_would_come_back_as_others_are_not_packed() -> None:
    with pytest.raises(ValueError, match="beyond"):
        encode_basis(np.full((3, 1, 8, 8), 1.5, np.float32))


def test_a_subject_without_stills_has_no_tensor_of_them(tmp_path: Path) -> None:
    write_subject(tmp_path / "s.relit", close_up())
    with safe_open(tmp_path / "s.relit", framework="numpy") as file:
        assert not [name for name in file.keys() if name.startswith(PREFIX)]  # noqa: SIM118
    assert read_subject(tmp_path / "s.relit").stills == ()


@pytest.mark.parametrize(
    ("name", "changed", "words"),
    [
        ("webp", None, "without 'stills.webp'"),
        ("rotations", None, "without 'stills.rotations'"),
        ("webp", np.arange(100, dtype=np.uint8), "cannot be decoded"),
        ("landmarks", np.zeros((3, 478, 2), np.float32), "stills"),
        ("expressions", np.zeros((2, 478, 2), np.float32), "expression has shape"),
        ("landmarks", np.zeros((2, 66, 2), np.float32), "landmarks has shape"),
        ("webp", np.zeros((4, 25), np.uint8), "cannot be decoded"),
        ("webp", two_rows(still_tensors((still(0), still(1)))[PREFIX + "webp"]), "cannot be decoded"),
        ("webp", cv2.imencode(".tif", np.zeros((96, 48, 3), np.uint8))[1].ravel(), "cannot be decoded"),
        ("landmarks", np.full((2, 478, 2), 1e6, np.float32), "outside"),
        ("landmarks", np.full((2, 478, 2), 10, np.float32), "eyes"),
        ("expressions", np.full((2, 478, 3), 1e9, np.float32), "expression is larger"),
        ("rotations", np.full((2, 3), 100, np.float32), "rotation is larger"),
        ("lights", np.full((2, 32, 64, 3), -1, np.float16), "negative"),
        ("lights", np.full((2, 32, 64, 3), np.inf, np.float16), "infinity"),
        ("lights", np.full((2, 32, 64, 3), np.nan, np.float16), "NaN"),
        ("landmarks", np.zeros((2, 478, 2), np.float64), "F64"),
    ],
)
def test_damaged_stills_are_refused(path: Path, name: str, changed: np.ndarray | None, words: str) -> None:
    with safe_open(path, framework="numpy") as file:
        header = file.metadata()
    tensors = load_file(path)
    tensors.pop(PREFIX + name)
    if changed is not None:
        tensors[PREFIX + name] = changed
    save_file(tensors, path, header)
    with pytest.raises(SubjectError, match=words):
        read_subject(path)


def test_a_picture_that_is_too_large_is_refused_before_it_is_decoded() -> None:
    tensors = still_tensors((still(0),))
    tensors[PREFIX + "webp"] = still_tensors((still(0, 640),))[PREFIX + "webp"]
    assert stills_of_tensors(tensors)[0].image.shape == (640, 640, 3)
    with pytest.raises(ValueError, match="more than a subject may have"):
        still_tensors((still(0, 641),))
    with pytest.raises(ValueError, match="more than a subject may have"):
        still_tensors((still(0),) * (MAX_STILLS + 1))
