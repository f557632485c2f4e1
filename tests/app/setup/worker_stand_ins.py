"""What stands in for checks and pulls in a worker process: a module of its own, as there is little to import then."""

from __future__ import annotations

import time

from relit_camera.base.concurrency.worker_process import Progress
from relit_camera.base.errors import DownloadError
from relit_camera.live.status.setup_status import Check


def no_check(values: object) -> tuple[Check, ...]:
    return ()


def pull_two(tell: Progress) -> None:
    for step in range(1000):
        tell("getting face_mesh", step, 1000)
    tell("face_mesh: stored", 0, None)


def pull_nothing(tell: Progress) -> None:
    raise DownloadError("no host gives face_mesh", "check the network", ("no connection to example.org",))


def pull_for_ever(tell: Progress) -> None:
    tell("getting face_mesh", 1, 2)
    time.sleep(600)
