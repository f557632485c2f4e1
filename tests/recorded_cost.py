"""`python -m tests.recorded_cost`: measures the camera for docs/performance.md, and writes docs/performance.json.

Takes four minutes; needs the public models, and a machine that has nothing else to do. `python -m tests.doc_tables`
makes the tables of the page of it. CI measures the short cameras of it anew, and prints both (tests/lab/bench).
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from relit_camera.app.demo import demo_files
from relit_camera.base.config.look import BlurBackground, Mode, NoBackground
from relit_camera.base.config.settings import RelitSettings, StorageSettings
from relit_camera.lab.bench.camera_cost import CameraCost, bundled_settings, measure_cameras
from relit_camera.lab.bench.machine_info import machine_info

ROOT = Path(__file__).resolve().parents[1]
RECORD = ROOT / "docs" / "performance.json"
MAIN_SIZE, OTHER_SIZES = (1280, 720), [(640, 360), (1920, 1080)]
SECONDS, SOURCE_FPS = 10.0, 15.0
SHORT_SIZE, SHORT_SECONDS, SHORT_FPS = (640, 360), 5.0, 10.0
NOT_TIMED = "–"


def measure_short(data: Path) -> list[CameraCost]:
    """Both modes, small and briefly, with what every checkout has: the recorded track."""
    settings = bundled_settings(RelitSettings(storage=StorageSettings(data_dir=data)))
    recorded = {
        "tracker": settings.tracker.model_copy(update={"name": f"recorded:{demo_files.TRACK}"}),
        "matte": f"recorded:{demo_files.MATTES}",
    }
    return list(
        measure_cameras(
            settings.model_copy(update=recorded),
            [SHORT_SIZE],
            [Mode.PORTRAIT, Mode.LIVE],
            [NoBackground()],
            SHORT_FPS,
            SHORT_SECONDS,
        )
    )


def recorded() -> dict[str, Any]:
    """What docs/performance.json holds: `commit`, `date`, `machine`, `cameras` and `short`, each a list of costs."""
    found: dict[str, Any] = json.loads(RECORD.read_text())
    return found


def main() -> None:
    """Measure, and write the record."""
    settings = bundled_settings(RelitSettings())
    machine, modes = machine_info(), [Mode.PORTRAIT, Mode.LIVE]
    del machine["system"]  # the kernel's build says whose machine it is, and nothing about cost
    cameras = [
        *measure_cameras(settings, [MAIN_SIZE], modes, [NoBackground(), BlurBackground()], SOURCE_FPS, SECONDS),
        *measure_cameras(settings, OTHER_SIZES, modes, [NoBackground()], SOURCE_FPS, SECONDS),
    ]
    found = {
        "commit": _git("describe", "--always", "--dirty", "--abbrev=10"),
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "machine": machine,
        "cameras": [cost.as_json() for cost in cameras],
        "short": [cost.as_json() for cost in measure_short(settings.storage.data_dir)],
    }
    RECORD.write_text(json.dumps(found, indent=1) + "\n")


def _git(*arguments: str) -> str:
    return subprocess.run(["git", *arguments], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


def _main_cameras() -> list[dict[str, Any]]:
    return [cost for cost in recorded()["cameras"] if tuple(cost["size"]) == MAIN_SIZE]


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return "".join(f"| {' | '.join(row)} |\n" for row in (head, ["---"] * len(head), *rows))


def _title(cost: Mapping[str, Any]) -> str:
    return f"{cost['mode']}, {cost['background']}"


def _runs(cost: Mapping[str, Any], ms: float) -> str:
    return f"{ms / cost['mesh_run_ms']:.2f}"


def _cost_text() -> str:
    costs = _main_cameras()
    names = list(dict.fromkeys(name for cost in costs for name in cost["stages"]))

    def row(name: str, cell: Callable[[Mapping[str, Any]], str]) -> list[str]:
        return [name, *map(cell, costs)]

    def stage(name: str) -> Callable[[Mapping[str, Any]], str]:
        return lambda cost: f"{cost['stages'][name]['mesh_runs']:.2f}" if name in cost["stages"] else NOT_TIMED

    rows = [row(name, stage(name)) for name in names]
    rows += [
        row("outside the stages", lambda cost: _runs(cost, cost["outside_ms"])),
        row("**whole process, mesh runs**", lambda cost: f"**{cost['mesh_runs']:.1f}**"),
        row("whole process, ms", lambda cost: f"{cost['processor_ms']:.1f}"),
        row("latency p50 / p95, ms", lambda cost: f"{cost['latency_p50_ms']:.0f} / {cost['latency_p95_ms']:.0f}"),
        row("frames dropped", lambda cost: f"{100 * cost['dropped'] / (cost['composed'] + cost['dropped']):.0f} %"),
        row("resident memory, MB", lambda cost: f"{cost['resident_mb']:.0f}"),
        row("first picture, s", lambda cost: f"{cost['first_picture_s']:.1f}"),
    ]
    return _table(["a picture of 1280 × 720", *map(_title, costs)], rows)


def _sizes_text() -> str:
    costs = sorted(
        (cost for cost in recorded()["cameras"] if cost["background"] == "none"), key=lambda cost: cost["size"]
    )
    rows = [
        [
            f"{cost['size'][0]} × {cost['size'][1]}",
            cost["mode"],
            f"{cost['mesh_runs']:.1f}",
            f"{cost['resident_mb']:.0f}",
        ]
        for cost in costs
    ]
    return _table(["size", "mode", "mesh runs a picture", "resident memory, MB"], rows)


def _threads_text() -> str:
    costs = _main_cameras()
    totals = {name: sum(cost["threads_ms"].get(name, 0.0) for cost in costs) for c in costs for name in c["threads_ms"]}
    names = [name for name in sorted(totals, key=lambda name: -totals[name]) if totals[name] / len(costs) > 0.02]
    rows = [[f"`{name}`", *(_runs(cost, cost["threads_ms"].get(name, 0.0)) for cost in costs)] for name in names]
    return _table(["thread, in mesh runs a picture", *map(_title, costs)], rows)


def _origin_text() -> str:
    found = recorded()
    machine, unit = found["machine"], found["cameras"][0]
    return (
        f"Taken at commit `{found['commit']}` on {found['date']}: {machine['processor']}, {machine['cores']} cores, "
        f"load {machine['load_before']:.1f} before;\n{unit['source_fps']:g} frames a second; a mesh run takes "
        f"{unit['mesh_run_ms']:.1f} ms there. OpenCV {machine['opencv']}, ONNX Runtime {machine['onnxruntime']}.\n"
    )


TABLES: Mapping[str, Callable[[], str]] = {
    "cost": _cost_text,
    "cost-sizes": _sizes_text,
    "cost-threads": _threads_text,
    "cost-origin": _origin_text,
}
"""The tables of docs/performance.md by name, for `tests.doc_tables`."""


if __name__ == "__main__":
    main()
