"""Figures of the ladder: of what is shown, and of the reflectance field itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import DisplayImage, LinearImage
from relit_camera.base.images.tone_mapping import display_from_linear, linear_from_display
from relit_camera.lab.evaluate.field.relighting_metrics import MAX_DB

Pictures = NDArray[np.float32]


@dataclass(frozen=True)
class FieldFigures:
    """PSNR of relit pictures in linear light against the truth's, the truth's 99.5th percentile as 1, unclipped.

    Attributes:
        as_is_db: (environments,) of the pictures as they are.
        white_balanced_db: (environments,) with one gain a channel for all environments together, as sliders have it.
    """

    as_is_db: NDArray[np.float64]
    white_balanced_db: NDArray[np.float64]


def shown_psnr(shown: DisplayImage, truth: LinearImage, counted: NDArray[np.bool_]) -> float:
    """PSNR in dB of a displayed picture, 255 the peak, with the one gain of light that brings it nearest.

    Args:
        shown: uint8 sRGB (height, width, 3).
        truth: the true light in display exposure, (height, width, 3).
        counted: pixels that count, (height, width).
    """
    light, expected = linear_from_display(shown)[counted], truth[counted]
    gain = np.float32(_best_gain(light, expected))
    seen, goal = (display_from_linear(np.ascontiguousarray(each[None])) for each in (light * gain, expected))
    return _db(float(np.mean((seen.astype(np.float64) - goal) ** 2)) / 255**2)


def brightness_ev(shown: DisplayImage, truth: LinearImage, counted: NDArray[np.bool_]) -> float:
    """How much brighter than the truth a displayed picture is, in stops; negative where it is darker."""
    return -float(np.log2(max(_best_gain(linear_from_display(shown)[counted], truth[counted]), 1e-9)))


def field_figures(pictures: Pictures, truth: Pictures, counted: NDArray[np.bool_]) -> FieldFigures:
    """Figures of pictures (environments, height, width, 3) against the truth's."""
    peaks = np.array([np.percentile(each[counted], 99.5) for each in truth], np.float64)
    scale = 1 / np.where(peaks > 0, peaks, 1)[:, None, None]
    seen, expected = pictures[:, counted] * scale, truth[:, counted] * scale
    gain = (seen * expected).sum(axis=(0, 1)) / np.maximum((seen * seen).sum(axis=(0, 1)), 1e-12)
    return FieldFigures(_each_db(seen, expected), _each_db(seen * gain, expected))


def tinted(picture: LinearImage, truth: LinearImage, counted: NDArray[np.bool_]) -> LinearImage:
    """The picture times one color, which gives the person the truth's mean color: all that a tint can know."""
    gain = truth[counted].mean(axis=0) / np.maximum(picture[counted].mean(axis=0), 1e-6)
    return np.asarray(picture * gain, np.float32)


def _each_db(seen: NDArray[np.float64], expected: NDArray[np.float64]) -> NDArray[np.float64]:
    pairs: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]] = list(zip(seen, expected, strict=True))
    return np.array([_db(float(np.mean((a - b) ** 2))) for a, b in pairs])


def _db(error: float) -> float:
    return min(-10 * float(np.log10(max(error, 1e-30))), MAX_DB)


def _best_gain(light: NDArray[np.float32], expected: NDArray[np.float32]) -> float:
    """The factor that brings colors (count, 3) nearest to others in least squares."""
    return _vdot(light, expected) / max(_vdot(light, light), 1e-12)


def _vdot(a: NDArray[np.float32], b: NDArray[np.float32]) -> float:
    return float(np.vdot(a.astype(np.float64), b))
