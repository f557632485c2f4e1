"""Camera costs as text for a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from relit_camera.lab.bench.camera_cost import CameraCost


def cost_text(cost: CameraCost) -> str:
    """The table of one camera: a line a stage, then the sums, then what else was seen."""
    unit = cost.mesh_run_ms
    rows = [("a picture", "CPU ms", "mesh runs", "p50 ms", "p95 ms")]
    for name, stage in cost.stages.items():
        rows.append(
            (name, f"{stage.processor_ms:.2f}", f"{stage.mesh_runs:.2f}", f"{stage.p50_ms:.1f}", f"{stage.p95_ms:.1f}")
        )
    rows += [
        ("outside the stages", f"{cost.outside_ms:.2f}", f"{cost.outside_mesh_runs:.2f}", "", ""),
        ("whole process", f"{cost.processor_ms:.2f}", f"{cost.mesh_runs:.2f}", "", ""),
        ("capture to publish", "", "", f"{cost.latency_p50_ms:.1f}", f"{cost.latency_p95_ms:.1f}"),
    ]
    by_cost = sorted(cost.threads_ms.items(), key=lambda item: -item[1])
    threads = ", ".join(f"{name} {ms / unit:.2f}" for name, ms in by_cost if ms / unit >= 0.005)
    return "\n".join(
        [
            cost_title(cost),
            *_aligned(rows),
            *([f"  threads, in mesh runs: {threads}"] if threads else []),
            f"  {cost.composed} pictures of {cost.source_fps:g} frames a second, {_dropped(cost)}",
            f"  resident memory {cost.resident_mb:.0f} MB; first picture {cost.first_picture_s:.1f} s after the start",
            f"  a mesh run: {unit:.2f} ms; the installed face mesh network {_installed(cost)}",
            *(f"  degraded: {line}" for line in cost.degraded),
        ]
    )


def cost_title(cost: CameraCost) -> str:
    """What was measured, in a line."""
    width, height = cost.size
    return f"{cost.mode}, background {cost.background}, {width}x{height}, tracker {cost.tracker}"


def _installed(cost: CameraCost) -> str:
    return "is missing" if cost.installed_mesh_runs is None else f"takes {cost.installed_mesh_runs:.2f}"


def _dropped(cost: CameraCost) -> str:
    if not cost.dropped:
        return "none dropped"
    share = 100 * cost.dropped / (cost.composed + cost.dropped)
    return f"{cost.dropped} dropped ({share:.0f} %): their decoding counts above; see --source-fps"


def _aligned(rows: Sequence[tuple[str, ...]]) -> list[str]:
    return ["  " + f"{name:20}" + "".join(f"{cell:>11}" for cell in cells) for name, *cells in rows]
