"""`python -m tests.soak --seconds 7200 --changes 2`: memory, files, threads and latency of `relit run`, by minute.

Somebody looks at the preview all the time, and opens it anew twice a minute. With `--changes` so many random changes a
second are made through the API meanwhile (`tests.soak_changes`); what is measured is then measured in the scene of the
start, to which the camera is brought back for each sample. Twenty seconds of that run in CI, the long runs by hand.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from statistics import median

import httpx
import psutil

from tests.cli.relit_command import start, write_material
from tests.lateness import spinning
from tests.small_camera import WAIT_S
from tests.soak_changes import RandomChanges

SAMPLES = 60
MOST_BRIEF_SAMPLES = 6
"""Of a run of less than a minute with changes."""
MOST_SETTLE_S = 10.0
"""Between the last change and a sample: models are opened meanwhile, and what they replaced is given back."""
LEAST_INTERVAL_S = 1.0
WARM_UP_S, WARM_UP_WITH_CHANGES_S = 60.0, 600.0
"""Not judged: this long, or the first fifth of a shorter run, the first third where changes are made."""
GROWTH_MIB = 20.0
"""Resident memory may be above that after the warm-up by this much: at the end; with changes at any time, and as much
below it."""
MORE_FILES, MORE_THREADS = 4, 2
"""So many more may be open, or at work, in the last third than in the first, by the median."""
VIEW_S = 30.0
DRIFT_MS = 3.0
"""The median latency of the last third may be above that of the first by this much."""
END_S = 3.0
"""By the processor time that a busy machine leaves to any process meanwhile."""


@dataclass(frozen=True)
class Sample:
    """What the camera showed at one moment.

    Attributes:
        time_s: since it was ready.
        rss_mib: resident memory of its process.
        pss_mib: the same, of what several processes share only its part.
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
    pss_mib: float = 0.0


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


def watch(
    process: subprocess.Popen[str],
    seconds: float,
    samples_wanted: int = SAMPLES,
    changes_of: Callable[[str], RandomChanges] | None = None,
) -> list[Sample]:
    """Look at a camera that was just started, `seconds` long or until it no longer answers.

    Args:
        process: of the camera.
        seconds: how long.
        samples_wanted: how often.
        changes_of: makes what changes its scene, from its address.
    """
    assert process.stdout is not None
    assert process.stderr is not None
    ready = process.stdout.readline()
    if not ready:
        print(process.stderr.read(), file=sys.stderr)
        return []
    address = ready.split()[-1]
    watched, samples = psutil.Process(process.pid), list[Sample]()
    interval_s = max(LEAST_INTERVAL_S, seconds / samples_wanted)
    stopping = threading.Event()
    threads = [threading.Thread(target=view, args=(address, stopping))]
    changes = changes_of(address) if changes_of else None
    began = time.monotonic()
    if changes is not None:
        threads.append(threading.Thread(target=changes.run, args=(stopping,)))
    for thread in threads:
        thread.start()
    try:
        with httpx.Client(base_url=address, timeout=30) as http:
            while (passed_s := time.monotonic() - began) + interval_s <= seconds + 0.5:
                time.sleep(interval_s - passed_s % interval_s)

                def sample() -> None:
                    samples.append(taken(http, watched, time.monotonic() - began))

                if changes is None:
                    sample()
                else:
                    changes.at_rest(sample)
    except (httpx.HTTPError, psutil.Error) as error:
        print(f"the camera does not answer: {error}", file=sys.stderr)
    finally:
        stopping.set()
        for thread in threads:
            thread.join()
        if changes is not None:
            changes.close()
    return samples


def taken(http: httpx.Client, watched: psutil.Process, time_s: float) -> Sample:
    """A sample, which is printed too."""
    status = http.get("api/v1/status").raise_for_status().json()
    latency, troubles = status["latency_ms"], "; ".join(trouble["what"] for trouble in status["degraded"])
    memory = watched.memory_full_info()
    sample = Sample(
        time_s,
        memory.rss / 2**20,
        latency["p50"],
        latency["p95"],
        watched.num_fds(),
        watched.num_threads(),
        memory.pss / 2**20,
    )
    print(
        f"{time_s / 60:5.1f} min  RSS {sample.rss_mib:.0f} PSS {sample.pss_mib:.0f} MiB  files {sample.files}  "
        f"threads {sample.threads}  p50 {sample.p50_ms:.0f} ms  new {status['fps']['new']:.1f}/s  {troubles}",
        file=sys.stderr,
        flush=True,
    )
    return sample


def stop(process: subprocess.Popen[str]) -> int | None:
    """Tell the camera to end; returns its exit code, None if it did not end in time."""
    with spinning() as spun_s:
        before_s = spun_s()
        process.terminate()
        try:
            process.communicate(timeout=WAIT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
        took_s = spun_s() - before_s
    return process.returncode if took_s <= END_S else None


def report(
    samples: Sequence[Sample],
    seconds: float,
    exit_code: int | None,
    changes: RandomChanges | None = None,
    growth_mib: float = GROWTH_MIB,
) -> dict[str, object]:
    """The figures as JSON; `wrong` lists what is not as it must be."""
    warm_up_s = min(WARM_UP_WITH_CHANGES_S, seconds / 3) if changes else min(WARM_UP_S, seconds / 5)
    judged = [sample for sample in samples if sample.time_s > warm_up_s]
    if not judged or samples[-1].time_s < (0.7 if changes else 0.9) * seconds:
        return {"exit_code": exit_code, "wrong": ["the camera ended before its time"]}
    third = max(1, len(judged) // 3)
    first_ms, last_ms = (median(s.p50_ms for s in part) for part in (judged[:third], judged[-third:]))
    rss_mib = {"start": round(judged[0].rss_mib, 1), "end": round(judged[-1].rss_mib, 1)}
    wrong = []
    if changes:
        farthest = max((sample.rss_mib - judged[0].rss_mib for sample in judged), key=abs)
        rss_mib["farthest"] = round(judged[0].rss_mib + farthest, 1)
        if abs(farthest) > growth_mib:
            wrong.append(f"memory differed by {farthest:+.1f} MiB, allowed are {growth_mib:g}")
        wrong += changes.faults
    elif (grown := rss_mib["end"] - rss_mib["start"]) > growth_mib:
        wrong.append(f"memory grew by {grown:.1f} MiB, allowed are {growth_mib:g}")
    counts = {}
    for name, most in (("files", MORE_FILES), ("threads", MORE_THREADS)):
        first, last = (round(median(getattr(s, name) for s in part)) for part in (judged[:third], judged[-third:]))
        counts[name] = {"first_third": first, "last_third": last}
        if last - first > most:
            wrong.append(f"{name} grew by {last - first}, allowed are {most}")
    if last_ms - first_ms > DRIFT_MS and not changes:
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
        "changes": dict(changes.made) if changes else {},
        "latency_p50_ms": {"first_third": round(first_ms, 2), "last_third": round(last_ms, 2)},
        "minutes": [
            {
                "rss_mib": round(minute[-1].rss_mib, 1),
                "pss_mib": round(minute[-1].pss_mib, 1),
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
    parser.add_argument("--changes", type=float, default=0.0, help="random changes a second")
    parser.add_argument("--growth", type=float, default=GROWTH_MIB, help="MiB by which memory may differ")
    parser.add_argument("--seed", type=int, default=1, help="of the changes")
    parser.add_argument("run", nargs="*", help="arguments for relit run, after `--`; a small generated clip if none")
    options = parser.parse_args(arguments)
    if options.seconds < 20:
        parser.error("--seconds must be 20 or more")
    with tempfile.TemporaryDirectory(prefix="relit-soak.") as name:
        folder, chosen, changes = Path(name), options.run, list[RandomChanges]()
        settle_s = min(MOST_SETTLE_S, options.seconds / 50)
        made = write_material(folder)
        if not chosen:
            chosen = ["--source", made.clip, "--subject", made.subject, "--tracker", made.tracker]

        def changes_of(address: str) -> RandomChanges:
            changes.append(RandomChanges(address, made.subject, options.seed, options.changes, settle_s))
            return changes[-1]

        process = start("run", *chosen, "--sink", "null", "--port", 0, folder=folder)
        try:
            every_minute = round(options.seconds / 60) if options.seconds > SAMPLES else MOST_BRIEF_SAMPLES
            samples = (
                watch(process, options.seconds, every_minute, changes_of)
                if options.changes
                else watch(process, options.seconds)
            )
        finally:
            exit_code = stop(process)
    found = report(samples, options.seconds, exit_code, changes[0] if changes else None, options.growth)
    print(json.dumps(found, indent=2))
    return int(bool(found["wrong"]))


if __name__ == "__main__":
    sys.exit(main())
