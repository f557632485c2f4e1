"""A relit video against the ground-truth relit video of the same motion."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.errors import VideoError
from relit_camera.evaluate.measure import finite_psnr
from relit_camera.evaluate.motion import second_difference_rms
from relit_camera.space.colour import luminance
from relit_camera.space.display import linear_from_display
from relit_camera.space.images import DisplayImage, LinearImage
from relit_camera.video.reader import VideoReader

SHADING_BLUR = 0.04
"""Sigma of the blur, as a share of the picture's width, after which light is compared and features hardly are."""
KEPT_FRAMES = 6
"""Frames shown in the report, about so many."""
_NOBODY = (np.nan,) * 6
"""The figures of a frame with nobody in it."""


@dataclass(frozen=True)
class LightConsistency:
    """How the light in a relit video follows the truth, frame by frame; PSNR inside the matte, in linear light.

    Frames whose matte is empty, nobody being there, have NaN.

    Attributes:
        psnr_db: (frames,) as it is.
        gain_aligned_db: (frames,) after one gain a frame: what is left is the light's distribution, and the features.
        shading_db: (frames,) the same, both pictures blurred within the matte: the light's distribution alone.
        gain_ev: (frames,) that gain in stops: how much too dark the relit frame is.
        brightness, true_brightness: (frames,) mean luminance inside the matte.
        shown: (index, relit, truth) of some frames.
    """

    psnr_db: NDArray[np.float64]
    gain_aligned_db: NDArray[np.float64]
    shading_db: NDArray[np.float64]
    gain_ev: NDArray[np.float64]
    brightness: NDArray[np.float64]
    true_brightness: NDArray[np.float64]
    shown: tuple[tuple[int, DisplayImage, DisplayImage], ...]

    @property
    def flicker(self) -> float:
        """RMS second difference of the brightness, as a share of its mean; NaN for under three frames."""
        return _flicker(self.brightness)

    @property
    def true_flicker(self) -> float:
        """The same of the truth: what the motion itself brings."""
        return _flicker(self.true_brightness)


def compare_videos(
    relit: Path, truth: Path, matte: Path | None = None, progress: Callable[[int], None] = lambda done: None
) -> LightConsistency:
    """Compare two videos of the same frames, both shown through the project's display curve.

    Args:
        relit: what was made.
        truth: what is so.
        matte: a video whose pixels brighter than half are the person; without one the whole frame counts.
        progress: called with the frames done.

    Raises:
        VideoError: one cannot be read, they differ in size or length, or the matte is empty in every frame.
    """
    rows: list[tuple[float, ...]] = []
    shown: list[tuple[int, DisplayImage, DisplayImage]] = []
    paths = [relit, truth, matte] if matte else [relit, truth]
    with ExitStack() as files:
        readers = [files.enter_context(VideoReader(path)) for path in paths]
        every = max((readers[0].info.frames or 0) // KEPT_FRAMES, 1)
        names = ", ".join(f"{r.info.width}x{r.info.height}" for r in readers)
        if len({(reader.info.width, reader.info.height) for reader in readers}) > 1:
            raise VideoError(f"the videos to compare are {names}", "make them of one size")
        for index, frames in enumerate(zip_longest(*readers)):
            images = [frame.image for frame in frames if frame is not None]
            if len(images) < len(readers):
                raise VideoError(
                    f"{', '.join(path.name for path in paths)} differ in length after {index} frames",
                    "compare a whole replay with the truth of the same clip",
                )
            inside = images[2][..., 1] > 127 if matte else np.ones(images[0].shape[:2], bool)
            light = linear_from_display(images[0]), linear_from_display(images[1])
            rows.append(_figures(*light, inside) if inside.any() else _NOBODY)
            if index % every == every // 2:
                shown.append((index, images[0], images[1]))
            progress(index + 1)
    plain, aligned, shading, gain, brightness, true_brightness = np.array(rows).T
    if np.isnan(plain).all():
        raise VideoError(f"{matte} is empty in every frame", "white must mark the person")
    return LightConsistency(plain, aligned, shading, gain, brightness, true_brightness, tuple(shown))


def _figures(relit: LinearImage, truth: LinearImage, inside: NDArray[np.bool_]) -> tuple[float, ...]:
    """The six per-frame figures of `LightConsistency`, in its order."""
    mask = inside.astype(np.float32)
    seen, known = relit[inside], truth[inside]
    gain = _gain(seen, known)
    soft_seen, soft_known = _blurred(relit, mask), _blurred(truth, mask)
    return (
        finite_psnr(relit, truth, mask),
        finite_psnr(relit * np.float32(gain), truth, mask),
        finite_psnr(soft_seen * np.float32(_gain(soft_seen[inside], soft_known[inside])), soft_known, mask),
        float(np.log2(max(gain, 1e-6))),
        float(luminance(seen).mean()),
        float(luminance(known).mean()),
    )


def _flicker(brightness: NDArray[np.float64]) -> float:
    return second_difference_rms(brightness) / max(float(np.nanmean(brightness)), 1e-12)


def _gain(seen: NDArray[np.float32], known: NDArray[np.float32]) -> float:
    """The factor that brings `seen` nearest to `known` (least squares)."""
    return float((seen * known).sum(dtype=np.float64)) / max(float((seen * seen).sum(dtype=np.float64)), 1e-12)


def _blurred(picture: LinearImage, mask: NDArray[np.float32]) -> LinearImage:
    """A mean over the surroundings that lie inside the mask."""
    sigma = SHADING_BLUR * picture.shape[1]
    weight = cv2.GaussianBlur(mask, (0, 0), sigma)
    blurred = cv2.GaussianBlur(picture * mask[..., None], (0, 0), sigma)
    return np.asarray(blurred / np.maximum(weight, 1e-6)[..., None], np.float32)
