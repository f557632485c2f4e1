"""`python -m tests.soak --seconds 1800`: memory, files, threads and latency of `relit run`. Run by hand, not in CI.

Somebody looks at the preview all the time, and opens it anew twice a minute.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from statistics import median

import httpx
import psutil

from tests.cli.relit_command import start, write_material

SAMPLES = 60
LEAST_INTERVAL_S = 1.0
WARM_UP_S = 60.0
"""Not judged: this long, or the first fifth of a shorter run."""
GROWTH_MIB = 20.0
"""Resident memory at the end may be above that after the warm-up by this much."""
MORE_FILES, MORE_THREADS = 4, 2
"""So many more may be open, or at work, in the last third than in the first, by the median."""
VIEW_S = 30.0
DRIFT_MS = 3.0
"""The median latency of the last third may be above that of the first by this much."""
END_S = 3.0


@dataclass(frozen=True)
class Sample:
    """What the camera showed at one moment.

    Attributes:
        time_s: since it was ready.
        rss_mib: resident memory of its process.
        p50_ms, p95_ms: latency of the last 300 frames, from a frame's arrival to the end of writing its picture.
        files: open file descriptors of its process.
        threads: of its process.
    """

    time_s: float
    rss_mib: float
    p50_ms: float
    p95_ms: float
    files: int
    threads: int


def view(address: str, stopping: threading.Event) -> None:
    """Look at the preview until `stopping`, and open it anew every `VIEW_S`."""
    while not stopping.is_set():
        until = time.monotonic() + VIEW_S
        try:
            with httpx.stream("GET", f"{address}api/v1/preview.mjpg", timeout=30) as answer:
                for _ in answer.iter_raw():
                    if stopping.is_set() or time.monotonic() > until:
                        break
        except httpx.HTTPError:
            stopping.wait(1)


def watch(process: subprocess.Popen[str], seconds: float) -> list[Sample]:
    """Look at a camera that was just started, `seconds` long or until it no longer answers."""
    assert process.stdout is not None
    assert process.stderr is not None
    ready = process.stdout.readline()
    if not ready:
        print(process.stderr.read(), file=sys.stderr)
        return []
    address = ready.split()[-1]
    watched, began, samples = psutil.Process(process.pid), time.monotonic(), list[Sample]()
    interval_s = max(LEAST_INTERVAL_S, seconds / SAMPLES)
    stopping = threading.Event()
    viewer = threading.Thread(target=view, args=(address, stopping))
    viewer.start()
    try:
        sample_until(address, seconds, began, interval_s, watched, samples)
    finally:
        stopping.set()
        viewer.join()
    return samples


def sample_until(
    address: str, seconds: float, began: float, interval_s: float, watched: psutil.Process, samples: list[Sample]
) -> None:
    """Add a sample every `interval_s` until `seconds` after `began`, or until the camera no longer answers."""
    with httpx.Client(base_url=address, timeout=30) as http:
        while (passed_s := time.monotonic() - began) + interval_s <= seconds + 0.5:
            time.sleep(interval_s - passed_s % interval_s)
            try:
                status = http.get("api/v1/status").raise_for_status().json()
            except httpx.HTTPError as error:
                print(f"the camera does not answer: {error}", file=sys.stderr)
                break
            latency, troubles = status["latency_ms"], "; ".join(trouble["what"] for trouble in status["degraded"])
            samples.append(
                Sample(
                    time.monotonic() - began,
                    watched.memory_info().rss / 2**20,
                    latency["p50"],
                    latency["p95"],
                    watched.num_fds(),
                    watched.num_threads(),
                )
            )
            print(f"{samples[-1]}  fps {status['fps']}  troubles: {troubles or 'none'}", file=sys.stderr, flush=True)


def stop(process: subprocess.Popen[str]) -> int | None:
    """Tell the camera to end; returns its exit code, None if it did not end in time."""
    process.terminate()
    try:
        process.communicate(timeout=END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return None
    return process.returncode


def report(samples: Sequence[Sample], seconds: float, exit_code: int | None) -> dict[str, object]:
    """The figures as JSON; `wrong` lists what is not as it must be."""
    warm_up_s = min(WARM_UP_S, seconds / 5)
    judged = [sample for sample in samples if sample.time_s > warm_up_s]
    if not samples or samples[-1].time_s < 0.9 * seconds:
        return {"exit_code": exit_code, "wrong": ["the camera ended before its time"]}
    third = len(judged) // 3
    first_ms, last_ms = (median(s.p50_ms for s in part) for part in (judged[:third], judged[-third:]))
    rss_mib = {"start": round(judged[0].rss_mib, 1), "end": round(judged[-1].rss_mib, 1)}
    wrong = []
    if (grown := rss_mib["end"] - rss_mib["start"]) > GROWTH_MIB:
        wrong.append(f"memory grew by {grown:.1f} MiB, allowed are {GROWTH_MIB:g}")
    counts = {}
    for name, most in (("files", MORE_FILES), ("threads", MORE_THREADS)):
        first, last = (round(median(getattr(s, name) for s in part)) for part in (judged[:third], judged[-third:]))
        counts[name] = {"first_third": first, "last_third": last}
        if last - first > most:
            wrong.append(f"{name} grew by {last - first}, allowed are {most}")
    if last_ms - first_ms > DRIFT_MS:
        wrong.append(f"the median latency grew by {last_ms - first_ms:.1f} ms, allowed are {DRIFT_MS:g}")
    if exit_code != 0:
        wrong.append(f"told to end, it gave exit code {exit_code} instead of 0 within {END_S:g} s")
    # A sample tells of the time before it: that at 60 s is the first minute's last.
    by_minute = groupby(samples, lambda sample: int((sample.time_s - LEAST_INTERVAL_S) // 60))
    minutes = [list(group) for _, group in by_minute]
    return {
        "seconds": seconds,
        "rss_mib": rss_mib,
        **counts,
        "latency_p50_ms": {"first_third": round(first_ms, 2), "last_third": round(last_ms, 2)},
        "minutes": [
            {
                "rss_mib": round(minute[-1].rss_mib, 1),
                "p50_ms": round(median(s.p50_ms for s in minute), 2),
                "p95_ms": round(median(s.p95_ms for s in minute), 2),
            }
            for minute in minutes
        ],
        "exit_code": exit_code,
        "wrong": wrong,
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 if all is as it must be, else 1."""
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=__doc__)
    parser.add_argument("--seconds", type=float, default=600.0, help="how long, 20 at least")
    parser.add_argument("run", nargs="*", help="arguments for relit run, after `--`; a small generated clip if none")
    options = parser.parse_args(arguments)
    if options.seconds < 20:
        parser.error("--seconds must be 20 or more")
    with tempfile.TemporaryDirectory(prefix="relit-soak.") as name:
        folder, chosen = Path(name), options.run
        if not chosen:
            made = write_material(folder)
            chosen = ["--source", made.clip, "--subject", made.subject, "--tracker", made.tracker]
        process = start("run", *chosen, "--sink", "null", "--port", 0, folder=folder)
        try:
            samples = watch(process, options.seconds)
        finally:
            exit_code = stop(process)
    found = report(samples, options.seconds, exit_code)
    print(json.dumps(found, indent=2))
    return int(bool(found["wrong"]))


if __name__ == "__main__":
    sys.exit(main())
