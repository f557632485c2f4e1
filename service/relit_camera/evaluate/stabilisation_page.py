"""What ways to follow a face leave of its motion, as a report for people, as text and as JSON."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from relit_camera.evaluate.charts import line_chart
from relit_camera.evaluate.page import chart, page, paragraph, table
from relit_camera.evaluate.stabilisation import OURS, MotionErrors, StabilisationReport


def stabilisation_json(report: StabilisationReport) -> dict[str, object]:
    """The figures."""
    return {
        "bright_frames": len(report.index),
        "methods": [{"method": each.method, "seen": each.seen, **_figures(each)} for each in report.errors],
        "left_out": dict(report.left_out),
    }


def stabilisation_text(report: StabilisationReport) -> str:
    """The figures as a table of plain text."""
    lines = [f"{'':32} {'px: RMS':>8} {'max':>7} {'deg: RMS':>9} {'max':>7} {'lost':>5}"]
    for each in report.errors:
        figures = _figures(each)
        lines.append(
            f"{_name(each):32} {figures['translation_rms_px']:8.3f} {figures['translation_max_px']:7.2f} "
            f"{figures['rotation_rms_deg']:9.3f} {figures['rotation_max_deg']:7.2f} {each.lost:5}"
        )
    return "\n".join([*lines, *(f"{name}: left out, {why}" for name, why in report.left_out.items())])


def stabilisation_page(report: StabilisationReport, title: str) -> str:
    """The HTML document."""
    return page(title, _blocks(report))


def _blocks(report: StabilisationReport) -> Iterator[str]:
    yield paragraph(
        f"A capture was rendered, so that the head's motion is known. In its {len(report.index)} bright frames, what "
        "is left of it after the transform that each way finds. Ways that look at the bright frames see another light "
        "in each; those that look at the dark ones see one light, and interpolate by time. The thesis's choice is "
        "sparse flow through the dark frames."
    )
    rows = [[_name(each), *_figures(each).values()] for each in report.errors]
    yield table(
        ["way", "translation RMS, px", "largest", "rotation RMS, degrees", "largest", "frames lost"],
        rows,
        "Smaller is better. A constant is taken out: which frame the others are taken to does not matter.",
        digits=3,
    )
    for name, why in report.left_out.items():
        yield paragraph(f"{name}: left out, {why}.")
    shown = [each for each in report.errors if each.method == OURS or each.seen == "dark"]
    for label, values in (
        ("px", {_name(each): each.distance_px for each in shown}),
        ("degrees", {_name(each): np.abs(each.rotation_deg) for each in shown}),
    ):
        yield chart(
            line_chart(report.index, values, "frame", label),
            "What is left in each bright frame. Peaks are haste, which interpolation by time misses; a slope is drift.",
        )


def _name(errors: MotionErrors) -> str:
    return errors.method if errors.seen == "both" else f"{errors.method}, {errors.seen} frames"


def _figures(errors: MotionErrors) -> dict[str, float]:
    distance, rotation = errors.distance_px, np.abs(errors.rotation_deg)
    return {
        "translation_rms_px": float(np.sqrt(np.mean(distance**2))),
        "translation_max_px": float(distance.max()),
        "rotation_rms_deg": float(np.sqrt(np.mean(rotation**2))),
        "rotation_max_deg": float(rotation.max()),
        "lost": errors.lost,
    }
