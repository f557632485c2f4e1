"""Stand for a pull of models. In a module of their own, as a worker process has to import little for them."""

from __future__ import annotations

import time

from relit_camera.base.concurrency.worker_process import Progress
from relit_camera.base.errors import DownloadError


def pull_two(tell: Progress) -> None:
    for step in range(1000):
        tell("getting face_mesh", step, 1000)
    tell("face_mesh: stored", 0, None)


def pull_nothing(tell: Progress) -> None:
    raise DownloadError("no host gives face_mesh", "check the network", ("no connection to example.org",))


def pull_for_ever(tell: Progress) -> None:
    tell("getting face_mesh", 1, 2)
    time.sleep(600)
