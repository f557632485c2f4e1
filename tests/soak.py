"""`python -m tests.soak --minutes 10`: memory and latency of `relit run` over time, a line a minute. Not part of CI."""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import httpx
import psutil

from tests.cli.relit_command import start, write_material

SAMPLE_S = 60.0
WARM_UP_MINUTES = 2
GROWTH_MIB = 20.0
"""Memory may differ by this much between the end of the warm-up and the end."""


def soak(
    minutes: int, arguments: Sequence[str], folder: Path, sample_s: float = SAMPLE_S
) -> list[tuple[float, float, float]]:
    """Run the camera and look at it `minutes` times; returns resident MiB, latency p50 and p95 in ms of each."""
    process = start("run", *arguments, "--sink", "null", "--port", 0, folder=folder)
    rows = []
    try:
        assert process.stdout is not None
        address = process.stdout.readline().split()[-1]
        watched = psutil.Process(process.pid)
        with httpx.Client(base_url=address, timeout=30) as http:
            for minute in range(1, minutes + 1):
                time.sleep(sample_s)
                status = http.get("api/v1/status").raise_for_status().json()
                rss = watched.memory_info().rss / 2**20
                p50, p95 = status["latency_ms"]["p50"], status["latency_ms"]["p95"]
                rows.append((rss, p50, p95))
                fps = " ".join(f"{name} {value:.1f}" for name, value in status["fps"].items())
                troubles = "; ".join(trouble["what"] for trouble in status["degraded"]) or "none"
                print(
                    f"{minute:3} min  {rss:7.1f} MiB  p50 {p50:6.1f} ms  p95 {p95:6.1f} ms  fps {fps}  "
                    f"{status['frames']['published']} published  threads {watched.num_threads()}  troubles: {troubles}",
                    flush=True,
                )
    finally:
        process.terminate()
        process.communicate(timeout=10)
    return rows


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 if memory stayed flat, 1 if it grew."""
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=__doc__)
    parser.add_argument("--minutes", type=int, default=10)
    parser.add_argument("run", nargs="*", help="arguments for relit run, after `--`; a small generated clip if none")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="relit-soak.") as name:
        folder, chosen = Path(name), options.run
        if not chosen:
            made = write_material(folder)
            chosen = ["--source", made.clip, "--subject", made.subject, "--tracker", made.tracker]
        rows = soak(options.minutes, chosen, folder)
    grown = rows[-1][0] - rows[min(WARM_UP_MINUTES, len(rows)) - 1][0]
    print(f"memory grew by {grown:.1f} MiB after the warm-up; p50 from {rows[0][1]:.1f} to {rows[-1][1]:.1f} ms")
    return int(grown > GROWTH_MIB)


if __name__ == "__main__":
    sys.exit(main())
