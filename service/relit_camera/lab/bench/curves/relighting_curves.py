"""Relighting against the subject's pixels and against the rank of its local bases, beside the speed of memory."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np
import psutil

from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.lab.bench.curves.cost_curve import CostCurve, median_processor_ms, one_thread
from relit_camera.lab.bench.mesh_run import MeshRun
from relit_camera.light.directions import MAP_HEIGHT, MAP_WIDTH
from relit_camera.subject.compression.local_basis import LocalBasis
from relit_camera.subject.reflectance_field import TEXELS
from relit_camera.subject.relighting.basis_relighter import BasisRelighter
from relit_camera.subject.relighting.dense_relighter import DenseRelighter
from relit_camera.subject.relighting.onnx_relighter import OnnxBasisRelighter
from relit_camera.subject.relighting.relighter import Relighter, RelighterOptions
from relit_camera.subject.subject import Subject, SubjectMetadata

SIDES_PX = (64, 128, 192, 256, 384, 512)
RANKS = (8, 16, 24, 32, 48, 64)
SIDE_PX, RANK = 256, 32
"""Of the curve against the other one. Captured subjects have some 30 components in each cluster."""
COMPONENTS, PLACES = 768, 128
"""Shared components, and pixels of a cluster."""
DENSE_SIDE_PX = 128
"""Largest side at which the dense matrix is measured: it has 403 MB then."""
MEMORY_SHARE = 0.25
"""Of the free memory, which the dense matrix may take."""
READ_BYTES = 1 << 28
"""Of the array whose reading tells the speed of memory: more than caches hold."""


@dataclass(frozen=True)
class _Measured:
    """Processor time of a picture, and megabytes of the numbers that it reads."""

    ms: float
    megabytes: float


def relighting_curves(
    mesh: MeshRun,
    sides_px: Sequence[int] = SIDES_PX,
    ranks: Sequence[int] = RANKS,
    side_px: int = SIDE_PX,
    at_most_s: float = 0.5,
    read_bytes: int = READ_BYTES,
) -> list[CostCurve]:
    """The curves against pixels and against rank: each implementation of relighting on one thread, one light map.

    Args:
        mesh: the unit; sampled here.
        sides_px: widths, and heights, of the subjects.
        ranks: components of each cluster.
        side_px: of the subjects of these ranks.
        at_most_s: how long each point is measured.
        read_bytes: see `READ_BYTES`.
    """
    with one_thread():
        gb_per_s = read_gb_per_s(read_bytes)
        by_side = [_measure(sized_subject(side, RANK), at_most_s, side <= DENSE_SIDE_PX) for side in sides_px]
        mesh.sample()
        by_rank = [_measure(sized_subject(side_px, rank), at_most_s, with_dense=False) for rank in ranks]
        mesh.sample()
    return [
        _curve(
            "relighting-pixels", "pixels", [side**2 for side in sides_px], True, by_side, gb_per_s, mesh,
            f"Relighting a picture, rank {RANK} in each cluster, {COMPONENTS} shared components, one thread.",
        ),
        _curve(
            "relighting-rank", "rank", ranks, False, by_rank, gb_per_s, mesh,
            f"Relighting a picture of {side_px} × {side_px} pixels by the components of each cluster, one thread.",
        ),
    ]  # fmt: skip


def read_gb_per_s(nbytes: int = READ_BYTES) -> float:
    """How fast one core reads memory: the largest of so many bytes of float32, median of five."""
    array = np.ones(nbytes // 4, np.float32)
    durations = []
    for _ in range(5):
        began = time.thread_time()
        array.max()
        durations.append(time.thread_time() - began)
    return nbytes / 1e9 / median(durations)


def sized_subject(side_px: int, rank: int) -> Subject:
    """A subject of random local bases: what relighting costs depends on their sizes, not on their numbers.

    Args:
        side_px: its width and height.
        rank: components of each cluster.
    """
    rng = np.random.default_rng(0)
    pixels = np.arange(side_px**2, dtype=np.int32)
    clusters = np.append(pixels, np.repeat(pixels[-1:], -len(pixels) % PLACES)).reshape(-1, PLACES)
    count = rank * len(clusters)
    basis = LocalBasis(
        clusters,
        np.arange(0, count + 1, rank, dtype=np.int32),
        rng.integers(-127, 128, (count, 3, PLACES), np.int8),
        np.full(count, 1e-3, np.float32),
        rng.standard_normal((count, COMPONENTS), np.float32).astype(np.float16),
    )
    metadata = SubjectMetadata(
        width=side_px,
        height=side_px,
        method="random",
        lights=1,
        components=COMPONENTS,
        source="generated",
        psnr_db=0,
        created_by="bench",
        created_at="",
    )
    return Subject(
        metadata,
        basis,
        rng.standard_normal((COMPONENTS, TEXELS), np.float32),
        np.array([[0, 0, 1]], np.float32),
        np.ones((COMPONENTS, 1), np.float32),
        np.ones((side_px, side_px), np.float32),
        np.zeros((side_px, side_px, 3), np.uint8),
    )


def _measure(subject: Subject, at_most_s: float, with_dense: bool) -> dict[str, _Measured]:
    """By the name of each relighter; without `dense` where that is not wanted, or larger than memory allows."""
    light_map = np.random.default_rng(1).random((1, MAP_HEIGHT, MAP_WIDTH, 3), np.float32)
    options = RelighterOptions(SessionOptions("cpu", 1))
    basis, found = subject.basis, dict[str, _Measured]()

    def measure(relighter: Relighter, nbytes: int) -> None:
        ms = median_processor_ms(lambda: relighter.relight(light_map), at_most_s)
        found[relighter.name] = _Measured(ms, nbytes / 1e6)

    integers = BasisRelighter(subject, options)
    measure(integers, integers.nbytes)
    del integers
    floats = subject.coefficients.size + basis.mixes.size + basis.values.size
    measure(OnnxBasisRelighter(subject, options), 4 * floats)
    dense_bytes = 3 * 4 * subject.matte.size * TEXELS
    if with_dense and dense_bytes < MEMORY_SHARE * psutil.virtual_memory().available:
        measure(DenseRelighter(subject), dense_bytes)
    return found


def _curve(
    name: str,
    size_name: str,
    sizes: Sequence[int],
    logarithmic: bool,
    points: Sequence[dict[str, _Measured]],
    gb_per_s: float,
    mesh: MeshRun,
    caption: str,
) -> CostCurve:
    names = list(dict.fromkeys(each for point in points for each in point))
    megabytes = {each: [point[each].megabytes if each in point else None for point in points] for each in names}
    return CostCurve(
        name,
        size_name,
        list(sizes),
        f"{caption} One core reads {gb_per_s:.1f} GB/s.",
        mesh.ms,
        {each: [point[each].ms if each in point else None for point in points] for each in names},
        {each: [None if read is None else read / gb_per_s for read in values] for each, values in megabytes.items()},
        {f"{each}, MB read": values for each, values in megabytes.items()},
        logarithmic=logarithmic,
    )
