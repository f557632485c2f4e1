"""Comparison of two renderings of one field."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relit_camera.base.errors import InputError
from relit_camera.base.images.image_quality import psnr
from relit_camera.capture.picture_import import import_samples


@dataclass(frozen=True)
class Agreement:
    """Agreement of two fields, picture by picture, inside the first one's matte.

    Attributes:
        median_db, worst_db: PSNR of single lights' pictures; all have the field's brightest (99.5th percentile) as 1.
        energy_ratio: total light of the second field over that of the first.
    """

    median_db: float
    worst_db: float
    energy_ratio: float


def compare_fields(first: Path, second: Path) -> Agreement:
    """Compare the pictures of two folders with a `lights.lp` each.

    Raises:
        InputError: they differ in size or lights.
        LightsError, ImageError: a folder is damaged.
    """
    reference, other = (import_samples(folder / "lights.lp", "linear") for folder in (first, second))
    if reference.pictures.shape != other.pictures.shape:
        raise InputError(
            f"{first} has pictures {reference.pictures.shape}, {second} {other.pictures.shape}", "render both alike"
        )
    if not np.allclose(reference.directions, other.directions, atol=1e-3):
        raise InputError(f"{first} and {second} have other lights", "render both alike")
    inside = reference.matte > 0.5
    peak = float(np.percentile(reference.pictures[:, inside], 99.5))
    errors = [
        psnr(seen, expected, reference.matte, peak)
        for seen, expected in zip(other.pictures, reference.pictures, strict=True)
    ]
    energy = float(other.pictures[:, inside].sum() / reference.pictures[:, inside].sum())
    return Agreement(float(np.median(errors)), float(min(errors)), energy)
