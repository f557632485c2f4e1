"""The note of a webcam's controls: a camera that was killed while it held them puts them back at its next start."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path

import pytest

from relit_camera.app.captures.desk.controls_note import NOTE_NAME, ControlsNote, restore_noted_controls
from relit_camera.base.errors import DeviceError
from relit_camera.devices.webcam_controls import EXPOSURE_MODE, ControlDevice, hold_controls
from tests.devices.test_webcam_controls import FakeWebcam
from tests.small_camera import wait_until


def opener(webcam: FakeWebcam) -> Callable[[str], AbstractContextManager[ControlDevice]]:
    def open_webcam(name: str) -> AbstractContextManager[ControlDevice]:
        assert name == "my webcam"
        return nullcontext(webcam)

    return open_webcam


def hold_and_wait(folder: Path) -> None:
    """Hold the controls of a webcam until this process is killed."""
    note = ControlsNote(folder, lambda: "my webcam")
    with note.until_restored() as keep, hold_controls(FakeWebcam(), keep):
        (folder / "held").touch()
        signal.pause()


@pytest.mark.slow
def test_a_camera_that_was_killed_leaves_a_note_that_puts_the_controls_back(tmp_path: Path) -> None:
    code = (
        f"from pathlib import Path; from tests.app.test_controls_note import *; hold_and_wait(Path({str(tmp_path)!r}))"
    )
    with subprocess.Popen([sys.executable, "-c", code]) as camera:
        wait_until(lambda: (tmp_path / "held").exists() or camera.poll() is not None)
        held = FakeWebcam()
        found = dict(held.values)
        held.values[EXPOSURE_MODE] = 1  # as that process has left it
        assert not restore_noted_controls(tmp_path, opener(held))  # it still holds them
        assert held.values != found
        camera.kill()
    assert restore_noted_controls(tmp_path, opener(held))
    assert held.values == found
    assert not (tmp_path / NOTE_NAME).exists()
    assert not restore_noted_controls(tmp_path, opener(held))


def test_nothing_is_left_where_the_controls_were_put_back(tmp_path: Path) -> None:
    note = ControlsNote(tmp_path, lambda: "my webcam")
    with note.until_restored() as keep, hold_controls(FakeWebcam(), keep):
        assert note.path.exists()
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def dead(tmp_path: Path) -> Path:
    """A note that a process has left which is not there any more."""
    text = f'{{"webcam":"my webcam","process":{os.getpid()},"began_at":1.5,"values":{{"{EXPOSURE_MODE}":3}}}}'
    path = tmp_path / NOTE_NAME
    path.write_text(text)
    return path


def test_a_webcam_that_is_not_plugged_in_is_tried_again_later(dead: Path) -> None:
    @contextmanager
    def missing(name: str) -> Iterator[ControlDevice]:
        raise DeviceError(f"there is no webcam '{name}'")
        yield

    assert not restore_noted_controls(dead.parent, missing)
    assert dead.exists()
    webcam = FakeWebcam()
    webcam.values[EXPOSURE_MODE] = 1
    assert restore_noted_controls(dead.parent, opener(webcam))
    assert webcam.values[EXPOSURE_MODE] == 3


@pytest.mark.parametrize("content", ["", "{}", "no JSON", "[" * 100_000, '{"webcam": 1}'])
def test_a_damaged_note_is_deleted(dead: Path, content: str) -> None:
    dead.write_text(content)
    assert not restore_noted_controls(dead.parent, opener(FakeWebcam()))
    assert not dead.exists()


def test_a_note_that_cannot_be_written_refuses_no_capture(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    webcam = FakeWebcam()
    found = dict(webcam.values)
    note = ControlsNote(tmp_path / "file" / "data", lambda: "my webcam")
    with note.until_restored() as keep, hold_controls(webcam, keep):
        assert webcam.values != found
    assert webcam.values == found
