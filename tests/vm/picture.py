"""`python -m tests.vm.picture OUT.jpg`: a screenshot of a call in Chromium, with the demonstration's relit person."""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import cv2

from relit_camera.devices.device_discovery import modprobe_command
from tests.vm.camera import running
from tests.vm.machine import GUEST_PROGRAM, Machine
from tests.vm.program import program_disk
from tests.vm.readers import Call

DATA = f"{GUEST_PROGRAM}/relit_camera/app/demo/data"
SIZE = (640, 360)
QUALITY = 88


def main() -> None:
    """Make the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--environment", default="sunset")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, Machine(program_disk(Path(folder))) as machine:
        machine.load(modprobe_command().removeprefix("sudo modprobe "))
        more = f"--subject {DATA}/adam.relit --environment {given.environment}"
        with running(machine, f"{DATA}/clip.mp4", SIZE, more) as camera:
            camera.wait_for("live")
            shot = Path(folder, "page.png")
            with Call(machine, "call") as call:
                call.wait_for_frames(60)
                found, _ = call.stop(keep=shot)
            print(found, camera.status())
        cv2.imwrite(str(given.out), cv2.imread(str(shot)), [cv2.IMWRITE_JPEG_QUALITY, QUALITY])


if __name__ == "__main__":
    main()
