"""`python -m tests.overload -- --source VIDEO --subject FILE`: how the camera gives way to a busy computer.

Three phases: idle, with two processes that take all the time they get, and idle again. For each: latency from capture
to publishing, pictures a second, the quality that the camera chose, and how long a lamp set by REST takes to be seen in
the published picture. After the load: how long until full quality is back. Prints JSON. Run by hand, not in CI.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import httpx
import numpy as np

from tests.cli.relit_command import start
from tests.soak import stop

BUSY_PROCESSES = 2
LAMP_TIMEOUT_S = 10.0
SEEN_CODES = 3.0
"""A lamp counts as seen when the published picture's mean red over blue has changed by so many codes."""
LAMPS = (
    {"environment": None, "lamps": [{"color": [1, 0.2, 0.2]}]},
    {"environment": None, "lamps": [{"color": [0.2, 0.2, 1]}]},
)
POLL_S = 0.05


@dataclass(frozen=True)
class Phase:
    """What was seen in one phase.

    Attributes:
        p50_ms, p95_ms, max_ms: latency of the last 300 frames at its end, from a frame's arrival to its publication.
        pictures_per_s: rendered.
        quality: level at its end; 0 is full.
        lamp_seen_s: from the request that sets a lamp to the first published picture that shows it, the mean of some.
    """

    p50_ms: float
    p95_ms: float
    max_ms: float
    pictures_per_s: float
    quality: int
    lamp_seen_s: float


def _work() -> None:
    while True:
        sum(range(10_000))


@contextmanager
def busy_computer(processes: int) -> Iterator[None]:
    """Keep so many cores busy."""
    workers = [multiprocessing.Process(target=_work, daemon=True) for _ in range(processes)]
    for worker in workers:
        worker.start()
    try:
        yield
    finally:
        for worker in workers:
            worker.terminate()
            worker.join()


def warmth(http: httpx.Client) -> float:
    """Mean red minus mean blue of the published picture, in codes."""
    jpeg = np.frombuffer(http.get("api/v1/snapshot.jpg").raise_for_status().content, np.uint8)
    blue, _, red = cv2.mean(cv2.imdecode(jpeg, cv2.IMREAD_REDUCED_COLOR_8))[:3]
    return red - blue


def lamp_seen_s(http: httpx.Client, lighting: Mapping[str, object]) -> float:
    """Set a light without transition, and wait until the published picture shows it."""
    before, began = warmth(http), time.monotonic()
    http.patch("api/v1/lighting", json={**lighting, "transition_s": 0}).raise_for_status()
    while time.monotonic() - began < LAMP_TIMEOUT_S:
        if abs(warmth(http) - before) > SEEN_CODES:
            break
        time.sleep(POLL_S)
    return time.monotonic() - began


def observe(http: httpx.Client, seconds: float) -> Phase:
    """Let time pass, and say what is seen."""
    until, seen = time.monotonic() + seconds, list[float]()
    while time.monotonic() < until or not seen:
        for lighting in LAMPS:
            seen.append(lamp_seen_s(http, lighting))
            time.sleep(1.0)
    status = http.get("api/v1/status").raise_for_status().json()
    latency = {name: round(value, 1) for name, value in status["latency_ms"].items()}
    return Phase(
        p50_ms=latency["p50"],
        p95_ms=latency["p95"],
        max_ms=latency["max"],
        pictures_per_s=round(status["fps"]["pipeline"], 1),
        quality=status["quality_level"],
        lamp_seen_s=round(float(np.mean(seen)), 2),
    )


def seconds_to_full_quality(http: httpx.Client) -> float:
    """Wait for full quality."""
    began = time.monotonic()
    while http.get("api/v1/status").raise_for_status().json()["quality_level"] and time.monotonic() - began < 60:
        time.sleep(POLL_S)
    return round(time.monotonic() - began, 2)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(prog="python -m tests.overload", description=__doc__)
    parser.add_argument("--seconds", type=float, default=30.0, help="of each phase")
    parser.add_argument("--busy", type=int, default=BUSY_PROCESSES, help="processes that take all the time they get")
    parser.add_argument("run", nargs="+", help="arguments for relit run, after `--`")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="relit-overload.") as name:
        process = start("run", *options.run, "--sink", "null", "--port", 0, folder=Path(name))
        try:
            assert process.stdout is not None
            with httpx.Client(base_url=process.stdout.readline().split()[-1], timeout=30) as http:
                found: dict[str, object] = {"idle": asdict(observe(http, options.seconds))}
                with busy_computer(options.busy):
                    found["busy"] = asdict(observe(http, options.seconds))
                found["full_quality_after_s"] = seconds_to_full_quality(http)
                found["idle_again"] = asdict(observe(http, options.seconds))
        finally:
            stop(process)
    print(json.dumps(found, indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main())
