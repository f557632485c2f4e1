"""Leaving captured lights out and predicting them from the others: a truth that every capture has."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.align import align_samples, align_to, apply_alignment
from relit_camera.errors import ConfigError, LightsError
from relit_camera.evaluate.candidates import method_candidates
from relit_camera.evaluate.measure import Colours, compare, finite_psnr
from relit_camera.evaluate.truth import Truth, only
from relit_camera.reflectance.black_ring import boundary
from relit_camera.reflectance.method import method_names
from relit_camera.reflectance.model import Model
from relit_camera.reflectance.samples import Samples


@dataclass(frozen=True)
class Scores:
    """How well a method predicts the lights left out: means over them.

    Attributes:
        method: its name.
        peak_255_db: PSNR in linear light where 1, a white wall (255 in 8 bits), is the peak; all pictures aligned and
            their strobes' strength evened out.
        raw_peak_255_db: the same of the pictures as they are: built from them, compared with them.
        psnr_db: PSNR as the project defines it everywhere, of aligned pictures: the truth's bright parts are the peak.
        ssim: of sRGB luma, of aligned pictures.
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
        rejected: index and reason of pictures that no light could make; they are neither used nor asked for.
        left_out: (some,) indices of those left out.
        scores: best first.
        hardest: index into `left_out` of the picture that was predicted worst, on average over the methods.
        truth: (height, width, 3) that picture, aligned.
        predicted: method → prediction of that picture.
    """

    name: str
    every: int
    lights: int
    rejected: Mapping[int, str]
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

    The pictures that are kept are aligned with each other. Those left out are then aligned, for scoring only, as the
    kept ones were: with what a model of appearance fitted to the kept ones alone says of them; one motion and one gain
    for all methods.

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
    rejected = align_samples(samples.pictures, samples.directions, samples.matte).rejected
    fit = np.setdiff1d(np.arange(len(samples.directions)), list(rejected))
    left_out = fit[interior_lights(samples.directions[fit])[::every]]
    if not len(left_out):
        raise LightsError(f"no light of {name} is surrounded by others", "more lights are needed")
    kept = only(samples, np.setdiff1d(fit, left_out))
    aligned = align_samples(kept.pictures, kept.directions, kept.matte).samples(kept)
    known = Truth(samples)
    asked = samples.directions[left_out]
    truth = aligned_truth(aligned, samples.pictures[left_out], asked).reshape(len(left_out), -1, 3)[:, known.inside]
    # Without the black ring, unless it is asked for: between captured lights it changes nothing.
    names = methods or method_names()
    pairs = zip(
        method_candidates(aligned, known.inside, names), method_candidates(kept, known.inside, names), strict=True
    )
    predicted, scores = {}, []
    for done, (candidate, as_captured) in enumerate(pairs):
        predicted[candidate.name] = candidate.pictures_at(asked)
        as_it_is = _peak_255_db(as_captured.pictures_at(asked), known.colours[left_out])
        scores.append(_scores(known, candidate.name, predicted[candidate.name], truth, as_it_is))
        progress(done + 1, len(names))
    hardest = int(np.mean([((each - truth) ** 2).mean(axis=(1, 2)) for each in predicted.values()], axis=0).argmax())
    return HoldOut(
        name=name,
        every=every,
        lights=len(samples.directions),
        rejected=rejected,
        left_out=left_out,
        scores=sorted(scores, key=lambda each: -each.peak_255_db),
        hardest=hardest,
        truth=known.picture(truth[hardest]),
        predicted={method: known.picture(colours[hardest]) for method, colours in predicted.items()},
    )


def aligned_truth(kept: Samples, pictures: Colours, directions: NDArray[np.float64]) -> Colours:
    """Pictures (some, height, width, 3) that were left out, moved and multiplied to fit the appearance of those kept.

    A method's own prediction, or a mean of them, would favour methods that are wrong in the same way: interpolation is
    too dark between its lights, and a gain fitted to it is too small.
    """
    height, width = kept.matte.shape
    inside = np.flatnonzero(kept.matte.ravel() > 0)
    expected = np.zeros((len(directions), height * width, 3), np.float32)
    expected[:, inside] = Model().build(kept).appearance_at(directions, inside)
    fitted = []
    for picture, appearance in zip(pictures, expected.reshape(pictures.shape), strict=True):
        fitted.append(apply_alignment(picture, *align_to(picture, appearance, kept.matte)))
    return np.stack(fitted)


def _scores(known: Truth, method: str, predicted: Colours, truth: Colours, raw_peak_255_db: float) -> Scores:
    """Of colours (some, pixels, 3) against the true ones."""
    relit = [compare(known, seen, expected) for seen, expected in zip(predicted, truth, strict=True)]
    return Scores(
        method=method,
        peak_255_db=_peak_255_db(predicted, truth),
        raw_peak_255_db=raw_peak_255_db,
        psnr_db=float(np.mean([each.psnr_db for each in relit])),
        ssim=float(np.mean([each.ssim for each in relit])),
    )


def _peak_255_db(predicted: Colours, truth: Colours) -> float:
    """Mean over pictures (some, pixels, 3)."""
    pairs = zip(predicted, truth, strict=True)
    return float(np.mean([finite_psnr(p[:, None], e[:, None], peak=1.0) for p, e in pairs]))
