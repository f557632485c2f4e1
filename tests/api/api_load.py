"""`python -m tests.api.api_load --seconds 60`: 50 changes a second from two clients, with two panels open.

It starts `relit demo`, whose tour gives way to the first change, drives it over HTTP, and prints what came of it. A
panel is a listener of events and a viewer of the preview. Exits with 1 where a change was lost.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import numpy as np

FIELDS = ("yaw_deg", "saturation")
"""What each of the two clients turns."""
_READY = re.compile(r"the panel is at (http\S+/)")


@dataclass
class Panel:
    """What one open panel has heard and seen.

    Attributes:
        revisions: of the scenes that it heard of, in order.
        scene: the last one.
        pictures: how many it has got.
    """

    revisions: list[int] = field(default_factory=list)
    scene: dict[str, Any] = field(default_factory=dict)
    pictures: int = 0

    def listen(self, url: str, until: threading.Event) -> None:
        """Take in `scene` events until told to stop."""
        with httpx.stream("GET", f"{url}api/v1/events", timeout=30) as body:
            kind = ""
            for line in body.iter_lines():
                name, _, value = line.partition(": ")
                kind = value if name == "event" else kind
                if name == "data" and kind == "scene":
                    self.scene = json.loads(value)
                    self.revisions.append(self.scene["revision"])
                if until.is_set():
                    return

    def watch(self, url: str, until: threading.Event) -> None:
        """Count the preview's pictures until told to stop."""
        with httpx.stream("GET", f"{url}api/v1/preview.mjpg?width=640&fps=24", timeout=30) as body:
            for part in body.iter_bytes():
                self.pictures += part.count(b"Content-Length: ")
                if until.is_set():
                    return


@dataclass(frozen=True)
class LoadResult:
    """What came of the changes.

    Attributes:
        sent: changes that were answered with 200.
        refused: the others.
        lost: what is wrong with the end: empty if nothing was lost.
        seconds: how long it took.
        answer_ms: 50th and 99th percentile of the time until an answer.
        heard: `scene` events of each panel.
        pictures: of each panel's preview.
        dropped_fraction: of the frames meanwhile.
    """

    sent: int
    refused: int
    lost: list[str]
    seconds: float
    answer_ms: tuple[float, float]
    heard: list[int]
    pictures: list[int]
    dropped_fraction: float


def drive(url: str, seconds: float, rate: float = 50.0, previews: bool = True) -> LoadResult:
    """Change the scene `rate` times a second from two clients, with two panels open."""
    api, stopping, panels = f"{url}api/v1/", threading.Event(), [Panel(), Panel()]
    for panel in panels:
        for follow in (panel.listen, panel.watch) if previews else (panel.listen,):
            threading.Thread(target=follow, args=(url, stopping), daemon=True).start()
    httpx.patch(f"{api}scene", json={"lighting": {"exposure_ev": 0.0}}).raise_for_status()
    time.sleep(0.5)  # the tour, if there is one, has given way
    before, frames = httpx.get(f"{api}scene").json(), httpx.get(f"{api}status").json()["frames"]
    answers: list[list[tuple[float, int, int]]] = [[], []]

    def change(client: int) -> None:
        period, began = len(answers) / rate, time.monotonic()
        with httpx.Client(base_url=api, timeout=30) as http:
            for index in range(round(seconds / period)):
                time.sleep(max(0.0, began + index * period - time.monotonic()))
                sent_at = time.perf_counter()
                answer = http.patch("scene", json={"lighting": {FIELDS[client]: value(index)}})
                took = time.perf_counter() - sent_at
                revision = answer.json().get("revision", 0) if answer.status_code == 200 else 0
                answers[client].append((took, answer.status_code, revision))

    began = time.monotonic()
    threads = [threading.Thread(target=change, args=(client,)) for client in range(len(answers))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    took = time.monotonic() - began
    after, now = httpx.get(f"{api}scene").json(), httpx.get(f"{api}status").json()["frames"]
    give_up = time.monotonic() + 60
    while any(panel.scene.get("revision") != after["revision"] for panel in panels) and time.monotonic() < give_up:
        time.sleep(0.02)
    stopping.set()
    everything = [each for some in answers for each in some]
    sent = sum(status == 200 for _, status, _ in everything)
    composed, dropped = (now[name] - frames[name] for name in ("composed", "dropped"))
    times = np.percentile([1e3 * took for took, _, _ in everything], [50, 99])
    return LoadResult(
        sent,
        len(everything) - sent,
        _lost(before, after, answers, panels),
        took,
        (float(times[0]), float(times[1])),
        [len(panel.revisions) for panel in panels],
        [panel.pictures for panel in panels],
        dropped / max(composed + dropped, 1),
    )


def value(index: int) -> float:
    """The value of a client's change; both fields take it."""
    return round(0.01 * (index % 200), 2)


def _lost(
    before: dict[str, Any], after: dict[str, Any], answers: list[list[tuple[float, int, int]]], panels: list[Panel]
) -> list[str]:
    wrong = []
    revisions = sorted(revision for some in answers for _, _, revision in some)
    if revisions != list(range(before["revision"] + 1, after["revision"] + 1)):
        wrong.append("not every change has a revision of its own")
    for name, some in zip(FIELDS, answers, strict=True):
        if after["lighting"][name] != value(len(some) - 1):
            wrong.append(f"{name} is not what was sent last")
    for index, panel in enumerate(panels):
        if panel.scene != after:
            wrong.append(f"panel {index + 1} does not show the last scene")
        if panel.revisions != sorted(panel.revisions):
            wrong.append(f"panel {index + 1} heard of an older scene after a newer one")
    return wrong


@contextmanager
def running_demo() -> Iterator[str]:
    """`relit demo` without a browser, with a data folder of its own; gives the panel's address."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "RELIT_STORAGE__DATA_DIR": folder}
        command = [str(Path(sys.executable).with_name("relit")), "demo", "--headless", "--port", "0"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as demo:
            try:
                assert demo.stdout is not None
                url = ""
                for line in demo.stdout:
                    found = _READY.search(line)
                    url = found[1] if found else url
                    if line.startswith("First picture"):
                        break
                yield url
            finally:
                demo.send_signal(signal.SIGTERM)


def main() -> None:
    """Drive the demonstration as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=50.0)
    arguments = parser.parse_args()
    with running_demo() as url:
        result = drive(url, arguments.seconds, arguments.rate)
    for name, figure in vars(result).items():
        print(f"{name}: {figure}")
    sys.exit(bool(result.lost or result.refused))


if __name__ == "__main__":
    main()
