"""A webcam that a kernel makes (vivid), unplugged and plugged in again while a call goes on, and used on demand."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from tests.vm.camera import SIZE, running
from tests.vm.conftest import LONG
from tests.vm.machine import Machine
from tests.vm.readers import LABEL, Call, difference

pytestmark = pytest.mark.timeout(900)

BARS = [
    (255, 255, 255),
    (255, 255, 0),
    (0, 255, 255),
    (0, 255, 0),
    (255, 0, 255),
    (255, 0, 0),
    (0, 0, 255),
    (0, 0, 0),
]
"""vivid's "100% Colorbar", from the left."""
RECOVERY_S = 60.0
CHROMIUM_S = 900.0
"""Until it shows a picture: 100 s beside other work, and at times it has to be started again."""
ENDS_TRACK_S = 10.0
"""Chromium ends a track after so long without a picture."""


@pytest.fixture
def webcam(machine: Machine) -> Iterator[Vivid]:
    """A webcam that can be plugged in under a number, and unplugged."""
    vivid = Vivid(machine)
    vivid.plug(0)
    yield vivid
    vivid.unplug()


class Vivid:
    """The fake webcam."""

    def __init__(self, machine: Machine) -> None:
        self._machine, self._number = machine, 0

    def plug(self, number: int) -> None:
        """Load it as /dev/videoN."""
        self._machine.load(f"vivid n_devs=1 node_types=0x1 num_inputs=1 input_types=0 vid_cap_nr={number}")
        self._machine.run(f"v4l2-ctl -d /dev/video{number} -c test_pattern=1,osd_text_mode=2")
        self._number = number

    def unplug(self) -> None:
        """Have its calls fail and its node go, as an unplugged webcam's do; its module as soon as nobody holds it."""
        # Were its node still there, the camera would try it again and again, and rmmod meet it open each time.
        disconnect = f"v4l2-ctl -d /dev/video{self._number} -c disconnect=1"
        disconnect += "; echo vivid.0 > /sys/bus/platform/drivers/vivid/unbind"
        unload = "while grep -q '^vivid ' /proc/modules; do rmmod vivid 2>/dev/null || sleep 0.2; done"
        self._machine.run(f"{disconnect}; {unload}", timeout_s=RECOVERY_S)

    def is_held(self) -> bool:
        """Whether a program has it open."""
        find = f"ls -l /proc/[0-9]*/fd 2>/dev/null | grep /dev/video{self._number}$"
        return bool(self._machine.run(find, check=False).output)


@LONG
def test_a_call_outlives_an_unplugged_webcam_and_the_webcam_is_held_only_while_somebody_looks(
    machine: Machine, webcam: Vivid, saw: Callable[[str, str], None]
) -> None:
    with running(machine, "webcam", more="--on-demand", state="released") as camera:
        assert not webcam.is_held()
        with Call(machine, "call") as call:
            call.wait_for_frames(1, CHROMIUM_S)
            camera.wait_for("live", RECOVERY_S)
            assert webcam.is_held()
            assert machine.run("rmmod vivid", check=False).status, "a webcam that is held must not go"
            call.wait_for_frames(10)

            webcam.unplug()
            camera.wait_for("waiting", RECOVERY_S)
            call.wait_for_frames(10)
            webcam.plug(3)
            camera.wait_for("live", RECOVERY_S)
            call.wait_for_frames(30)
            found, image = call.stop()
        camera.wait_for("released", RECOVERY_S)
        assert not webcam.is_held()
    rows = call.rows()
    assert found["label"] == LABEL
    assert {row["state"] for row in rows} == {"live"}
    assert {(row["width"], row["height"]) for row in rows} == {SIZE}
    expected = np.repeat(np.array([BARS], np.uint8), SIZE[1], axis=0).repeat(SIZE[0] // len(BARS), axis=1)
    worst = difference(image, expected)
    cameras = ", ".join(f'"{label}"' for label in found["labels"])
    gap_s = max(row["longest_gap_s"] for row in rows)
    saw("Chromium", f"lists {cameras}; {SIZE[0]}x{SIZE[1]}, colours within {worst}")
    what = "webcam unplugged, and back under another number"
    saw("Chromium, in a call", f"{what}: track live throughout, longest gap {gap_s:.1f} s")
    assert worst <= 8
    assert gap_s < ENDS_TRACK_S / 2
