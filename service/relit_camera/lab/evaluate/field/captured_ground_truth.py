"""Truth of a subject built from a rendered capture: the filmed field, cropped as the capture cropped it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import InputError
from relit_camera.capture.alignment.rigid_transform import RigidTransform
from relit_camera.capture.film.olat.head_crop import HeadCrop
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.lab.evaluate.field.candidates import Candidate
from relit_camera.lab.evaluate.field.ground_truth import GroundTruth
from relit_camera.lab.evaluate.json_records import Record, read_json_record
from relit_camera.lab.evaluate.rendered_truth import HeadTruth, read_truth


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


def crop_like_capture(field: OlatSamples, report: Path, truth: Path) -> OlatSamples:
    """Move a field's pictures into the capture's reference frame and crop them as the capture did.

    Args:
        field: the pictures that were filmed (`python -m relit_studio field`), of the video's shape at any size.
        report: of `relit capture build`.
        truth: truth.json of the film.

    Raises:
        InputError: a file is missing or in another form, or they are not of one film.
    """
    found = read_json_record(report, _Report, "give a report of `relit capture build`")
    known = read_truth(truth, HeadTruth)
    if found.motion.reference >= len(known.frames):
        raise InputError(
            f"{report} tells of frame {found.motion.reference}, which {truth} has not", "give both of one film"
        )
    at_rest = known.frames[found.motion.reference].head.to_rest
    transform = RigidTransform(at_rest.rotation_deg, *at_rest.translation_px).inverse()
    size = (found.width_px, found.height_px)
    square = HeadCrop(found.square.left, found.square.top, found.square.side, found.square.size, size)
    pictures = np.stack([_cut(picture, square, transform) for picture in field.pictures])
    matte = _cut(np.repeat(field.matte[..., None], 3, axis=2), square, transform)[..., 0]
    return OlatSamples(pictures, field.directions, np.clip(matte, 0, 1))


def scale_to_truth(
    candidate: Candidate, truth: GroundTruth, lights: NDArray[np.intp]
) -> tuple[Candidate, NDArray[np.float64]]:
    """A candidate scaled to the truth, since a film does not tell how bright white is, and the gains (3,) used.

    The gains are least squares by channel over all pixels of the lights (some,).
    """
    seen, known = candidate.pictures_at(truth.directions[lights]), truth.colors[lights]
    gains = np.einsum("lpc,lpc->c", seen, known) / np.maximum(np.einsum("lpc,lpc->c", seen, seen), 1e-12)
    factor = gains.astype(np.float32)
    return replace(candidate, predict=lambda directions, pixels: candidate.predict(directions, pixels) * factor), gains


def _cut(picture: NDArray[np.float32], square: HeadCrop, transform: RigidTransform) -> NDArray[np.float32]:
    large = cv2.resize(picture, square.picture, interpolation=cv2.INTER_CUBIC)
    return np.maximum(square.crop(large, transform), 0)
