"""Leaving captured lights out and predicting them from the others: a truth that every capture has."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.errors import ConfigError, LightsError
from relit_camera.evaluate.candidates import RING, method_candidates
from relit_camera.evaluate.measure import Colours, finite_psnr
from relit_camera.evaluate.truth import only, pixels_of
from relit_camera.reflectance.black_ring import boundary
from relit_camera.reflectance.method import method_names
from relit_camera.reflectance.samples import Samples
from relit_camera.space.colour import uint8_from_linear
from relit_camera.space.quality import ssim


@dataclass(frozen=True)
class Scores:
    """How well a method predicts the lights left out: means over them.

    Attributes:
        method: its name.
        peak_255_db: PSNR in linear light where 1, a white wall (255 in 8 bits), is the peak; the truth multiplied by a
            gain of its own for each picture, the same for all methods, since flashes vary in strength.
        raw_peak_255_db: the same without that gain.
        psnr_db: PSNR as the project defines it everywhere, with that gain: the truth's bright parts are the peak.
        ssim: of sRGB luma, with that gain.
    """

    method: str
    peak_255_db: float
    raw_peak_255_db: float
    psnr_db: float
    ssim: float


@dataclass(frozen=True)
class HoldOut:
    """One list of lights with every so many-th interior light left out.

    Attributes:
        name: of the list.
        every: 4 leaves out every fourth.
        lights: how many were used to begin with.
        left_out: (some,) indices of those left out.
        scores: best first.
        hardest: index into `left_out` of the picture that was predicted worst, on average over the methods.
        truth: (height, width, 3) that picture, with its gain.
        predicted: method → prediction of that picture.
    """

    name: str
    every: int
    lights: int
    left_out: NDArray[np.intp]
    scores: Sequence[Scores]
    hardest: int
    truth: Colours
    predicted: dict[str, Colours]


def parse_hold_out(text: str) -> int:
    """The number of `every=N`, 2 or more.

    Raises:
        ConfigError: not in that form.
    """
    name, _, number = text.partition("=")
    if name != "every" or not number.isdecimal() or int(number) < 2:
        raise ConfigError(f"unknown hold-out '{text}'", "write every=N, with N of 2 or more")
    return int(number)


def interior_lights(directions: NDArray[np.float64]) -> NDArray[np.intp]:
    """Indices (some,) of the lights that are not on the edge of the sampled region: others surround them.

    Raises:
        LightsError: the directions (lights, 3) span no region.
    """
    return np.setdiff1d(np.arange(len(directions)), boundary(directions))


def hold_out(
    name: str,
    samples: Samples,
    every: int,
    methods: Sequence[str] = (),
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> HoldOut:
    """Leave out every so many-th interior light, in the list's order, and predict its picture from the rest.

    Args:
        name: of the list.
        samples: all its lights.
        every: 2 leaves out every second.
        methods: to compare; all that are installed unless given.
        progress: called with methods done and their total.

    Raises:
        LightsError: there is no interior light, or too few are left.
        NotFoundError: a method is not installed.
    """
    left_out = interior_lights(samples.directions)[::every]
    if not len(left_out):
        raise LightsError(f"no light of {name} is surrounded by others", "more lights are needed")
    inside = np.flatnonzero(samples.matte > 0.5)
    kept = only(samples, np.setdiff1d(np.arange(len(samples.directions)), left_out))
    truth = pixels_of(samples, inside)[left_out]
    # Between captured lights the black ring changes nothing.
    names = [each for each in methods or method_names() if each != RING]
    predicted = {}
    for done, candidate in enumerate(method_candidates(kept, inside, names)):
        predicted[candidate.name] = candidate.pictures_at(samples.directions[left_out])
        progress(done + 1, len(names))
    gains = common_gains(truth, list(predicted.values()))
    scores = [_scores(samples, inside, method, colours, truth, gains) for method, colours in predicted.items()]
    errors = [((colours - truth * gains[:, None, None]) ** 2).mean(axis=(1, 2)) for colours in predicted.values()]
    hardest = int(np.mean(errors, axis=0).argmax())
    return HoldOut(
        name=name,
        every=every,
        lights=len(samples.directions),
        left_out=left_out,
        scores=sorted(scores, key=lambda each: -each.peak_255_db),
        hardest=hardest,
        truth=_picture(samples, inside, truth[hardest] * gains[hardest]),
        predicted={method: _picture(samples, inside, colours[hardest]) for method, colours in predicted.items()},
    )


def common_gains(truth: Colours, predicted: Sequence[Colours]) -> NDArray[np.float32]:
    """One factor a picture (some,) for true colours (some, pixels, 3): least squares to the mean of all predictions."""
    mean = np.mean(predicted, axis=0)
    energy = np.einsum("lpc,lpc->l", truth, truth)
    return np.asarray(np.einsum("lpc,lpc->l", truth, mean) / np.maximum(energy, 1e-12), np.float32)


def _scores(
    samples: Samples,
    inside: NDArray[np.intp],
    method: str,
    predicted: Colours,
    truth: Colours,
    gains: NDArray[np.float32],
) -> Scores:
    fitted = truth * gains[:, None, None]
    pairs = [(p[:, None], t[:, None], r[:, None]) for p, t, r in zip(predicted, fitted, truth, strict=True)]
    similar = []
    for colours, expected in zip(predicted, fitted, strict=True):
        peak = float(np.percentile(expected, 99.5)) or 1.0
        shown = [uint8_from_linear(_picture(samples, inside, each / np.float32(peak))) for each in (colours, expected)]
        similar.append(ssim(shown[0], shown[1], samples.matte))
    return Scores(
        method=method,
        peak_255_db=float(np.mean([finite_psnr(p, t, peak=1.0) for p, t, _ in pairs])),
        raw_peak_255_db=float(np.mean([finite_psnr(p, r, peak=1.0) for p, _, r in pairs])),
        psnr_db=float(np.mean([finite_psnr(p, t) for p, t, _ in pairs])),
        ssim=float(np.mean(similar)),
    )


def _picture(samples: Samples, inside: NDArray[np.intp], colours: Colours) -> Colours:
    height, width = samples.matte.shape
    picture = np.zeros((height * width, 3), np.float32)
    picture[inside] = colours
    return picture.reshape(height, width, 3)
