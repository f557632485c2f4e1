"""`python -m tests.capture_times`: how long it takes until somebody is a subject, and until they are seen relit.

Of `relit capture instant` on the bundled person's clip, of `relit capture desk` on 336 VGA frames of them before a
simulated monitor, and of `relit run --instant` until its first relit picture: the time that passes from the program's
start, and the processor time of it and the processes that it starts. Needs the public models. Prints JSON. Root may
take precedence over what else runs on the machine: `chrt -r 1 python -m tests.capture_times`.
"""

from __future__ import annotations

import json
import os
import resource
import tempfile
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from select import select
from typing import Any

import httpx
import psutil

from relit_camera.app.demo import demo_files
from tests.capture.desk.bundled_person import film_bundled_person
from tests.cli.relit_command import finish, start
from tests.soak import stop

LONGEST_S = 240.0
POLL_S = 0.05


@dataclass(frozen=True)
class Taken:
    """What something took, in seconds.

    Attributes:
        passed_s: that passed.
        processor_s: of processor time, of all threads and processes.
    """

    passed_s: float
    processor_s: float


def capture(*arguments: object, folder: Path) -> Taken:
    """Run `relit capture` with arguments, to write `me.relit` in a folder.

    Raises:
        RuntimeError: it failed.
    """
    began, before = time.monotonic(), _children_s()
    answer = finish("capture", *arguments, "--out", folder / "me.relit", folder=folder, timeout_s=LONGEST_S)
    if answer.code:
        raise RuntimeError(answer.err)
    return Taken(round(time.monotonic() - began, 1), round(_children_s() - before, 1))


def first_relit_picture(folder: Path) -> Taken:
    """Run `relit run --instant` with its data in a folder until it shows the person relit.

    Raises:
        RuntimeError: it does not.
    """
    began = time.monotonic()
    words = ("--source", demo_files.CLIP, "--environment", "sunset", "--sink", "null", "--port", 0, "--no-pull")
    process = start("run", "--instant", *words, folder=folder)
    try:
        assert process.stdout is not None
        says_something, _, _ = select([process.stdout], [], [], LONGEST_S)
        ready = process.stdout.readline() if says_something else ""
        if not ready:
            raise RuntimeError("the camera does not start")
        with httpx.Client(base_url=ready.split()[-1], timeout=30) as http:
            status: dict[str, Any] = {}
            while not _shows_subject(status):
                if time.monotonic() - began > LONGEST_S:
                    raise RuntimeError(f"nobody is shown relit: {status}")
                time.sleep(POLL_S)
                status = http.get("api/v1/status").raise_for_status().json()
            return Taken(round(time.monotonic() - began, 1), round(_processor_s(process.pid), 1))
    finally:
        stop(process)


def _shows_subject(status: Mapping[str, Any]) -> bool:
    return bool(status) and status["subject"] == "instant" and status["state"] == "live" and not status["unlit"]


def _children_s() -> float:
    """Processor time of all processes that were started from here and have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _processor_s(pid: int) -> float:
    """Processor time of a process and of those that it has started."""
    process = psutil.Process(pid)
    ended = process.cpu_times()
    running = []
    for each in (process, *process.children(recursive=True)):
        with suppress(psutil.NoSuchProcess):  # a child that has just ended
            running.append(each.cpu_times())
    return ended.children_user + ended.children_system + sum(each.user + each.system for each in running)


def main() -> None:
    """Measure all, and print it."""
    with tempfile.TemporaryDirectory(prefix="relit-times.") as name:
        folder = Path(name)
        found = {
            "capture instant": capture("instant", demo_files.CLIP, folder=folder),
            "capture desk": capture("desk", "--frames", film_bundled_person(folder / "desk", 10, 4), folder=folder),
            "run --instant": first_relit_picture(folder),
        }
    told: dict[str, object] = {name: asdict(taken) for name, taken in found.items()}
    print(json.dumps({"processors": os.cpu_count(), **told}, indent=1))


if __name__ == "__main__":
    main()
