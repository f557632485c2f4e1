"""Figures of a field against its truth (thesis 7)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.evaluate.truth import Truth
from relit_camera.light.maps import LightMap
from relit_camera.space.colour import uint8_from_linear
from relit_camera.space.images import DisplayImage, Mask
from relit_camera.space.quality import psnr, ssim

Colours = NDArray[np.float32]


MAX_DB = 100.0
"""PSNR of equal pictures, and of what differs by less: so that means stay finite."""


@dataclass(frozen=True)
class Relit:
    """A person under an environment, by a field and in truth.

    Attributes:
        picture, truth: uint8 sRGB (height, width, 3), scaled as PSNR scales them; black outside of the matte.
        psnr_db, ssim: inside the matte (see `space.quality`).
    """

    picture: DisplayImage
    truth: DisplayImage
    psnr_db: float
    ssim: float


def finite_psnr(picture: Colours, truth: Colours, matte: Mask | None = None, peak: float | None = None) -> float:
    """PSNR in dB as `space.quality` defines it, `MAX_DB` at most; see there."""
    return min(psnr(picture, truth, matte, peak), MAX_DB)


def squared_distances(colours: Colours, truth: Colours) -> NDArray[np.float64]:
    """Σ over R, G, B of the squared difference of colours (lights, pixels, 3): (lights, pixels)."""
    difference = np.asarray(colours, np.float64) - truth
    return np.asarray(np.einsum("lpc,lpc->lp", difference, difference))


def error_of_pixels(
    distances: NDArray[np.float64], weights: NDArray[np.float64], counted: NDArray[np.bool_] | None = None
) -> NDArray[np.float64]:
    """The thesis's error (pixels,) of each pixel's reflectance map: the weighted mean over lights (7, its equation).

    Args:
        distances: (lights, pixels) of `squared_distances`.
        weights: (lights,), cos φ.
        counted: (lights,) which lights count: all, or those inside the sampled region.

    Raises:
        ValueError: no light counts.
    """
    used = weights if counted is None else weights * counted
    if not used.sum() > 0:
        raise ValueError("no light counts")
    return np.asarray(used @ distances / used.sum())


def light_psnr(colours: Colours, truth: Colours, lights: NDArray[np.intp]) -> NDArray[np.float64]:
    """PSNR in dB (some,) of the pictures (lights, pixels, 3) under the lights of these indices (some,)."""
    return np.array([finite_psnr(colours[light][:, None], truth[light][:, None]) for light in lights])


def relit_pictures(colours: Colours, truth: Truth, environments: Mapping[str, LightMap]) -> dict[str, Relit]:
    """The person under each environment, light that the truth has no pictures for left out of both."""
    pictures = {}
    for name, light_map in environments.items():
        light = truth.irradiance(light_map)
        expected = np.einsum("lpc,lc->pc", truth.colours, light, optimize=True)
        seen = np.einsum("lpc,lc->pc", colours, light, optimize=True)
        pictures[name] = compare(truth, seen, expected)
    return pictures


def compare(truth: Truth, seen: Colours, expected: Colours) -> Relit:
    """Colours (pixels, 3) of the pixels inside, as pictures with their figures."""
    # Shown and judged alike: the brightest half percent of the truth is white.
    peak = float(np.percentile(expected, 99.5)) or 1.0
    shown = [uint8_from_linear(truth.picture(colours / np.float32(peak))) for colours in (seen, expected)]
    quality = finite_psnr(seen[:, None], expected[:, None])
    return Relit(shown[0], shown[1], quality, ssim(shown[0], shown[1], truth.samples.matte))
