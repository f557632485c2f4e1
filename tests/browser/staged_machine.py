"""`relit run` on a machine whose devices come and go: what is in a folder stands for its kernel and its cameras.

`python -m tests.browser.staged_machine MACHINE SETTINGS` runs until SIGTERM. The webcam's picture is the bundled clip.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import cv2
import numpy as np

from relit_camera.app.demo import demo_files
from relit_camera.app.run_camera import run_camera
from relit_camera.base.config.settings import OutputSettings, SourceSettings
from relit_camera.base.config.settings_loader import load_settings
from relit_camera.devices.device_discovery import DeviceFolders, find_virtual_camera
from relit_camera.devices.sinks.sink import NullSink, Sink
from relit_camera.devices.sources.source import Source
from relit_camera.devices.sources.webcam_source import WebcamSource
from relit_camera.doctor import host as host_module
from relit_camera.doctor.camera_checks import check_camera
from relit_camera.live.status.setup_status import Check
from tests.doctor.fake_host import RELEASE

MACHINE_VARIABLE = "STAGED_MACHINE"
"""Names the machine's folder to the process in which the checks run."""


class ClipCapture:
    """Stands for `cv2.VideoCapture` of a webcam: gives the clip again and again, as long as its node exists."""

    def __init__(self, node: str) -> None:
        self._node = Path(node)
        self._clip = cv2.VideoCapture(str(demo_files.CLIP))
        self._interval_s = 1 / self._clip.get(cv2.CAP_PROP_FPS)

    def isOpened(self) -> bool:
        return self._node.exists()

    def read(self) -> tuple[bool, np.ndarray | None]:
        """The next picture, BGR, in its time."""
        time.sleep(self._interval_s)
        if not self._node.exists():
            return False, None
        there, picture = self._clip.read()
        if not there:
            self._clip.set(cv2.CAP_PROP_POS_FRAMES, 0)
            there, picture = self._clip.read()
        return there, picture

    def release(self) -> None:
        """Close the clip."""
        self._clip.release()


def tree_of(machine: Path) -> DeviceFolders:
    """The devices of a machine."""
    return DeviceFolders(machine / "sys", machine / "dev")


def source_of(tree: DeviceFolders, settings: SourceSettings, own_label: str) -> Source:
    """The webcam of the settings.

    Raises:
        DeviceError: it is not plugged in.
    """
    return WebcamSource(
        settings.source,
        (settings.width, settings.height),
        settings.fps,
        tree=tree,
        own_label=own_label,
        open_capture=lambda node, size, fps: ClipCapture(node),
    )


def sink_of(tree: DeviceFolders, settings: OutputSettings) -> Sink:
    """Something to publish to, once there is a virtual camera.

    Raises:
        DeviceError: there is none.
    """
    find_virtual_camera(tree, settings.label)
    return NullSink((settings.width, settings.height))


def check_staged(values: Mapping[str, Any]) -> tuple[Check, ...]:
    """The checks of `relit doctor`, of that machine instead of this one."""
    machine = Path(os.environ[MACHINE_VARIABLE])
    staged = host_module.Host(machine, tree_of(machine), RELEASE, True, lambda node: [])
    with patch.object(host_module, "Host", lambda: staged):
        return check_camera(values)


def main() -> None:
    """Run the camera."""
    from tests.browser import staged_machine  # as another process imports it, not as __main__

    machine, settings = Path(sys.argv[1]), Path(sys.argv[2])
    os.environ[MACHINE_VARIABLE] = str(machine)
    tree = tree_of(machine)
    run_camera(
        load_settings(settings),
        source_for=partial(source_of, tree),
        sink_for=partial(sink_of, tree),
        checks=staged_machine.check_staged,
    )


if __name__ == "__main__":
    main()
