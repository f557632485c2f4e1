"""What a picture of the running camera costs: processor time, seen from outside, in milliseconds and in mesh runs."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path
from typing import Any

from relit_camera.app.demo import demo_files
from relit_camera.base.config.look import Background, Mode
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.errors import ModelError
from relit_camera.lab.bench.bench_source import prepare_video
from relit_camera.lab.bench.camera_process import CameraProcess
from relit_camera.lab.bench.mesh_run import MeshRun, installed_mesh_runs

WARM_UP_S = 4.0
SAMPLE_INTERVAL_S = 1.0


@dataclass(frozen=True)
class StageCost:
    """What a stage costs.

    Attributes:
        processor_ms: processor time a picture, the mean; stages within it not counted.
        mesh_runs: the same in mesh runs (`lab.bench.mesh_run`).
        p50_ms, p95_ms: time from its beginning to its end.
    """

    processor_ms: float
    mesh_runs: float
    p50_ms: float
    p95_ms: float


@dataclass(frozen=True)
class CameraCost:
    """What a picture of a running camera costs. Times are means a composed picture where nothing else is said.

    Attributes:
        mode, background: as the settings name them.
        tracker: the same, without its argument, which may be a path of this machine.
        size: (width, height) of the pictures.
        source_fps: frames a second that the source gave.
        composed: pictures made while it was measured.
        dropped: frames passed over meanwhile. They were decoded, which counts.
        processor_ms: processor time of the whole process.
        mesh_runs: the same in mesh runs (`lab.bench.mesh_run`).
        mesh_run_ms: processor time of such a run, the median of those beside the camera.
        installed_mesh_runs: what a run of the installed face mesh network costs, in mesh runs; None without one.
        stages: by name.
        outside_ms: processor time of the process outside the stages.
        threads_ms: processor time of the threads by name, stages included; empty where the system does not tell.
        latency_p50_ms, latency_p95_ms: from a frame's arrival to the end of writing its picture.
        resident_mb: memory, in units of 10^6 bytes.
        first_picture_s: from the start of the process to its first picture.
        degraded: what worked less well than asked.
    """

    mode: str
    background: str
    tracker: str
    size: tuple[int, int]
    source_fps: float
    composed: int
    dropped: int
    processor_ms: float
    mesh_runs: float
    mesh_run_ms: float
    installed_mesh_runs: float | None
    stages: dict[str, StageCost]
    outside_ms: float
    threads_ms: dict[str, float]
    latency_p50_ms: float
    latency_p95_ms: float
    resident_mb: float
    first_picture_s: float
    degraded: list[str]

    @property
    def outside_mesh_runs(self) -> float:
        """`outside_ms` in mesh runs."""
        return self.outside_ms / self.mesh_run_ms

    def as_json(self) -> dict[str, Any]:
        """The figures, rounded."""
        return {name: _rounded(value) for name, value in asdict(self).items()}


def measure_cameras(
    settings: RelitSettings,
    sizes: Sequence[tuple[int, int]],
    modes: Sequence[Mode],
    backgrounds: Sequence[Background],
    source_fps: float | None,
    seconds: float,
) -> Iterator[CameraCost]:
    """Measure a camera of each combination, one after another, in their order.

    Args:
        settings: of all of them. A video file as source is scaled to each size, unless a recorded track belongs to it.
        sizes: (width, height) of source and pictures.
        modes: of the look.
        backgrounds: of the look.
        source_fps: frames a second of a video file; its own if None.
        seconds: how long each is measured.

    Raises:
        RelitError: the video cannot be read, or a camera cannot run.
    """
    source, recorded = Path(settings.source.source), settings.tracker.name.startswith("recorded")
    with tempfile.TemporaryDirectory(prefix="relit-bench.") as folder:
        for size, mode, background in product(sizes, modes, backgrounds):
            fps, played = settings.source.fps, settings.source.source
            if source.is_file():
                video, fps = prepare_video(source, Path(folder), None if recorded else size, source_fps)
                played = str(video)
            place = {"width": size[0], "height": size[1], "fps": fps}
            changed = {
                "source": settings.source.model_copy(update={**place, "source": played}),
                "output": settings.output.model_copy(update={**place, "sink": "null"}),
                "look": settings.look.model_copy(update={"mode": mode, "background": background}),
            }
            yield measure_camera(settings.model_copy(update=changed), fps, seconds, MeshRun())


def bundled_settings(settings: RelitSettings) -> RelitSettings:
    """The settings with the demonstration's clip, subject and look as source, subject and look."""
    changed = {
        "source": settings.source.model_copy(update={"source": str(demo_files.CLIP)}),
        "subject": settings.named_subject or str(demo_files.SUBJECT),
        "tracker": settings.tracker.model_copy(update={"name": demo_files.tracker_of_clip()}),
        "matte": demo_files.matte_of_clip(),
    }
    return settings.model_copy(update=changed)


def measure_camera(settings: RelitSettings, source_fps: float, seconds: float, mesh: MeshRun) -> CameraCost:
    """Run a camera in a process of its own, warm it up, and measure it for some seconds; nobody views its preview.

    The network of `mesh` runs beside it once a second, in this process, so that both see the same machine.

    Raises:
        RelitError: the camera cannot run, or makes no pictures.
    """
    try:
        installed = installed_mesh_runs()
    except ModelError:
        installed = None
    with CameraProcess(settings) as camera:
        time.sleep(WARM_UP_S)
        # Read within each other: no part is counted over a longer time than its whole.
        threads_before, began_s, before = camera.thread_s, camera.processor_s, camera.status()
        end = time.monotonic() + seconds
        while (left_s := end - time.monotonic()) > 0:
            mesh.sample()
            time.sleep(min(left_s, SAMPLE_INTERVAL_S))
        after, used_s, threads_after = camera.status(), camera.processor_s - began_s, camera.thread_s
        resident_mb, first_picture_s = camera.resident_mb, camera.first_picture_s
    composed = _grown(before, after, "composed")
    per_picture = 1e3 / max(composed, 1)
    stages = {}
    for name, used in after["stage_processor_s"].items():
        own_ms = (used - before["stage_processor_s"].get(name, 0.0)) * per_picture
        stages[name] = StageCost(
            own_ms, own_ms / mesh.ms, after["stage_ms"][name]["p50"], after["stage_ms"][name]["p95"]
        )
    return CameraCost(
        mode=after["mode"],
        background=settings.look.background.kind,
        tracker=settings.tracker.name.partition(":")[0],
        size=(settings.output.width, settings.output.height),
        source_fps=source_fps,
        composed=composed,
        dropped=_grown(before, after, "dropped"),
        processor_ms=used_s * per_picture,
        mesh_runs=used_s * per_picture / mesh.ms,
        mesh_run_ms=mesh.ms,
        installed_mesh_runs=installed,
        stages=stages,
        outside_ms=used_s * per_picture - sum(stage.processor_ms for stage in stages.values()),
        threads_ms={name: (s - threads_before.get(name, 0.0)) * per_picture for name, s in threads_after.items()},
        latency_p50_ms=after["latency_ms"]["p50"],
        latency_p95_ms=after["latency_ms"]["p95"],
        resident_mb=resident_mb,
        first_picture_s=first_picture_s,
        degraded=[f"{trouble['what']}: {trouble['why']}" for trouble in after["degraded"]],
    )


def _grown(before: Mapping[str, Any], after: Mapping[str, Any], count: str) -> int:
    return int(after["frames"][count] - before["frames"][count])


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return round(value, 3)
    if isinstance(value, Mapping):
        return {name: _rounded(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(each) for each in value]
    return value
