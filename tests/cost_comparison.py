"""`python -m tests.cost_comparison OLD_TREE VIDEO SUBJECT`: what a picture costs in another checkout and in this one.

Both cameras run in turn as processes of their own (`relit run`, no viewer, no sink), each for some seconds after a
warm-up, under the sunset. Processor time of the process a picture in milliseconds and in mesh runs, pictures a second,
latency and resident memory; JSON, a camera a line. Only what the status of both says is used. By hand, not in CI.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
import time
from pathlib import Path
from statistics import mean

import httpx
import psutil

from relit_camera.base.models.model_store import FOLDER_VARIABLE
from relit_camera.lab.bench.mesh_run import MeshRun
from tests.cli.relit_command import COMMAND, environment
from tests.soak import stop

WARM_UP_S = 6.0
UNIT_SAMPLES = 5


def measure(folder: Path, variables: dict[str, str], arguments: list[str], seconds: float) -> dict[str, float]:
    """Run a camera in `folder`, with these environment variables and arguments, and watch it."""
    process = subprocess.Popen(
        [*COMMAND, *arguments], cwd=folder, env=variables, stdout=subprocess.PIPE, stderr=-1, text=True
    )
    try:
        assert process.stdout is not None
        with httpx.Client(base_url=process.stdout.readline().split()[-1], timeout=30) as http:
            http.patch("api/v1/lighting", json={"environment": "sunset"}).raise_for_status()
            time.sleep(WARM_UP_S)
            watched, rates = psutil.Process(process.pid), list[float]()
            before, began = watched.cpu_times(), time.monotonic()
            while time.monotonic() - began < seconds:
                time.sleep(1.0)
                status = http.get("api/v1/status").raise_for_status().json()
                rates.append(status["fps"]["pipeline"])
            after, passed = watched.cpu_times(), time.monotonic() - began
            memory_mb = watched.memory_info().rss / 1e6
    finally:
        stop(process)
    used_s = after.user + after.system - before.user - before.system
    return {
        "picture_ms": round(1e3 * used_s / (mean(rates) * passed), 1),
        "pictures_per_s": round(mean(rates), 1),
        "p50_ms": round(status["latency_ms"]["p50"], 1),
        "p95_ms": round(status["latency_ms"]["p95"], 1),
        "resident_mb": round(memory_mb),
    }


def mesh_run_ms() -> float:
    """Processor time of the unit, now."""
    unit = MeshRun()
    for _ in range(UNIT_SAMPLES):
        unit.sample()
    return unit.ms


def main() -> None:
    """Print the comparison."""
    parser = argparse.ArgumentParser(prog="python -m tests.cost_comparison", description=__doc__)
    parser.add_argument("old_tree", type=Path, help="another checkout of this repository")
    parser.add_argument("video", type=Path)
    parser.add_argument("subject", type=Path)
    parser.add_argument("--old-models", type=Path, help="folder of the networks that the other checkout pulls")
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--old-seconds", type=float, help="for the other checkout; as --seconds if not given")
    options = parser.parse_args()
    here = Path(__file__).resolve().parents[1]
    with tempfile.TemporaryDirectory(prefix="relit-cost.") as folder:
        for mode in ("reenact", "ratio"):  # the former names: another checkout may know no others
            for name, tree in (("before", options.old_tree), ("after", here)):
                variables = {**environment(Path(folder)), "PYTHONPATH": str(tree.resolve() / "service")}
                if name == "before" and options.old_models:
                    variables[FOLDER_VARIABLE] = str(options.old_models.resolve())
                chosen = ["--source", str(options.video.resolve()), "--subject", str(options.subject.resolve())]
                arguments = ["run", *chosen, "--tracker", "mesh", "--mode", mode, "--sink", "null", "--port", "0"]
                unit_ms = mesh_run_ms()
                seconds = options.old_seconds if name == "before" and options.old_seconds else options.seconds
                # Not here: each camera would read the configuration file of this checkout.
                found = measure(Path(folder), variables, arguments, seconds)
                unit_ms = (unit_ms + mesh_run_ms()) / 2
                runs = round(found["picture_ms"] / unit_ms, 2)
                line = {"mode": mode, "camera": name, "seconds": seconds, "mesh_runs": runs}
                print(json.dumps({**line, "mesh_run_ms": round(unit_ms, 2), **found}), flush=True)


if __name__ == "__main__":
    main()
