"""How long the camera's focal length is, and where that is known from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relit_camera.errors import InputError

FILM_DIAGONAL_MM = 43.27
"""Of 36x24 mm film, by whose diagonal equivalent focal lengths are reckoned (CIPA DCG-001)."""
TYPICAL_MM, TYPICAL_ERROR = 31.0, 0.25
"""A phone's main camera is a 24 to 28 mm lens for stills; a video keeps the width, not the height, and stabilising cuts
a tenth away: about 31 mm of what is left, give or take a quarter with the makes."""
TAG_ERROR = 0.08
"""The tag tells of stills. What stabilising cuts away from a video, it does not say."""
FLAG_ERROR = 0.02


@dataclass(frozen=True)
class Focal:
    """A focal length.

    Attributes:
        pixels: of the upright picture.
        error: relative standard error.
        source: where it is from, for people.
    """

    pixels: float
    error: float
    source: str

    @property
    def log(self) -> float:
        """Natural logarithm of the pixels."""
        return float(np.log(self.pixels))

    def scaled(self, factor: float) -> Focal:
        """The same for a picture of `factor` times as many pixels along each side."""
        return Focal(self.pixels * factor, self.error, self.source)


def given_focal(pixels: float) -> Focal:
    """What the user says.

    Raises:
        InputError: not a positive number.
    """
    if not (np.isfinite(pixels) and pixels > 0):
        raise InputError(f"a focal length of {pixels} pixels is impossible", "give a positive number of pixels")
    return Focal(float(pixels), FLAG_ERROR, "given")


def tagged_focal(film_mm: float, size: tuple[int, int]) -> Focal:
    """What the video's tag says, an equivalent focal length in millimetres, for a picture of this size."""
    pixels = film_mm / FILM_DIAGONAL_MM * float(np.hypot(*size))
    return Focal(pixels, TAG_ERROR, f"the video's tag: {film_mm:g} mm equivalent")


def typical_focal(size: tuple[int, int]) -> Focal:
    """A guess for a picture of this size, where nothing tells."""
    pixels = TYPICAL_MM / FILM_DIAGONAL_MM * float(np.hypot(*size))
    return Focal(pixels, TYPICAL_ERROR, f"a guess: phones film at about {TYPICAL_MM:g} mm equivalent")
