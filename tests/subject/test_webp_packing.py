"""Small subjects: what they cost, and that they are read as any other."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

from relit_camera.base.errors import InputError, SubjectError
from relit_camera.base.images.image_quality import psnr
from relit_camera.capture.subject_builder import build_subject
from relit_camera.light.environments.builtin.builtin_light_maps import builtin_light_map
from relit_camera.subject.compression.webp_packing import decode_basis, encode_basis, light_psnrs_db, pack_subject
from relit_camera.subject.relighting.basis_relighter import BasisRelighter
from relit_camera.subject.subject import Subject
from relit_camera.subject.subject_file import read_subject, write_subject
from tests.synthetic import sphere_samples


@pytest.fixture(scope="module")
def subject() -> Subject:
    return build_subject(sphere_samples(120, 32), "barycentric", "lights.lp", landmarks={})


def under(subject: Subject, environment: str) -> np.ndarray:
    return BasisRelighter(subject).relight(builtin_light_map(environment)[None])[0]


def test_a_basis_comes_back_within_half_a_step() -> None:
    basis = np.random.default_rng(1).uniform(-1, 1, (3, 7, 12, 10)).astype(np.float32)
    back = decode_basis(encode_basis(basis), basis.shape).astype(np.float32)
    error = np.abs(np.sign(back) * np.sqrt(np.abs(back)) - np.sign(basis) * np.sqrt(np.abs(basis)))
    assert error.max() < 0.5 / 127 + 1e-3  # and what float16 rounds
    assert error.max() > 0.3 / 127


def test_red_is_red_in_the_picture_too() -> None:
    basis = np.zeros((3, 1, 8, 8), np.float32)
    basis[0] = 1
    bgr = cv2.imdecode(encode_basis(basis), cv2.IMREAD_UNCHANGED)
    assert (bgr == [128, 128, 255]).all()


@pytest.mark.slow
def test_environments_come_out_nearly_as_they_were(subject: Subject) -> None:
    small = pack_subject(subject, 40)
    for name in ("studio", "sunset", "party"):
        assert psnr(under(small, name), under(subject, name), subject.matte) > 40


def test_more_components_are_nearer_to_the_subject(subject: Subject) -> None:
    errors = [np.median(light_psnrs_db(pack_subject(subject, components), subject)) for components in (4, 12, 36)]
    assert errors[0] < errors[1] < errors[2]


def test_the_header_tells_what_is_left(subject: Subject) -> None:
    small = pack_subject(subject, 12)
    assert small.metadata.components == 12
    assert small.metadata.psnr_db == pytest.approx(min(light_psnrs_db(small, subject)))
    assert small.metadata.psnr_db < subject.metadata.psnr_db


def test_a_small_file_is_read_as_it_was_written(subject: Subject, tmp_path: Path) -> None:
    small = pack_subject(subject, 16)
    write_subject(tmp_path / "full.relit", small)
    write_subject(tmp_path / "small.relit", small, small=True)
    read = read_subject(tmp_path / "small.relit")
    np.testing.assert_array_equal(read.basis.values, small.basis.values)
    np.testing.assert_array_equal(read.coefficients, small.coefficients)
    assert read.metadata == small.metadata
    basis_bytes = small.basis.values.nbytes
    saved = (tmp_path / "full.relit").stat().st_size - (tmp_path / "small.relit").stat().st_size
    assert saved > basis_bytes / 2


@pytest.mark.parametrize(
    "wrong",
    [np.zeros(0, np.uint8), np.zeros(10, np.uint8), np.zeros((2, 2), np.uint8), np.zeros(10, np.float32)],
)
def test_a_damaged_small_file_is_refused(subject: Subject, tmp_path: Path, wrong: np.ndarray) -> None:
    path = tmp_path / "small.relit"
    write_subject(path, pack_subject(subject, 4), small=True)
    with safe_open(path, framework="numpy") as file:
        header = file.metadata()
    save_file({**load_file(path), "basis_webp": wrong}, path, header)
    with pytest.raises(SubjectError, match="not a usable subject"):
        read_subject(path)


@pytest.mark.parametrize("components", [0, 10_000])
def test_more_than_there_are_cannot_be_kept(subject: Subject, components: int) -> None:
    with pytest.raises(InputError, match=f"{components} were asked for"):
        pack_subject(subject, components)


def test_pictures_too_large_for_the_format_are_refused() -> None:
    with pytest.raises(InputError, match="do not fit"):
        encode_basis(np.zeros((3, 4, 8, 9000), np.float32))
