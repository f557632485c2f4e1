"""Curves in files: a plot of each as SVG, and all their figures in `curves.json`."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from relit_camera.base.storage.atomic_files import write_atomic
from relit_camera.lab.bench.curves.cost_curve import CostCurve
from relit_camera.lab.evaluate.report.html_page import data_of_uri
from relit_camera.lab.evaluate.report.plots import line_plot

RECORD = "curves.json"


def write_curves(folder: Path, curves: Sequence[CostCurve], machine: Mapping[str, object]) -> list[Path]:
    """Write `NAME.svg` of each curve and `curves.json` into an existing folder; returns the files.

    Raises:
        StorageError: a file cannot be written.
    """
    files = []
    for curve in curves:
        plot = line_plot(
            curve.sizes,
            _drawn(curve.processor_ms),
            curve.size_name,
            f"ms of processor time (mesh run: {curve.mesh_run_ms:.2f})",
            curve.caption,
            from_zero=not curve.logarithmic,
            logarithmic=curve.logarithmic,
            bounds=_drawn(curve.bounds_ms),
            bounds_label="reading its numbers",
        )
        files.append(folder / f"{curve.name}.svg")
        write_atomic(files[-1], data_of_uri(plot.source))
    files.append(folder / RECORD)
    found = {"machine": machine, "curves": [curve.as_json() for curve in curves]}
    write_atomic(files[-1], json.dumps(found, indent=1) + "\n")
    return files


def _drawn(series: Mapping[str, Sequence[float | None]]) -> dict[str, list[float]]:
    return {name: [math.nan if ms is None else ms for ms in values] for name, values in series.items()}
