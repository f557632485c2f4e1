"""A cost curve: the processor time of one part of the camera against one size, each point a median."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from statistics import median
from typing import Any

import cv2
from threadpoolctl import threadpool_limits

from relit_camera.base.concurrency.threads import BLAS_THREADS, OPENCV_THREADS

NOT_MEASURED = "–"


@dataclass(frozen=True)
class CostCurve:
    """Processor times against one size; the mappings go from a name to one value a size, None where not measured.

    Attributes:
        name: of its files.
        size_name: what the sizes are.
        sizes: rising.
        caption: what was measured, and how.
        mesh_run_ms: processor time of a mesh run (`lab.bench.mesh_run`) beside the measurements.
        processor_ms: processor time of each implementation.
        bounds_ms: of some implementations, the time in which one core reads the numbers that they multiply.
        other: other figures, by name and unit; they are not drawn.
        logarithmic: whether both axes of the plot are.
    """

    name: str
    size_name: str
    sizes: Sequence[int]
    caption: str
    mesh_run_ms: float
    processor_ms: Mapping[str, Sequence[float | None]]
    bounds_ms: Mapping[str, Sequence[float | None]] = field(default_factory=dict)
    other: Mapping[str, Sequence[float | None]] = field(default_factory=dict)
    logarithmic: bool = False

    def mesh_runs(self) -> dict[str, list[float | None]]:
        """`processor_ms` in mesh runs."""
        unit = self.mesh_run_ms
        return {
            name: [None if ms is None else ms / unit for ms in values] for name, values in self.processor_ms.items()
        }

    def as_json(self) -> dict[str, Any]:
        """All of it, with the times in mesh runs as well."""
        return {**asdict(self), "mesh_runs": self.mesh_runs()}

    def text(self) -> str:
        """A table: a line a size, with each time in milliseconds and in mesh runs, and the other figures."""
        runs = self.mesh_runs()
        columns = [[self.size_name, *map(str, self.sizes)]]
        for name, values in self.processor_ms.items():
            columns.append([f"{name}, ms", *(_cell(value, 3) for value in values)])
            columns.append(["mesh runs", *(_cell(value, 3) for value in runs[name])])
        columns += [[name, *(_cell(value, 1) for value in values)] for name, values in self.other.items()]
        widths = [max(map(len, column)) for column in columns]
        lines = [
            "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True))
            for row in zip(*columns, strict=True)
        ]
        return "\n".join([f"{self.caption} A mesh run: {self.mesh_run_ms:.2f} ms.", *lines])


@contextmanager
def one_thread() -> Iterator[None]:
    """Within the block BLAS and OpenCV have one thread, as in the camera: others spin while they wait."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(OPENCV_THREADS)
    try:
        with threadpool_limits(limits=BLAS_THREADS, user_api="blas"):
            yield
    finally:
        cv2.setNumThreads(before)


def _cell(value: float | None, digits: int) -> str:
    return NOT_MEASURED if value is None else f"{value:.{digits}f}"


def median_processor_ms(call: Callable[[], object], at_most_s: float, repeats: int = 40) -> float:
    """Median processor time of a call by all threads of this process, in milliseconds, after one that is not counted.

    Three calls at least; no more are begun when `at_most_s` seconds have passed.
    """
    call()
    ends, durations = time.monotonic() + at_most_s, list[float]()
    while len(durations) < 3 or (len(durations) < repeats and time.monotonic() < ends):
        began = time.process_time()
        call()
        durations.append(time.process_time() - began)
    return 1e3 * median(durations)
