"""Hold-out evaluation: some captured lights are left out and predicted from the others; reports as HTML, text, JSON."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import ConfigError, LightsError
from relit_camera.base.images.color import uint8_from_linear
from relit_camera.capture.alignment.picture_set_alignment import align_samples, align_to_prediction, apply_alignment
from relit_camera.capture.reflectance.method_registry import method_names
from relit_camera.capture.reflectance.methods.appearance_field import AppearanceMethod
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.capture.reflectance.sampled_region import boundary_lights
from relit_camera.lab.evaluate.field.candidates import method_candidates
from relit_camera.lab.evaluate.field.ground_truth import GroundTruth, select_lights
from relit_camera.lab.evaluate.field.map_pictures import labeled_grid
from relit_camera.lab.evaluate.field.relighting_metrics import Colors, compare_relit, finite_psnr
from relit_camera.lab.evaluate.report.html_page import Block, Heading, Paragraph, picture, render_page, table
from relit_camera.lab.evaluate.report.plots import heat_maps

_LARGEST_SHOWN_ERROR = 0.3
"""End of the color scale of the error maps, as a fraction of white."""


@dataclass(frozen=True)
class HoldOutScores:
    """Scores of a method: means over the lights left out.

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
class HoldOutResult:
    """Result for one list of lights with every N-th interior light left out.

    Attributes:
        name: of the list.
        every: 4 leaves out every fourth.
        lights: how many were used to begin with.
        rejected: index and reason of unusable pictures; they are neither used nor predicted.
        left_out: (some,) indices of those left out.
        scores: best first.
        worst_index: index into `left_out` of the picture that was predicted worst, on average over the methods.
        truth: (height, width, 3) that picture, aligned.
        predicted: method → prediction of that picture.
    """

    name: str
    every: int
    lights: int
    rejected: Mapping[int, str]
    left_out: NDArray[np.intp]
    scores: Sequence[HoldOutScores]
    worst_index: int
    truth: Colors
    predicted: dict[str, Colors]


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
    """Indices (some,) of the lights inside the sampled region, not on its boundary.

    Raises:
        LightsError: the directions (lights, 3) span no region.
    """
    return np.setdiff1d(np.arange(len(directions)), boundary_lights(directions))


def evaluate_hold_out(
    name: str,
    samples: OlatSamples,
    every: int,
    methods: Sequence[str] = (),
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> HoldOutResult:
    """Leave out every N-th interior light, in the list's order, and predict its picture from the rest.

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
    kept = select_lights(samples, np.setdiff1d(fit, left_out))
    aligned = align_samples(kept.pictures, kept.directions, kept.matte).samples(kept)
    known = GroundTruth(samples)
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
        as_it_is = _peak_255_db(as_captured.pictures_at(asked), known.colors[left_out])
        scores.append(_scores(known, candidate.name, predicted[candidate.name], truth, as_it_is))
        progress(done + 1, len(names))
    worst_index = int(
        np.mean([((each - truth) ** 2).mean(axis=(1, 2)) for each in predicted.values()], axis=0).argmax()
    )
    return HoldOutResult(
        name=name,
        every=every,
        lights=len(samples.directions),
        rejected=rejected,
        left_out=left_out,
        scores=sorted(scores, key=lambda each: -each.peak_255_db),
        worst_index=worst_index,
        truth=known.picture(truth[worst_index]),
        predicted={method: known.picture(colors[worst_index]) for method, colors in predicted.items()},
    )


def aligned_truth(kept: OlatSamples, pictures: Colors, directions: NDArray[np.float64]) -> Colors:
    """Left-out pictures (some, height, width, 3), aligned to the appearance model of the kept ones by motion and gain.

    A method's own prediction, or a mean of them, would favour methods that are wrong in the same way: interpolation is
    too dark between its lights, and a gain fitted to it is too small.
    """
    height, width = kept.matte.shape
    inside = np.flatnonzero(kept.matte.ravel() > 0)
    expected = np.zeros((len(directions), height * width, 3), np.float32)
    expected[:, inside] = AppearanceMethod().build(kept).appearance_at(directions, inside)
    fitted = []
    for captured, appearance in zip(pictures, expected.reshape(pictures.shape), strict=True):
        fitted.append(apply_alignment(captured, *align_to_prediction(captured, appearance, kept.matte)))
    return np.stack(fitted)


def _scores(known: GroundTruth, method: str, predicted: Colors, truth: Colors, raw_peak_255_db: float) -> HoldOutScores:
    """Scores of predicted colors (some, pixels, 3) against the true ones."""
    relit = [compare_relit(known, seen, expected) for seen, expected in zip(predicted, truth, strict=True)]
    return HoldOutScores(
        method=method,
        peak_255_db=_peak_255_db(predicted, truth),
        raw_peak_255_db=raw_peak_255_db,
        psnr_db=float(np.mean([each.psnr_db for each in relit])),
        ssim=float(np.mean([each.ssim for each in relit])),
    )


def _peak_255_db(predicted: Colors, truth: Colors) -> float:
    """Mean over pictures (some, pixels, 3)."""
    pairs = zip(predicted, truth, strict=True)
    return float(np.mean([finite_psnr(p[:, None], e[:, None], peak=1.0) for p, e in pairs]))


def holdout_json(results: Sequence[HoldOutResult]) -> dict[str, object]:
    """The figures: list → every_N → method → figures, and their means over the lists."""
    lists: dict[str, dict[str, object]] = {}
    for each in results:
        scores = {s.method: {k: v for k, v in asdict(s).items() if k != "method"} for s in each.scores}
        counts = {"lights": each.lights, "left_out": len(each.left_out), "rejected": len(each.rejected)}
        lists.setdefault(each.name, {})[f"every_{each.every}"] = {**counts, "methods": scores}
    return {"lists": lists, "mean_peak_255_db": _means(results)}


def holdout_text(results: Sequence[HoldOutResult]) -> str:
    """Plain-text table for each result, a row per method."""
    width = max(len(score.method) for each in results for score in each.scores)
    lines = ["PSNR in linear light, peak 255, dB: aligned (as captured)"]
    for each in results:
        lines.append(f"{each.name}, every {each.every}: {len(each.left_out)} of {each.lights} lights left out")
        lines += [f"  picture {index} rejected, {reason}" for index, reason in each.rejected.items()]
        lines += [
            f"  {s.method:<{width}}  {s.peak_255_db:6.2f}  ({s.raw_peak_255_db:.2f})  SSIM {s.ssim:.4f}"
            for s in each.scores
        ]
    return "\n".join(lines)


def holdout_page(results: Sequence[HoldOutResult]) -> str:
    """The HTML document."""
    return render_page("Lights left out", _blocks(results))


def _blocks(results: Sequence[HoldOutResult]) -> Iterator[Block]:
    yield Paragraph(
        "Some of the captured lights are left out, and each method predicts their pictures from the others. Only "
        "lights that others surround are left out, so that nothing is asked beyond the sampled region."
    )
    everys = list(dict.fromkeys(each.every for each in results))
    means = _means(results)
    rows = [[m, *(by.get(f"every_{e}", float("nan")) for e in everys)] for m, by in means.items()]
    yield table(
        ["method", *(f"every {every} left out" for every in everys)],
        rows,
        "Mean PSNR in dB over all lists, in linear light with 255 as peak (larger is better). People move and flashes "
        "vary in strength: the pictures are aligned, and each one left out is moved and multiplied by one gain, the "
        "same for all methods.",
        better="larger",
    )
    for each in results:
        yield Heading(f"{each.name}: every {each.every} left out")
        yield table(
            ["method", "PSNR, dB", "as captured", "bright parts as peak", "SSIM"],
            [[s.method, s.peak_255_db, s.raw_peak_255_db, s.psnr_db, f"{s.ssim:.4f}"] for s in each.scores],
            f"{len(each.left_out)} of {each.lights} lights are predicted from the others. PSNR with the peak at 255, "
            "of aligned pictures and of pictures as they are; PSNR with the peak at the truth's 99.5th percentile; "
            "SSIM of luma.",
            better="larger",
        )
        yield from _worst_prediction(each)


def _worst_prediction(result: HoldOutResult) -> Iterator[Block]:
    names = [score.method for score in result.scores]
    peak = np.float32(np.percentile(result.truth, 99.5) or 1.0)
    shown = [uint8_from_linear(each / peak) for each in (result.truth, *(result.predicted[name] for name in names))]
    yield picture(
        labeled_grid(shown, ["truth", *names], 5, 210),
        f"The left-out light with the largest mean error (number {result.left_out[result.worst_index]} of the list, "
        "from 0), predicted by each method.",
        lossless=False,
    )
    yield heat_maps(
        [np.abs(result.predicted[name] - result.truth).mean(axis=2) / peak for name in names],
        names,
        _LARGEST_SHOWN_ERROR,
        "Error of these predictions as a share of white. It is largest along the edges of shadows, which lie elsewhere "
        "in the pictures of the neighboring lights.",
        columns=5,
        color_label="error, share of white",
    )


def _means(results: Sequence[HoldOutResult]) -> dict[str, dict[str, float]]:
    """Method → every_N → mean over the lists of the PSNR of aligned pictures at peak 255; best first."""
    collected: dict[str, dict[str, list[float]]] = {}
    for each in results:
        for score in each.scores:
            collected.setdefault(score.method, {}).setdefault(f"every_{each.every}", []).append(score.peak_255_db)
    means = {m: {every: float(np.mean(v)) for every, v in by.items()} for m, by in collected.items()}
    return dict(sorted(means.items(), key=lambda item: -float(np.mean(list(item[1].values())))))
