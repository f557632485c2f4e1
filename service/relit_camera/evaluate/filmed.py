"""The truth of a subject built from a rendered capture: the field that was filmed, as the capture cut it out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.light.head_square import HeadSquare
from relit_camera.capture.stabilise.rigid import Rigid
from relit_camera.errors import InputError
from relit_camera.evaluate.candidates import Candidate
from relit_camera.evaluate.json_file import Record, read_json
from relit_camera.evaluate.truth import Truth
from relit_camera.reflectance.samples import Samples


class _Square(Record):
    left: float
    top: float
    side: float
    size: int


class _Motion(Record):
    reference: int


class _Report(Record):
    width_px: int
    height_px: int
    square: _Square
    motion: _Motion


class _ToRest(Record):
    rotation_deg: float
    translation_px: tuple[float, float]


class _Head(Record):
    to_rest: _ToRest


class _Frame(Record):
    head: _Head


class _Truth(Record):
    frames: list[_Frame]


def as_filmed(field: Samples, report: Path, truth: Path) -> Samples:
    """A field's pictures as they would be in the capture's reference frame, cut out as the capture did.

    Args:
        field: the pictures that were filmed (`python -m relit_studio field`), of the video's shape at any size.
        report: of `relit capture build`.
        truth: truth.json of the film.

    Raises:
        InputError: a file is missing or in another form, or they are not of one film.
    """
    found = read_json(report, _Report, "give a report of `relit capture build`")
    known = read_json(truth, _Truth, "give the truth.json of a rendered capture")
    if found.motion.reference >= len(known.frames):
        raise InputError(
            f"{report} tells of frame {found.motion.reference}, which {truth} has not", "give both of one film"
        )
    at_rest = known.frames[found.motion.reference].head.to_rest
    transform = Rigid(at_rest.rotation_deg, *at_rest.translation_px).inverse()
    size = (found.width_px, found.height_px)
    square = HeadSquare(found.square.left, found.square.top, found.square.side, found.square.size, size)
    pictures = np.stack([_cut(picture, square, transform) for picture in field.pictures])
    matte = _cut(np.repeat(field.matte[..., None], 3, axis=2), square, transform)[..., 0]
    return Samples(pictures, field.directions, np.clip(matte, 0, 1))


def in_unit_of(candidate: Candidate, truth: Truth, lights: NDArray[np.intp]) -> tuple[Candidate, NDArray[np.float64]]:
    """A candidate in the truth's unit, and the gains (3,) that do it: a film does not tell how bright white is.

    Least squares by channel over all pixels of the lights (some,).
    """
    seen, known = candidate.pictures_at(truth.directions[lights]), truth.colours[lights]
    gains = np.einsum("lpc,lpc->c", seen, known) / np.maximum(np.einsum("lpc,lpc->c", seen, seen), 1e-12)
    factor = gains.astype(np.float32)
    return replace(candidate, answer=lambda directions, pixels: candidate.answer(directions, pixels) * factor), gains


def _cut(picture: NDArray[np.float32], square: HeadSquare, transform: Rigid) -> NDArray[np.float32]:
    large = cv2.resize(picture, square.picture, interpolation=cv2.INTER_CUBIC)
    return np.maximum(square.cut(large, transform), 0)
