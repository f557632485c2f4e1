"""Leaving captured lights out and predicting them from the others: a truth that every capture has."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.errors import ConfigError, LightsError
from relit_camera.evaluate.candidates import method_candidates
from relit_camera.evaluate.measure import Colours, compare, finite_psnr
from relit_camera.evaluate.truth import Truth, only
from relit_camera.reflectance.black_ring import boundary
from relit_camera.reflectance.method import method_names
from relit_camera.reflectance.samples import Samples


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
    known = Truth(samples)
    kept = only(samples, np.setdiff1d(np.arange(len(samples.directions)), left_out))
    truth = known.colours[left_out]
    # Without the black ring, unless it is asked for: between captured lights it changes nothing.
    names = methods or method_names()
    predicted = {}
    for done, candidate in enumerate(method_candidates(kept, known.inside, names)):
        predicted[candidate.name] = candidate.pictures_at(samples.directions[left_out])
        progress(done + 1, len(names))
    gains = common_gains(truth, list(predicted.values()))
    fitted = truth * gains[:, None, None]
    scores = [_scores(known, method, colours, truth, fitted) for method, colours in predicted.items()]
    errors = [((colours - fitted) ** 2).mean(axis=(1, 2)) for colours in predicted.values()]
    hardest = int(np.mean(errors, axis=0).argmax())
    return HoldOut(
        name=name,
        every=every,
        lights=len(samples.directions),
        left_out=left_out,
        scores=sorted(scores, key=lambda each: -each.peak_255_db),
        hardest=hardest,
        truth=known.picture(fitted[hardest]),
        predicted={method: known.picture(colours[hardest]) for method, colours in predicted.items()},
    )


def common_gains(truth: Colours, predicted: Sequence[Colours]) -> NDArray[np.float32]:
    """One factor a picture (some,) for true colours (some, pixels, 3): least squares to the mean of all predictions."""
    mean = np.mean(predicted, axis=0)
    energy = np.einsum("lpc,lpc->l", truth, truth)
    return np.asarray(np.einsum("lpc,lpc->l", truth, mean) / np.maximum(energy, 1e-12), np.float32)


def _scores(known: Truth, method: str, predicted: Colours, truth: Colours, fitted: Colours) -> Scores:
    """Of colours (some, pixels, 3) against the true ones, as they are and with their gains."""

    def peak_255_db(expected: Colours) -> float:
        pairs = zip(predicted, expected, strict=True)
        return float(np.mean([finite_psnr(p[:, None], e[:, None], peak=1.0) for p, e in pairs]))

    relit = [compare(known, seen, expected) for seen, expected in zip(predicted, fitted, strict=True)]
    return Scores(
        method=method,
        peak_255_db=peak_255_db(fitted),
        raw_peak_255_db=peak_255_db(truth),
        psnr_db=float(np.mean([each.psnr_db for each in relit])),
        ssim=float(np.mean([each.ssim for each in relit])),
    )
