"""Section of a field's HTML report on ghost shadows."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import luminance, uint8_from_linear
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.lab.evaluate.field.candidates import BASELINE_METHOD
from relit_camera.lab.evaluate.field.field_evaluation import FieldReport
from relit_camera.lab.evaluate.field.ghost_shadows import HISTOGRAM_EDGES, MID_TONE_RANGE, ghost_pixels
from relit_camera.lab.evaluate.field.ground_truth import not_captured
from relit_camera.lab.evaluate.field.map_pictures import labeled_grid, with_scan_line
from relit_camera.lab.evaluate.report.html_page import Block, Figure, Heading, Paragraph, picture
from relit_camera.lab.evaluate.report.plots import line_plot

_CELL_WIDTH = 300


def ghost_blocks(report: FieldReport) -> Iterator[Block]:
    """Section on ghost shadows: pictures, luminance along a line, and the histogram from dark to lit; or nothing."""
    if report.ghost is None:
        return
    yield Heading("Ghost shadows")
    yield Paragraph(
        "Under a light between two captured ones, a shadow has one edge at a place between theirs. A mixture of the "
        "captured pictures shows both their shadows instead, each at half strength: ghosts. As the light moves they "
        "fade into each other, where the true shadow would move."
    )
    yield _pictures(report)
    yield _scan_line(report)
    yield _histogram(report)


def _pictures(report: FieldReport) -> Figure:
    assert report.ghost is not None
    truth, ghost, row = report.truth, report.ghost, _row_with_most_ghosts(report)
    expected = truth.colors[ghost.light]
    peak = np.float32(np.percentile(expected, 99.5) or 1.0)

    def shown(colors: NDArray[np.float32]) -> DisplayImage:
        picture_ = uint8_from_linear(truth.picture(colors / peak))
        zoom = max(1, _CELL_WIDTH // picture_.shape[1])
        enlarged = cv2.resize(picture_, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_NEAREST)
        return with_scan_line(np.asarray(enlarged, np.uint8), row * zoom + zoom // 2)

    cells, names = [shown(expected)], ["truth"]
    for each in report.candidate_scores:
        cells.append(shown(each.ghost))
        names.append(each.name)
    angle = np.degrees(np.arccos(np.clip(truth.directions[ghost.light] @ report.captured[ghost.around[0]], -1, 1)))
    return picture(
        labeled_grid(cells, names, 3, _CELL_WIDTH),
        f"One light that was not captured; the nearest captured one is {angle:.0f}° away. In truth each shadow has one "
        "edge. The barycentric methods show the shadows of all three captured lights around it, faintly, over each "
        "other; the nearest light has one clear edge, in the wrong place. The next figure follows the yellow line.",
    )


def _scan_line(report: FieldReport) -> Figure:
    assert report.ghost is not None
    truth, row = report.truth, _row_with_most_ghosts(report)
    width = truth.samples.matte.shape[1]
    on_row = truth.inside // width == row
    columns = truth.inside[on_row] % width

    def values(colors: NDArray[np.float32]) -> NDArray[np.float64]:
        line = np.full(width, np.nan)
        line[columns] = luminance(colors[on_row])
        return line[columns.min() : columns.max() + 1]

    lines = {"truth": values(truth.colors[report.ghost.light])}
    lines |= {each.name: values(each.ghost) for each in report.candidate_scores}
    x = np.arange(columns.min(), columns.max() + 1)
    return line_plot(
        x,
        lines,
        f"column of pixel row {row}",
        "luminance",
        "Brightness along that line. Where the truth (black) falls once from light to shadow, the interpolating "
        "methods fall in two or three smaller steps: the double edge.",
        from_zero=True,
    )


def _histogram(report: FieldReport) -> Figure:
    centers = (HISTOGRAM_EDGES[1:] + HISTOGRAM_EDGES[:-1]) / 2
    lines = {"truth": report.truth_histogram * 100} | {
        each.name: each.histogram * 100 for each in report.candidate_scores
    }
    fractions = ", ".join(f"{each.name} {each.mid_tone_fraction:.1%}" for each in report.candidate_scores)
    count = int((report.in_region & not_captured(report.captured, report.truth.directions)).sum())
    return line_plot(
        centers,
        lines,
        "position on the scale from dark (0) to lit (1) of the captured pictures",
        "share of the pixels, %",
        f"All pixels that one captured light reaches and a neighboring one does not, over {count} lights that were not "
        "captured. In truth most are dark (0) or lit (1). Interpolation moves them to the middle. Mid-tones, between "
        f"{MID_TONE_RANGE[0]} and {MID_TONE_RANGE[1]}: truth {report.truth_mid_tones:.1%}; {fractions}.",
        from_zero=True,
    )


def _row_with_most_ghosts(report: FieldReport) -> int:
    """Row of the picture with the most ghost pixels, both truly dark and truly lit ones."""
    assert report.ghost is not None
    reference = next(
        (each for each in report.candidate_scores if each.name == BASELINE_METHOD), report.candidate_scores[0]
    )
    height, width = report.truth.samples.matte.shape
    parts = ghost_pixels(report.ghost, reference.ghost, report.truth.colors[report.ghost.light])
    dark, lit = (np.bincount(report.truth.inside[part] // width, minlength=height) for part in parts)
    return int((np.minimum(dark, lit) * height + dark + lit).argmax())
