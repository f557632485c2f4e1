"""The leave-out protocol as a report for people, as text and as JSON."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict

import numpy as np

from relit_camera.evaluate.holdout import HoldOut
from relit_camera.evaluate.page import heading, page, paragraph, picture, table
from relit_camera.evaluate.pictures import heat_picture, labelled_grid
from relit_camera.space.colour import uint8_from_linear


def holdout_json(results: Sequence[HoldOut]) -> dict[str, object]:
    """The figures: list → every_N → method → figures, and their means over the lists."""
    lists: dict[str, dict[str, object]] = {}
    for each in results:
        scores = {s.method: {k: v for k, v in asdict(s).items() if k != "method"} for s in each.scores}
        counts = {"lights": each.lights, "left_out": len(each.left_out), "rejected": len(each.rejected)}
        lists.setdefault(each.name, {})[f"every_{each.every}"] = {**counts, "methods": scores}
    return {"lists": lists, "mean_peak_255_db": _means(results)}


def holdout_text(results: Sequence[HoldOut]) -> str:
    """A table for each list and share left out: a row a method."""
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


def holdout_page(results: Sequence[HoldOut]) -> str:
    """The HTML document."""
    return page("Lights left out", _blocks(results))


def _blocks(results: Sequence[HoldOut]) -> Iterator[str]:
    yield paragraph(
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
    )
    for each in results:
        yield heading(f"{each.name}: every {each.every} left out")
        yield table(
            ["method", "PSNR, dB", "as captured", "bright parts as peak", "SSIM"],
            [[s.method, s.peak_255_db, s.raw_peak_255_db, s.psnr_db, f"{s.ssim:.4f}"] for s in each.scores],
            f"{len(each.left_out)} of {each.lights} lights are predicted from the others. PSNR with the peak at 255, "
            "of aligned pictures and of pictures as they are; PSNR with the peak at the truth's 99.5th percentile; "
            "SSIM of luma.",
        )
        yield _hardest(each)


def _hardest(result: HoldOut) -> str:
    names = [score.method for score in result.scores]
    peak = np.float32(np.percentile(result.truth, 99.5) or 1.0)
    shown = [uint8_from_linear(each / peak) for each in (result.truth, *(result.predicted[name] for name in names))]
    errors = [np.abs(result.predicted[name] - result.truth).mean(axis=2) / peak for name in names]
    heats = [np.zeros_like(shown[0]), *(heat_picture(each, 0.3) for each in errors)]
    pairs = [np.concatenate(pair) for pair in zip(shown, heats, strict=True)]
    return picture(
        labelled_grid(pairs, ["truth", *names], 4, 240),
        f"The left-out light that is predicted worst (number {result.left_out[result.hardest]} of the list, from 0), "
        "by each method; below it the error, pale yellow where it is 30 % of white. It is largest along the edges of "
        "shadows, which stand elsewhere in the pictures of the lights around.",
        exact=False,
    )


def _means(results: Sequence[HoldOut]) -> dict[str, dict[str, float]]:
    """Method → every_N → mean over the lists of the PSNR of aligned pictures at peak 255; best first."""
    collected: dict[str, dict[str, list[float]]] = {}
    for each in results:
        for score in each.scores:
            collected.setdefault(score.method, {}).setdefault(f"every_{each.every}", []).append(score.peak_255_db)
    means = {m: {every: float(np.mean(v)) for every, v in by.items()} for m, by in collected.items()}
    return dict(sorted(means.items(), key=lambda item: -float(np.mean(list(item[1].values())))))
