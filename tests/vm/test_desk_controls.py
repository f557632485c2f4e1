"""The controls of a webcam on a real kernel: found, held while a desk capture films, and as before afterwards.

Two webcams. vivid is the kernel's own; of the controls that are held it has the gain and its automatic. The other is a
USB webcam made of software (`guest/usb_webcam.py`) with automatic exposure and white balance too, whose picture is as
bright as they make it; the kernel's driver of webcams (uvcvideo) drives it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

import pytest

from relit_camera.app.captures.desk.controls_note import NOTE_NAME
from relit_camera.app.captures.desk.desk_filming import FilmingTimings
from tests.vm.camera import ADDRESS, Camera, relit, running
from tests.vm.conftest import AT_LENGTH, NEWEST
from tests.vm.machine import Command, Machine, MachineError, by_user, wait_until
from tests.vm.test_webcam import Vivid

LONGEST_S = 1800.0
pytestmark = [pytest.mark.timeout(LONGEST_S), NEWEST]

SCENE_LIGHT = 1.0
"""Of the USB webcam: its picture's code at an exposure of 0.1 ms."""
STAGE_S = 300.0
UNSEEN = "--sink null"
"""No virtual camera is needed."""
TRIES = 3
NOTE = f"/home/you/.local/share/relit-camera/{NOTE_NAME}"


@dataclass(frozen=True)
class Webcam:
    """A webcam that is plugged in.

    Attributes:
        machine: where it is.
        node: its device.
        by_itself: its automatics are on.
        by_hand: what a person may have set instead, in this order.
        held: for each control the least and the most that it may have while a capture films.
    """

    machine: Machine
    node: str
    by_itself: Mapping[str, int]
    by_hand: Mapping[str, int]
    held: Mapping[str, tuple[float, float]]

    def read(self) -> dict[str, int]:
        """The present values of its controls."""
        told = self.machine.run(f"v4l2-ctl -d {self.node} -C {','.join(self.held)}").output
        lines = [line.partition(": ") for line in told.splitlines()]
        return {name: int(value.split()[0]) for name, _, value in lines}

    def set(self, values: Mapping[str, int]) -> None:
        """Set its controls one after the other, as a person does."""
        for name, value in values.items():
            self.machine.run(f"v4l2-ctl -d {self.node} -c {name}={value}")

    def has(self, values: Mapping[str, int]) -> bool:
        """Whether its controls have these values."""
        return values.items() <= self.read().items()


@pytest.fixture
def vivid(machine: Machine) -> Iterator[Webcam]:
    """The kernel's webcam. Its picture is black at any gain, so the largest is the best."""
    plugged = Vivid(machine)
    plugged.plug(0)
    machine.run("v4l2-ctl -d /dev/video0 -c test_pattern=5")
    held = {"gain_automatic": (0, 0), "gain": (255, 255)}
    yield Webcam(machine, "/dev/video0", {"gain_automatic": 1}, {"gain_automatic": 0, "gain": 137}, held)
    plugged.unplug()


@contextmanager
def plugged_in(machine: Machine, words: str) -> Iterator[str]:
    """Plug the USB webcam in; gives its node."""
    machine.run("modprobe -a vhci_hcd uvcvideo")
    device = machine.start(f"exec python3 /host/guest/usb_webcam.py {words}", LONGEST_S)
    find = "grep -l 'Test Webcam' /sys/class/video4linux/*/name"
    try:
        found = wait_until(lambda: machine.run(find, check=False).output, STAGE_S, "the USB webcam is there")
        machine.run("chgrp video /dev/video* && chmod 660 /dev/video*")
        yield f"/dev/{found.splitlines()[0].split('/')[-2]}"  # the second one gives the times of frames
    finally:
        device.kill()
        device.wait()
        wait_until(lambda: not machine.run(find, check=False).output, STAGE_S, "the USB webcam is gone")


@pytest.fixture
def usb(machine: Machine) -> Iterator[Webcam]:
    """A webcam of the kind that people have, which can be exposed for as long as a frame lasts."""
    manual = {"auto_exposure": 1, "white_balance_automatic": 0}
    by_itself = {"auto_exposure": 3, "white_balance_automatic": 1, "gain": 10}
    by_hand = {**manual, "exposure_time_absolute": 77, "gain": 33, "white_balance_temperature": 3210}
    best = FilmingTimings().bright_code / SCENE_LIGHT
    held: dict[str, tuple[float, float]] = {name: (value, value) for name, value in manual.items()}
    held |= {"gain": (0, 0), "exposure_time_absolute": (0.9 * best, best), "white_balance_temperature": (3210, 5300)}
    with plugged_in(machine, f"{SCENE_LIGHT}") as node:
        yield Webcam(machine, node, by_itself, by_hand, held)


@dataclass(frozen=True)
class Capture:
    """A desk capture with its page, which notes what it sees.

    Attributes:
        camera: that films.
        webcam: that it films with.
        page: the process that is the page.
    """

    camera: Camera
    webcam: Webcam
    page: Command

    def rows(self, stage: str) -> list[dict[str, Any]]:
        """What the page has noted in a stage."""
        found = []
        with suppress(FileNotFoundError):
            for line in (self.webcam.machine.host / "page.jsonl").read_text().splitlines():
                with suppress(json.JSONDecodeError):  # of the last one only a part may be written
                    found.append(json.loads(line))
        return [row for row in found if row["stage"] == stage]

    @property
    def films(self) -> bool:
        """Whether rows of the filming are there, of two patterns at least."""
        return len({row["step"] for row in self.rows("filming")}) >= 2

    @property
    def builds(self) -> bool:
        """Whether all is filmed, and the subject is being made."""
        return bool(self.rows("building"))

    def status(self) -> dict[str, Any]:
        """What the camera says of it."""
        machine = self.webcam.machine
        found: dict[str, Any] = json.loads(machine.run(f"curl -s --max-time 10 {ADDRESS}/captures/desk").output)
        return found

    def end(self) -> dict[str, Any]:
        """Wait for its end, and return its status."""
        running_stages = ("exposing", "filming", "building")
        ended: dict[str, Any] = wait_until(
            lambda: status if (status := self.status())["stage"] not in running_stages else None, 2 * STAGE_S, "it ends"
        )
        return ended


def begin(camera: Camera, webcam: Webcam) -> Capture:
    """Have a capture begin."""
    machine, out = webcam.machine, webcam.machine.host / "page.jsonl"
    out.unlink(missing_ok=True)
    page = f"exec python3 /host/guest/desk_page.py {webcam.node} /host/{out.stem} {','.join(webcam.held)}"
    return Capture(camera, webcam, machine.start(by_user(page)))


def _is_over(capture: Capture, reached: Callable[[Capture], bool]) -> bool:
    return reached(capture) or capture.page.ended


def capture_until(camera: Camera, webcam: Webcam, reached: Callable[[Capture], bool]) -> Capture:
    """Have a capture begin, and wait until it is so far.

    It is begun anew, twice at most, where the emulated machine stands still for longer than a page may be silent.

    Raises:
        MachineError: it fails.
    """
    for _ in range(TRIES):
        capture = begin(camera, webcam)
        wait_until(partial(_is_over, capture, reached), STAGE_S, "it films")
        if reached(capture):
            return capture
    raise MachineError(f"{capture.page.wait().text} {capture.status()}")


def is_noted(machine: Machine) -> bool:
    """Whether there is a note of what must be put back."""
    return not machine.run(f"ls {NOTE}", check=False).status


def require_held(camera: Camera, webcam: Webcam, before: Mapping[str, int]) -> None:
    """Capture until some patterns are filmed, close the page, and look what the controls were meanwhile.

    Args:
        camera: that films.
        webcam: that it films with.
        before: what is set first.

    Raises:
        AssertionError: they were not held at what suits the webcam, or are not as before.
    """
    webcam.set(before)
    capture = capture_until(camera, webcam, lambda capture: capture.films)
    first, *others = [row["controls"] for row in capture.rows("filming")]
    assert is_noted(webcam.machine)
    capture.page.kill()
    ended = capture.end()
    assert all(each == first for each in others), "a value changes while it films"
    for name, (least, most) in webcam.held.items():
        assert least <= first[name] <= most, first
    assert ended["stage"] == "failed"
    assert ended["what"].startswith("the page with the patterns was closed or hidden")
    assert webcam.has(before)
    assert not is_noted(webcam.machine)


def test_those_of_a_usb_webcam_are_found_held_and_put_back(machine: Machine, usb: Webcam) -> None:
    with running(machine, usb.node, more=UNSEEN) as camera:
        require_held(camera, usb, usb.by_itself)


@AT_LENGTH
def test_those_of_vivid_too(machine: Machine, vivid: Webcam) -> None:
    with running(machine, vivid.node, more=UNSEEN) as camera:
        for before in (vivid.by_hand, vivid.by_itself):
            require_held(camera, vivid, before)


@AT_LENGTH
def test_what_was_set_by_hand_is_put_back_too_and_when_the_camera_is_asked_to_end(
    machine: Machine, usb: Webcam
) -> None:
    with running(machine, usb.node, more=UNSEEN) as camera:
        require_held(camera, usb, usb.by_hand)
        capture_until(camera, usb, lambda capture: capture.films)
        assert not usb.has(usb.by_hand)
        assert camera.stop().status == 0
    assert usb.has(usb.by_hand)
    assert not is_noted(machine)


@AT_LENGTH
def test_a_killed_camera_puts_them_back_at_its_next_start_and_a_whole_capture_before_the_subject_is_made(
    machine: Machine, usb: Webcam
) -> None:
    usb.set(usb.by_itself)
    with running(machine, usb.node, more=UNSEEN) as camera:
        capture_until(camera, usb, lambda capture: capture.films)
        camera.kill()
    assert not usb.has(usb.by_itself)
    assert is_noted(machine)
    with running(machine, usb.node, more=UNSEEN) as camera:
        assert usb.has(usb.by_itself)
        assert not is_noted(machine)
        capture = capture_until(camera, usb, lambda capture: capture.builds)
        assert all(usb.by_itself.items() <= row["controls"].items() for row in capture.rows("building"))
        # An emulated machine would take minutes to find that nobody is seen.
        machine.run(f"curl -s -X DELETE {ADDRESS}/captures/desk")
        assert capture.end()["stage"] == "canceled"
        assert not json.loads(machine.run(f"curl -s {ADDRESS}/subjects").output)


@AT_LENGTH
def test_a_webcam_without_controls_and_one_that_another_program_holds_are_told(machine: Machine) -> None:
    with plugged_in(machine, f"{SCENE_LIGHT} plain") as node:
        with running(machine, node, more=UNSEEN) as camera:
            capture = begin(camera, Webcam(machine, node, {}, {}, {}))
            capture.page.wait()
            ended = capture.end()
            what = "the webcam has no controls by which its exposure can be held"
            assert (ended["stage"], ended["what"]) == ("failed", what)
        holder = machine.start(f"exec v4l2-ctl -d {node} --stream-mmap --stream-to=/dev/null", LONGEST_S)
        holds = f"ls -l /proc/[0-9]*/fd 2>/dev/null | grep {node}$"
        try:
            wait_until(lambda: machine.run(holds, check=False).output, STAGE_S, "another program holds the webcam")
            outcome = relit(machine, f"capture instant {node} --out me.relit --no-pull")
        finally:
            holder.kill()
            holder.wait()
    assert outcome.status == 1
    assert outcome.errors == (
        "relit: Test Webcam cannot be opened: another program may be using it; "
        "close the program that uses the camera, or choose another (`relit devices`)\n"
    )
