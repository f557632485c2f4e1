"""Error metrics of a reflectance field against its truth (thesis 7)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import uint8_from_linear
from relit_camera.base.images.image_quality import psnr, ssim
from relit_camera.base.images.image_types import DisplayImage, Mask
from relit_camera.lab.evaluate.field.ground_truth import GroundTruth
from relit_camera.light.light_map import LightMap

Colors = NDArray[np.float32]


MAX_DB = 100.0
"""Largest PSNR that is returned, also for equal pictures, so that means stay finite."""


@dataclass(frozen=True)
class RelitComparison:
    """A person under an environment, by a field and in truth.

    Attributes:
        picture, truth: uint8 sRGB (height, width, 3), scaled as PSNR scales them; black outside of the matte.
        psnr_db, ssim: inside the matte (see `base.images.image_quality`).
    """

    picture: DisplayImage
    truth: DisplayImage
    psnr_db: float
    ssim: float


def finite_psnr(picture: Colors, truth: Colors, matte: Mask | None = None, peak: float | None = None) -> float:
    """PSNR in dB as defined by `base.images.image_quality.psnr`, at most `MAX_DB`."""
    return min(psnr(picture, truth, matte, peak), MAX_DB)


def squared_distances(colors: Colors, truth: Colors) -> NDArray[np.float64]:
    """Σ over R, G, B of the squared difference of colors (lights, pixels, 3): (lights, pixels)."""
    difference = np.asarray(colors, np.float64) - truth
    return np.asarray(np.einsum("lpc,lpc->lp", difference, difference))


def pixel_errors(
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


def psnr_per_light(colors: Colors, truth: Colors, lights: NDArray[np.intp]) -> NDArray[np.float64]:
    """PSNR in dB (some,) of the pictures (lights, pixels, 3) under the lights of these indices (some,)."""
    return np.array([finite_psnr(colors[light][:, None], truth[light][:, None]) for light in lights])


def compare_under_environments(
    colors: Colors, truth: GroundTruth, environments: Mapping[str, LightMap]
) -> dict[str, RelitComparison]:
    """Comparison under each environment; light from directions without true pictures is left out of both sides."""
    pictures = {}
    for name, light_map in environments.items():
        light = truth.irradiance(light_map)
        expected = np.einsum("lpc,lc->pc", truth.colors, light, optimize=True)
        seen = np.einsum("lpc,lc->pc", colors, light, optimize=True)
        pictures[name] = compare_relit(truth, seen, expected)
    return pictures


def compare_relit(truth: GroundTruth, seen: Colors, expected: Colors) -> RelitComparison:
    """Colors (pixels, 3) of the pixels inside, as pictures with their figures."""
    # Pictures and metrics use the same scale: the truth's 99.5th percentile is white.
    peak = float(np.percentile(expected, 99.5)) or 1.0
    shown = [uint8_from_linear(truth.picture(colors / np.float32(peak))) for colors in (seen, expected)]
    quality = finite_psnr(seen[:, None], expected[:, None])
    return RelitComparison(shown[0], shown[1], quality, ssim(shown[0], shown[1], truth.samples.matte))
