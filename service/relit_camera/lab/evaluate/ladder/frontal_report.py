"""The figures of frontal lights as text, JSON and HTML."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from relit_camera.base.images.color import uint8_from_linear
from relit_camera.base.images.contact_sheet import contact_sheet
from relit_camera.lab.evaluate.ladder.frontal_lights import (
    AZIMUTH_DEG,
    ELEVATION_DEG,
    PREDICTORS,
    SIDE_DEG,
    FrontalResult,
)
from relit_camera.lab.evaluate.report.html_page import Block, Heading, Paragraph, picture, render_page, table
from relit_camera.light.directions import direction_from_degrees

SHOWN_DEG = ((50, 0), (-50, 0), (80, 0), (-80, 0), (0, 45), (0, -35), (110, 15))
"""Azimuth and elevation of lights whose nearest predicted ones are shown."""
CELL_PX = 170


def frontal_json(results: Sequence[FrontalResult]) -> dict[str, object]:
    """The figures: list → counts, and predictor → mean over all predicted lights and over those from the side."""
    return {
        each.name: {
            "frontal_lights": each.captured,
            "predicted_lights": len(each.asked),
            "predictors": {
                name: {
                    "psnr_db": _number(_mean(score.light_db)),
                    "from_side_db": _number(_mean(score.light_db[each.from_side])),
                    "failure": score.failure or None,
                }
                for name, score in each.scores.items()
            },
        }
        for each in results
    }


def frontal_text(results: Sequence[FrontalResult]) -> str:
    """A table: a predictor in each row, a list in each column; of light from the side in brackets."""
    width = max(map(len, PREDICTORS))
    lines = ["PSNR, peak 1, one gain a light, dB [light from the side]"]
    lines.append(" " * width + "".join(f"{each.name[:18]:>20}" for each in results))
    for name in PREDICTORS:
        cells = [
            f"{_text(_mean(each.scores[name].light_db))} [{_text(_mean(each.scores[name].light_db[each.from_side]))}]"
            for each in results
        ]
        lines.append(f"{name:<{width}}" + "".join(f"{cell:>20}" for cell in cells))
    for each in results:
        lines.append(f"{each.name}: {len(each.asked)} lights from {each.captured} frontal ones")
        lines += [f"  {name}: {score.failure}" for name, score in each.scores.items() if score.failure]
    return "\n".join(lines)


def frontal_page(results: Sequence[FrontalResult]) -> str:
    """The HTML document."""
    return render_page("Lights beyond frontal ones", _blocks(results))


def _blocks(results: Sequence[FrontalResult]) -> Iterator[Block]:
    yield Paragraph(
        f"Lights within {AZIMUTH_DEG:.0f}° to the sides and {ELEVATION_DEG:.0f}° up and down are known; the pictures "
        "under all others are predicted from them. Each predicted picture gets one gain, since strobes vary."
    )
    low, high = SIDE_DEG
    yield table(
        ["predictor", *(column for each in results for column in (each.name, "from the side"))],
        [
            [
                name,
                *(
                    _mean(values)
                    for each in results
                    for values in (each.scores[name].light_db, each.scores[name].light_db[each.from_side])
                ),
            ]
            for name in PREDICTORS
        ],
        f"Mean PSNR in dB, peak 1, over all predicted lights, and over those {low:.0f}° to {high:.0f}° from the "
        "camera's axis.",
        better="larger",
    )
    for each in results:
        yield Heading(each.name)
        for name, score in each.scores.items():
            if score.failure:
                yield Paragraph(f"{name}: {score.failure}")
        chosen = [int((each.asked @ direction_from_degrees(*angles)).argmax()) for angles in SHOWN_DEG]
        rows = {"truth": each.truth, **each.predicted}
        # One exposure a light, that of the truth.
        scale = [0.8 / max(float(np.percentile(each.truth[light], 99)), 1e-6) for light in chosen]
        sheet = contact_sheet(
            [
                [
                    uint8_from_linear(pictures[light] * np.float32(factor))
                    for light, factor in zip(chosen, scale, strict=True)
                ]
                for pictures in rows.values()
            ],
            list(rows),
            [_angles(each.asked[light]) for light in chosen],
            CELL_PX,
        )
        yield picture(sheet, "Lights that were not known, by azimuth and elevation.", lossless=False)


def _angles(direction: np.ndarray) -> str:
    azimuth = np.degrees(np.arctan2(direction[0], direction[2]))
    return f"{azimuth:.0f}, {np.degrees(np.arcsin(np.clip(direction[1], -1, 1))):.0f}"


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if values.size else float("nan")


def _number(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _text(value: float) -> str:
    return f"{value:.1f}" if np.isfinite(value) else "-"
