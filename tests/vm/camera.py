"""The program in the test machine: started, asked, stopped, killed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import cv2
import numpy as np

from tests.vm.machine import GUEST_PROGRAM, Command, Machine, Outcome, by_user, wait_until
from tests.vm.program import environment

SIZE = (320, 180)
"""Small: an emulated machine draws ten such pictures a second with ease."""
FPS = 10
START_S = 240.0
"""Thirteen seconds on an idle machine."""
ADDRESS = "http://127.0.0.1:8470/api/v1"
TRACK = f"{GUEST_PROGRAM}/relit_camera/app/demo/data/track.json"
EXPECTED = ("no-subject", "reduced-quality")
"""What a camera here may say: it has no subject, and shows its source as it is, and an emulated machine is slow."""
NOBODY = "nobody.yaml"
ROOM = "room.hdr"
"""A small environment: an emulated machine takes a quarter of a minute to paint one of the built-in ones."""


class Camera:
    """`relit run` in a machine."""

    def __init__(self, machine: Machine, arguments: str) -> None:
        """Start it with these arguments; of its output the end is kept."""
        self.machine = machine
        limits = f"export RELIT_SOURCE__WIDTH={SIZE[0]} RELIT_SOURCE__HEIGHT={SIZE[1]} RELIT_SOURCE__FPS={FPS} "
        limits += f"RELIT_OUTPUT__FPS={FPS} RELIT_OUTPUT__KEEP_S=900 "  # a start takes minutes on a busy machine
        # With nobody chosen it shows its source as it is, where that is allowed: whoever comes would need networks.
        (machine.host / NOBODY).write_text("subject: null\n")
        limits += f"RELIT_CONFIG=/host/{NOBODY}; "
        self.command = started(machine, f"{limits}exec relit run {arguments}", timeout_s=1800.0)

    def status(self) -> dict[str, Any]:
        """What it says of itself; empty while it does not answer."""
        answer = self.machine.run(f"curl -s --max-time 5 {ADDRESS}/status", check=False).output
        found: dict[str, Any] = json.loads(answer) if answer.startswith("{") else {}
        return found

    def wait_for(self, state: str, within_s: float = START_S) -> dict[str, Any]:
        """Wait until it is in this state, and return its status."""

        def reached() -> dict[str, Any] | None:
            if self.command.ended:
                raise AssertionError(f"the camera ended: {self.command.wait().text}")
            status = self.status()
            return status if status.get("state") == state else None

        found: dict[str, Any] = wait_until(reached, within_s, f"the camera is {state}")
        return found

    def stop(self) -> Outcome:
        """Ask it to end, and wait until it has."""
        self.command.kill("TERM")
        return self.command.wait()

    def kill(self) -> None:
        """`kill -9`."""
        self.command.kill("KILL")
        self.command.wait()


@contextmanager
def running(
    machine: Machine, source: str = "pattern", size: tuple[int, int] = SIZE, more: str = "", state: str = "live"
) -> Iterator[Camera]:
    """Run the camera until the block ends, from when it is in the state."""
    # The last of an option counts, so `more` may name another environment.
    camera = Camera(machine, f"--source {source} --size {size[0]}x{size[1]} {without_models(machine)} --unlit {more}")
    try:
        camera.wait_for(state)
        yield camera
        if not camera.command.ended:
            status = camera.status()
            assert not [trouble for trouble in status["degraded"] if trouble["code"] not in EXPECTED], status
            assert camera.stop().status == 0  # its keeper ends too, which would hold the device for long after a kill
    finally:
        if not camera.command.ended:
            camera.kill()


def without_models(machine: Machine) -> str:
    """Arguments of `relit run` that spare it the public networks, which are not to be had in the machine."""
    cv2.imwrite(str(machine.host / ROOM), np.full((32, 64, 3), 0.5, np.float32))
    return f"--tracker recorded:{TRACK} --environment /host/{ROOM}"


def relit(machine: Machine, arguments: str) -> Outcome:
    """Run a command of the program to its end, whatever that is."""
    return started(machine, f"exec relit {arguments}").wait()


def started(machine: Machine, command: str, timeout_s: float = 600.0) -> Command:
    """Begin a command as a plain user, in whose environment the program is."""
    return machine.start(by_user(environment() + command), timeout_s)
