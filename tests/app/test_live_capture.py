"""Capturing a subject beside the running camera: what is stored, shown and told, and what ends it early."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from relit_camera.app.captures.live_capture import LiveCapture, LiveCaptureTimings, SubjectBuilder
from relit_camera.base.config.look import ANYONE, Look, Mode
from relit_camera.base.config.settings import StorageSettings
from relit_camera.base.errors import ConflictError, InputError, NotFoundError
from relit_camera.base.images.image_types import Frame
from relit_camera.live.frame_recorder import FrameRecorder
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.capture_status import CaptureStage
from relit_camera.live.status.event_hub import EventHub
from relit_camera.subject.subject_file import write_subject
from tests.app.subject_builders import build, captured, refuse, refuse_once, take_long
from tests.app.told_stages import stages_until
from tests.small_camera import WAIT_S, wait_until

TIMINGS = LiveCaptureTimings(frames=3, interval_s=0.0, filming_timeout_s=2.0, building_timeout_s=120.0, retry_s=0.05)


class Studio:
    """A scene controller, a camera that gives frames while `on`, and the capture under test."""

    def __init__(self, folder: Path, build: SubjectBuilder, timings: LiveCaptureTimings | None = None) -> None:
        self.scenes = SceneController(StorageSettings(data_dir=folder))
        self.scenes.set_look(Look(mode=Mode.PORTRAIT))
        self.recorder = FrameRecorder()
        self.on = True
        self.woken = 0
        events = EventHub()
        self._listening = events.listen()
        self.events = self._listening.__enter__()
        self.webcam = threading.Lock()
        self.capture = LiveCapture(
            self.recorder, self.scenes, events, build, self._wake, timings or TIMINGS, webcam=self.webcam
        )
        self._stop = threading.Event()
        self._camera = threading.Thread(target=self._run)
        self._camera.start()

    def _wake(self) -> None:
        self.woken += 1

    def _run(self) -> None:
        index = 0
        while not self._stop.wait(0.01):
            if self.on:
                self.recorder.offer(Frame(np.zeros((4, 4, 3), np.uint8), index, float(index), float(index)))
                index += 1

    def close(self) -> None:
        self.capture.cancel()
        self._stop.set()
        self._camera.join()

    def ended(self) -> bool:
        return self.capture.status().stage not in (CaptureStage.FILMING, CaptureStage.BUILDING)

    def stages(self) -> list[str]:
        """The stages that were told since the last call."""
        told = []
        while not self.events.empty():
            event = self.events.get()
            if event.kind == "capture":
                told.append(str(event.data["stage"]))
        return told

    def stages_until(self, last: str) -> list[str]:
        """The stages that are told since the last call, until `last` is."""
        return stages_until(last, self.events, "capture")


@pytest.fixture
def studio(tmp_path: Path, forked_workers: None) -> Iterator[Callable[[SubjectBuilder], Studio]]:
    studios: list[Studio] = []

    def make(build: SubjectBuilder) -> Studio:
        studios.append(Studio(tmp_path, build))
        return studios[-1]

    yield make
    for each in studios:
        each.close()


def test_a_captured_subject_is_stored_and_shown(studio: Callable[[SubjectBuilder], Studio]) -> None:
    camera = studio(build)
    assert camera.capture.status().stage is CaptureStage.IDLE
    assert camera.capture.start("me").stage is CaptureStage.FILMING
    wait_until(camera.ended)
    status = camera.capture.status()
    assert (status.stage, status.subject) == (CaptureStage.DONE, "me")
    assert "turn toward the window" in status.what
    assert camera.stages_until("done") == ["filming", "building", "done"]
    assert camera.scenes.scene.subject_name == "me"
    assert camera.scenes.scene.look.mode is Mode.LIVE
    assert camera.scenes.subjects.names() == ["me"]
    assert camera.woken > 0


def test_a_subject_that_somebody_chose_meanwhile_stays(studio: Callable[[SubjectBuilder], Studio]) -> None:
    camera = studio(build)
    camera.scenes.subjects.folder.mkdir(parents=True)
    camera.on = False
    camera.capture.start("me")
    camera.scenes.show_subject("other", captured(None))
    camera.on = True
    wait_until(camera.ended)
    assert camera.scenes.scene.subject_name == "other"
    assert camera.scenes.scene.look.mode is Mode.PORTRAIT
    assert camera.scenes.subjects.names() == ["me"]


def test_whoever_hid_meanwhile_stays_hidden(studio: Callable[[SubjectBuilder], Studio]) -> None:
    camera = studio(build)
    camera.scenes.choose_stored_subject(ANYONE)
    camera.on = False
    camera.capture.start("me")
    camera.scenes.choose_stored_subject(None)
    camera.on = True
    wait_until(camera.ended)
    assert camera.scenes.scene.shows_nobody
    assert camera.scenes.subjects.names() == ["me"]


def test_a_mode_that_somebody_chose_meanwhile_stays(studio: Callable[[SubjectBuilder], Studio]) -> None:
    camera = studio(build)
    camera.scenes.update_look(lambda look: look.model_copy(update={"mode": Mode.LIVE}))
    camera.on = False
    camera.capture.start("me")
    camera.scenes.update_look(lambda look: look.model_copy(update={"mode": Mode.PORTRAIT}))
    camera.on = True
    wait_until(camera.ended)
    assert camera.scenes.scene.subject_name == "me"
    assert camera.scenes.scene.look.mode is Mode.PORTRAIT


def test_a_better_subject_that_was_stored_meanwhile_stays(studio: Callable[[SubjectBuilder], Studio]) -> None:
    camera = studio(build)
    camera.on = False
    camera.capture.start("me")
    folder = camera.scenes.subjects.folder
    folder.mkdir(parents=True)
    write_subject(folder / "me.relit", captured("film"))
    camera.on = True
    wait_until(camera.ended)
    status = camera.capture.status()
    assert (status.stage, status.what) == (CaptureStage.FAILED, "subject 'me' was captured in a better way")
    assert camera.scenes.subjects.metadata("me").rung == "film"


def test_a_subject_that_is_stored_but_cannot_be_shown_is_done(
    studio: Callable[[SubjectBuilder], Studio], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse_to_show(*_: object) -> None:
        raise NotFoundError("no background picture 'beach'", "there are: none")

    camera = studio(build)
    monkeypatch.setattr(camera.scenes, "choose_stored_subject", refuse_to_show)
    camera.capture.start("me")
    wait_until(camera.ended)
    status = camera.capture.status()
    assert status.stage is CaptureStage.DONE
    assert "subject 'me' is stored, but cannot be shown: no background picture 'beach'" in status.what
    assert camera.scenes.subjects.names() == ["me"]


def test_a_failure_is_told_with_its_cure_and_stores_nothing(studio: Callable[[SubjectBuilder], Studio]) -> None:
    camera = studio(refuse)
    camera.capture.start("me")
    wait_until(camera.ended)
    status = camera.capture.status()
    assert (status.stage, status.what, status.cure) == (
        CaptureStage.FAILED,
        "no face is in the frames",
        "look at the camera",
    )
    assert camera.scenes.subjects.names() == []
    assert list(camera.scenes.subjects.folder.iterdir()) == []
    assert camera.scenes.scene.subject is None


@pytest.mark.parametrize("other", [".film.unfinished-abcdefgh.relit", ".me.unfinished-abcdefgh.relit"])
def test_a_failure_leaves_what_another_capture_has_finished(
    studio: Callable[[SubjectBuilder], Studio], other: str
) -> None:
    camera = studio(refuse)
    camera.scenes.subjects.folder.mkdir(parents=True)
    finished = camera.scenes.subjects.folder / other
    write_subject(finished, captured("film"))  # by its worker, before the other capture stores it
    camera.capture.start("me")
    wait_until(camera.ended)
    assert camera.capture.status().stage is CaptureStage.FAILED
    assert list(finished.parent.iterdir()) == [finished]


@pytest.mark.slow
def test_a_camera_without_frames_is_a_failure(studio: Callable[[SubjectBuilder], Studio]) -> None:
    camera = studio(build)
    camera.on = False
    camera.capture.start("me")
    wait_until(camera.ended)
    assert camera.capture.status().what == "the webcam gives no frames"


def test_until_it_is_done_it_is_tried_again(studio: Callable[[SubjectBuilder], Studio]) -> None:
    camera = studio(refuse_once)
    camera.capture.start("me", until_done=True)
    wait_until(lambda: camera.capture.status().stage is CaptureStage.DONE)
    assert camera.stages_until("done") == ["filming", "building", "failed", "filming", "building", "done"]


def test_it_is_not_tried_again_once_somebody_chose_another_subject(studio: Callable[[SubjectBuilder], Studio]) -> None:
    camera = studio(refuse_once)
    camera.capture.start("me", until_done=True)
    wait_until(lambda: camera.capture.status().stage is CaptureStage.BUILDING)
    camera.scenes.show_subject("other", captured(None))
    wait_until(lambda: camera.capture.status().stage is CaptureStage.FAILED)
    time.sleep(5 * TIMINGS.retry_s)  # in which it would try again
    assert camera.stages() == ["filming", "building", "failed"]
    assert camera.scenes.scene.subject_name == "other"


def test_a_fault_ends_it_as_a_failure(
    studio: Callable[[SubjectBuilder], Studio], monkeypatch: pytest.MonkeyPatch
) -> None:
    camera = studio(build)
    monkeypatch.setattr(camera.recorder, "record", lambda *_: 1 / 0)
    camera.capture.start("me")
    wait_until(camera.ended)
    assert camera.capture.status().stage is CaptureStage.FAILED
    assert "ZeroDivisionError" in camera.capture.status().what


def test_one_at_a_time_and_canceled(studio: Callable[[SubjectBuilder], Studio]) -> None:
    camera = studio(take_long)
    camera.capture.start("me")
    with pytest.raises(ConflictError, match="a capture runs already"):
        camera.capture.start("me")
    wait_until(lambda: camera.capture.status().stage is CaptureStage.BUILDING)
    folder = camera.scenes.subjects.folder
    wait_until(lambda: any(path.stat().st_size for path in folder.glob("*")))  # the folder comes with the file
    camera.capture.cancel()
    wait_until(camera.ended)
    assert camera.capture.status().stage is CaptureStage.CANCELED
    assert list(folder.iterdir()) == []


def test_a_better_subject_is_not_replaced_but_an_instant_one_is(studio: Callable[[SubjectBuilder], Studio]) -> None:
    camera = studio(build)
    folder = camera.scenes.subjects.folder
    folder.mkdir(parents=True)
    write_subject(folder / "film.relit", captured("film"))
    write_subject(folder / "old.relit", captured(None))
    write_subject(folder / "instant.relit", captured("instant"))
    for name in ("film", "old"):
        with pytest.raises(ConflictError, match="was captured in a better way"):
            camera.capture.start(name)
    with pytest.raises(InputError, match="cannot name a subject"):
        camera.capture.start("../x")
    camera.capture.start("instant")
    wait_until(camera.ended)
    assert camera.capture.status().stage is CaptureStage.DONE


def test_another_capture_that_needs_the_webcam_is_waited_for(studio: Callable[[SubjectBuilder], Studio]) -> None:
    camera = studio(build)
    assert camera.webcam.acquire(blocking=False)
    with pytest.raises(ConflictError, match="another capture runs"):
        camera.capture.start("me")
    camera.webcam.release()
    camera.capture.start("me")
    assert not camera.webcam.acquire(blocking=False)
    wait_until(camera.ended)
    assert camera.webcam.acquire(blocking=False)


def test_attempts_pause_while_another_capture_needs_the_webcam(studio: Callable[[SubjectBuilder], Studio]) -> None:
    camera = studio(refuse)
    camera.capture.start("me", until_done=True)
    wait_until(lambda: camera.capture.status().stage is CaptureStage.FAILED and camera.webcam.acquire(blocking=False))
    camera.stages()
    time.sleep(0.3)  # some pauses
    assert camera.stages() == []
    camera.webcam.release()
    wait_until(lambda: "filming" in camera.stages())


@pytest.mark.slow
def test_who_asks_during_a_pause_while_the_webcam_is_taken_ends_nothing(tmp_path: Path) -> None:
    camera = Studio(tmp_path, refuse, replace(TIMINGS, retry_s=600.0))
    try:
        camera.capture.start("me", until_done=True)
        wait_until(lambda: camera.capture.status().stage is CaptureStage.FAILED)
        assert camera.webcam.acquire(timeout=WAIT_S)
        with pytest.raises(ConflictError, match="another capture runs"):
            camera.capture.start("you")
        assert camera.capture._job.is_running
        camera.webcam.release()
        assert camera.capture.start("you").stage is CaptureStage.FILMING
    finally:
        camera.close()


@pytest.mark.slow
def test_who_asks_during_a_pause_begins_at_once(tmp_path: Path) -> None:
    camera = Studio(tmp_path, refuse, replace(TIMINGS, retry_s=600.0))
    try:
        camera.capture.start("me", until_done=True)
        wait_until(lambda: camera.capture.status().stage is CaptureStage.FAILED)
        assert camera.capture.start("you").stage is CaptureStage.FILMING
        wait_until(camera.ended)
        status = camera.capture.status()
        assert (status.stage, status.subject) == (CaptureStage.FAILED, "you")
    finally:
        camera.close()
