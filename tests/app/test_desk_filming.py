"""Filming a desk capture beside the running camera: page, webcam controls, frames, and every way that it can end."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

import numpy as np
import pytest

from relit_camera.app.captures.desk.controls_note import ControlsNote
from relit_camera.app.captures.desk.desk_filming import DeskBuilder, DeskFilming, FilmingTimings
from relit_camera.base.config.look import Look, Mode
from relit_camera.base.config.settings import StorageSettings
from relit_camera.base.errors import ConflictError, DeviceError, InputError
from relit_camera.base.images.image_types import Frame
from relit_camera.capture.desk.desk_session import SessionTimings
from relit_camera.devices.webcam_controls import ControlDevice
from relit_camera.live.frame_recorder import FrameRecorder
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.desk_status import DeskPlace, DeskStage
from relit_camera.live.status.event_hub import EventHub
from relit_camera.subject.subject_file import write_subject
from tests.app.desk_builders import HALF, begin_and_wait, check_and_build, refuse_desk
from tests.app.subject_builders import captured
from tests.devices.test_webcam_controls import FakeWebcam
from tests.small_camera import wait_until

PLACE = DeskPlace(58.5, 34.4, 60, 18)
TIMINGS = FilmingTimings(
    session=SessionTimings(frames_a_step=2, settling_s=0.02, min_step_s=0.03, page_timeout_s=0.5, step_timeout_s=2.0),
    automatic_s=0.1,
    delay_frames=2,
    frame_timeout_s=1.0,
    building_timeout_s=120.0,
)


class Desk:
    """A page, a webcam whose picture is as bright as the screen and its controls make it, and the capture."""

    def __init__(self, folder: Path, build: DeskBuilder) -> None:
        self.scenes = SceneController(StorageSettings(data_dir=folder))
        self.scenes.set_look(Look(mode=Mode.PORTRAIT))
        self.webcam = FakeWebcam()
        self.before = dict(self.webcam.values)
        self.recorder = FrameRecorder()
        self.opening: Callable[[], AbstractContextManager[ControlDevice]] = lambda: nullcontext(self.webcam)
        self.note = ControlsNote(folder, lambda: "fake webcam")
        self.filming = DeskFilming(
            self.recorder,
            self.scenes,
            EventHub(),
            build,
            lambda: self.opening(),
            self.note,
            lambda: 1 / 30,
            timings=TIMINGS,
        )
        self.page_open, self.webcam_on = True, True
        self.closed_after: int | None = None
        self.shows_from = 0.0
        self.screen = 0.0
        self._stop = threading.Event()
        self._threads = [threading.Thread(target=run) for run in (self._page, self._camera)]
        for thread in self._threads:
            thread.start()

    def _page(self) -> None:
        shown = -1
        while not self._stop.wait(0.01):
            if not self.page_open:
                continue
            status = self.filming.page_shows(shown)
            if status.stage.needs_page and time.monotonic() < self.shows_from:
                continue
            if status.stage.needs_page:
                shown, self.screen = status.step, float(np.mean(status.patches))
                if self.closed_after is not None and status.stage is DeskStage.FILMING and shown >= self.closed_after:
                    self.page_open = False
            else:
                shown = -1

    def _camera(self) -> None:
        index = 0
        while not self._stop.wait(0.004):
            if self.webcam_on:
                captured_at = time.monotonic()
                level = min(255.0, 10 + self.screen * self.webcam.brightness())
                picture = np.full((64, 64, 3), int(level), np.uint8)
                self.recorder.offer(Frame(picture, index, captured_at, index / 30))
                index += 1

    def start(self, name: str = "desk") -> None:
        self.filming.start(name, PLACE)

    def end(self) -> DeskStage:
        wait_until(lambda: not self.filming.status().stage.is_running, 60)
        return self.filming.status().stage

    def close(self) -> None:
        self.filming.cancel()
        self._stop.set()
        for thread in self._threads:
            thread.join()


@pytest.fixture
def desk(tmp_path: Path, forked_workers: None) -> Iterator[Callable[[DeskBuilder], Desk]]:
    desks: list[Desk] = []

    def make(build: DeskBuilder) -> Desk:
        desks.append(Desk(tmp_path, build))
        return desks[-1]

    yield make
    for each in desks:
        each.close()


@pytest.mark.slow
def test_a_capture_ends_with_a_stored_subject_and_the_webcam_as_it_was(desk: Callable[[DeskBuilder], Desk]) -> None:
    there = desk(check_and_build)
    there.start()
    assert there.end() is DeskStage.DONE, there.filming.status()
    assert there.filming.status().what == "it was bright"
    assert there.scenes.scene.subject_name == "desk"
    assert there.scenes.scene.look.mode is Mode.LIVE
    assert there.webcam.values == there.before


@pytest.mark.slow
def test_what_the_worker_refuses_is_told_and_nothing_is_stored(desk: Callable[[DeskBuilder], Desk]) -> None:
    there = desk(refuse_desk)
    there.start()
    assert there.end() is DeskStage.FAILED
    status = there.filming.status()
    assert (status.what, status.cure) == ("the person left", "come back")
    assert there.scenes.subjects.names() == []
    assert there.webcam.values == there.before


@pytest.mark.slow
def test_a_canceled_worker_leaves_nothing(desk: Callable[[DeskBuilder], Desk]) -> None:
    """Nor does it replace the subject that is there."""
    there = desk(begin_and_wait)
    write_subject(there.scenes.subjects.new_path("desk"), captured("desk"))
    folder = there.scenes.subjects.folder
    before = (folder / "desk.relit").read_bytes()
    there.start()
    wait_until(lambda: any(path.read_bytes() == HALF for path in folder.glob("*")), 60)
    assert there.filming.cancel().stage is DeskStage.CANCELED
    assert [path.name for path in folder.iterdir()] == ["desk.relit"]
    assert (folder / "desk.relit").read_bytes() == before


@pytest.mark.slow
def test_a_page_that_is_closed_midway_ends_it_and_frees_the_webcam(desk: Callable[[DeskBuilder], Desk]) -> None:
    there = desk(check_and_build)
    there.closed_after = 5
    there.start()
    assert there.end() is DeskStage.FAILED
    assert "page with the patterns was closed" in there.filming.status().what
    assert there.webcam.values == there.before
    assert there.scenes.subjects.names() == []


@pytest.mark.slow
def test_the_exposure_is_found_under_white_however_late_the_page_shows_it(desk: Callable[[DeskBuilder], Desk]) -> None:
    there = desk(check_and_build)
    there.shows_from = time.monotonic() + 0.8
    there.start()
    wait_until(lambda: there.filming.status().stage is DeskStage.FILMING, 30)
    assert 0.8 * TIMINGS.bright_code < 10 + there.webcam.brightness() <= TIMINGS.bright_code + 5


def test_it_can_be_canceled_while_it_films(desk: Callable[[DeskBuilder], Desk]) -> None:
    there = desk(check_and_build)
    there.start()
    wait_until(lambda: there.filming.status().stage is DeskStage.FILMING, 30)
    assert there.webcam.values != there.before
    assert there.note.path.exists()
    with pytest.raises(ConflictError, match="runs already"):
        there.start()
    assert there.filming.cancel().stage is DeskStage.CANCELED
    assert there.webcam.values == there.before
    assert not there.note.path.exists()


@pytest.mark.slow
def test_a_webcam_that_gives_no_frames_is_told(desk: Callable[[DeskBuilder], Desk]) -> None:
    there = desk(check_and_build)
    there.webcam_on = False
    there.start()
    assert there.end() is DeskStage.FAILED
    assert "gives no frames" in there.filming.status().what


def test_a_source_without_controls_is_told(desk: Callable[[DeskBuilder], Desk]) -> None:
    there = desk(check_and_build)

    def refuse() -> AbstractContextManager[ControlDevice]:
        raise DeviceError("there is no webcam 'film.mp4'", "choose another source")

    there.opening = refuse
    there.start()
    assert there.end() is DeskStage.FAILED
    assert there.filming.status().cure == "choose another source"


def test_a_better_subject_is_not_replaced_and_sizes_are_checked(desk: Callable[[DeskBuilder], Desk]) -> None:
    there = desk(check_and_build)
    write_subject(there.scenes.subjects.new_path("film"), captured("film"))
    with pytest.raises(ConflictError, match="captured in a better way"):
        there.start("film")
    with pytest.raises(InputError, match="distance_cm"):
        there.filming.start("desk", DeskPlace(58.5, 34.4, 600, 18))
    assert there.filming.status().stage is DeskStage.IDLE
