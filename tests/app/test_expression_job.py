"""Expression stills beside the running camera: what is stored, shown, told and left behind, however it ends."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import cast

import pytest

from relit_camera.app.captures.expressions.expression_job import (
    ExpressionJob,
    ExpressionLimits,
    FilmedBuilder,
    VideoBuilder,
)
from relit_camera.app.captures.expressions.guided_filming import FilmedStills, FilmingState, GuidedFilming
from relit_camera.base.config.look import Look, Mode
from relit_camera.base.config.settings import StorageSettings
from relit_camera.base.errors import CaptureError, ConflictError, InputError, NotFoundError
from relit_camera.base.storage.upload import Upload
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.event_hub import EventHub
from relit_camera.live.status.expression_status import ExpressionCaptureStatus, ExpressionStage
from relit_camera.subject.subject_file import count_stills, write_subject
from tests.app.still_builders import (
    HALF,
    VIDEO,
    add_of_video,
    add_slowly,
    add_still,
    begin_and_wait,
    refuse_stranger,
    wait_with_video,
)
from tests.app.subject_builders import captured
from tests.app.told_stages import stages_until
from tests.small_camera import wait_until


class ShortFilming(GuidedFilming):
    """Asks for one thing, and goes on when the test says so."""

    def __init__(self) -> None:
        self.go_on = threading.Event()
        self.go_on.set()
        self.error: Exception | None = None

    def film(self, canceled: threading.Event, tell: Callable[[FilmingState], None]) -> FilmedStills:
        tell(FilmingState("wide mouth", "smile", True, ("neutral",), 0.25))
        while not self.go_on.wait(0.01):
            if canceled.is_set():
                raise CaptureError("the capture was canceled", "start it again")
        if self.error is not None:
            raise self.error
        return cast(FilmedStills, "frames")


class Studio:
    """A stored subject `me`, which is shown in mode portrait, and the capture under test."""

    def __init__(self, folder: Path, build: FilmedBuilder, build_of_video: VideoBuilder = add_of_video) -> None:
        self.data = folder
        self.storage = StorageSettings(data_dir=folder)
        self.scenes = SceneController(self.storage)
        self.scenes.set_look(Look(mode=Mode.PORTRAIT))
        self.file = self.scenes.subjects.new_path("me")
        if not self.file.exists():
            write_subject(self.file, captured("desk"))
        self.scenes.choose_stored_subject("me")
        self.first = self.file.read_bytes()
        self.filming = ShortFilming()
        self.webcam = threading.Lock()
        events = EventHub()
        self._listening = events.listen()
        self.events = self._listening.__enter__()
        self.job = ExpressionJob(
            self.storage.expression_capture,
            self.filming,
            self.scenes,
            events,
            build,
            build_of_video,
            ExpressionLimits(event_interval_s=0.0),
            webcam=self.webcam,
        )

    def end(self) -> ExpressionCaptureStatus:
        wait_until(lambda: not self.job.status().stage.is_running)
        return self.job.status()

    def send(
        self,
        data: bytes = VIDEO,
        name: str = "my talk.mov",
        meanwhile: Callable[[Upload], object] = lambda upload: None,
    ) -> None:
        """Send a video; `meanwhile` is called before its end."""
        with self.job.receive(None, name) as upload:
            upload.path.write_bytes(data)
            meanwhile(upload)

    def stages_until(self, last: str) -> list[str]:
        """The stages that are told until `last` is, each once."""
        return list(dict.fromkeys(stages_until(last, self.events, "expression-capture")))

    def is_being_written(self) -> bool:
        """Whether a worker has begun."""
        return len(list(self.file.parent.iterdir())) > 1

    def is_as_before(self) -> bool:
        """Whether the subject is as it was, and nothing else is there."""
        folders = (self.file.parent, self.storage.expression_capture)
        left = [path.name for folder in folders if folder.is_dir() for path in folder.iterdir()]
        return self.file.read_bytes() == self.first and left == ["me.relit"]


Opener = Callable[..., Studio]


@pytest.fixture
def studio(tmp_path: Path, forked_workers: None) -> Iterator[Opener]:
    studios: list[Studio] = []

    def make(build: FilmedBuilder, build_of_video: VideoBuilder = add_of_video) -> Studio:
        for each in studios:  # another one is a restart
            each.job.close()
        studios.append(Studio(tmp_path, build, build_of_video))
        return studios[-1]

    yield make
    for each in studios:
        each.job.close()


@pytest.mark.slow
def test_the_subject_that_is_shown_has_its_stills_at_once_in_the_same_mode(studio: Opener) -> None:
    there = studio(add_still)
    before = there.scenes.scene
    there.filming.go_on.clear()
    begun = there.job.start()
    assert (begun.stage, begun.subject, begun.items[0]) == (ExpressionStage.FILMING, "me", "neutral")
    there.filming.go_on.set()
    done = there.end()
    assert done.stage is ExpressionStage.DONE, done
    assert done.report is not None
    assert (done.report.stills, done.covered, done.prompt) == (1, ("wide mouth",), "")
    assert done.report.file_bytes == there.file.stat().st_size
    assert there.stages_until("done") == ["filming", "building", "done"]
    assert count_stills(there.file) == 1
    now = there.scenes.scene
    assert now.subject is not None
    assert len(now.subject.stills) == 1
    assert (now.subject_name, now.look.mode) == ("me", Mode.PORTRAIT)
    assert now.can_undo == before.can_undo, "more stills are no step to undo"


def test_somebody_else_who_is_shown_stays(studio: Opener) -> None:
    there = studio(add_still)
    there.scenes.show_subject("other", captured("film"))
    there.job.start("me")
    assert there.end().stage is ExpressionStage.DONE
    assert there.scenes.scene.subject_name == "other"
    assert count_stills(there.file) == 1


def test_what_to_do_is_told_while_it_films(studio: Opener) -> None:
    there = studio(add_still)
    there.filming.go_on.clear()
    there.job.start()
    wait_until(lambda: there.job.status().prompt == "wide mouth")
    status = there.job.status()
    assert (status.say, status.face, status.covered, status.progress) == ("smile", True, ("neutral",), 0.25)
    there.filming.go_on.set()
    assert there.end().say == ""


@pytest.mark.parametrize("build", [add_still, begin_and_wait])
def test_a_canceled_capture_leaves_the_subject_as_it_was(studio: Opener, build: FilmedBuilder) -> None:
    there = studio(build)
    if build is add_still:
        there.filming.go_on.clear()
    there.job.start()
    if build is begin_and_wait:
        wait_until(lambda: any(path.read_bytes() == HALF for path in there.file.parent.glob("*")))
    assert there.job.cancel().stage is ExpressionStage.CANCELED
    assert there.is_as_before()
    assert not there.webcam.locked()


def test_another_person_is_refused_in_one_line_and_nothing_is_changed(studio: Opener) -> None:
    there = studio(refuse_stranger)
    shown = there.scenes.scene.subject
    there.job.start()
    failed = there.end()
    assert failed.stage is ExpressionStage.FAILED
    assert (failed.what, failed.cure) == (
        "the face in the webcam's picture is not the subject's",
        "film the person whose subject it is",
    )
    assert there.is_as_before()
    assert there.scenes.scene.subject is shown


def test_what_the_filming_refuses_is_told(studio: Opener) -> None:
    there = studio(add_still)
    there.filming.error = CaptureError("it is too dark in the webcam's picture", "switch a light on")
    there.job.start()
    assert there.end().what == "it is too dark in the webcam's picture"
    assert there.is_as_before()


def test_a_subject_that_is_deleted_meanwhile_stays_deleted(studio: Opener) -> None:
    there = studio(add_slowly)
    there.job.start()
    wait_until(there.is_being_written)
    there.scenes.choose_stored_subject(None)
    there.scenes.subjects.remove("me")
    (there.data / "go").touch()
    assert there.end().what == "subject 'me' was changed or deleted meanwhile"
    assert there.scenes.subjects.names() == []


def test_a_subject_that_was_captured_anew_meanwhile_stays_that(studio: Opener) -> None:
    there = studio(add_slowly)
    there.job.start()
    wait_until(there.is_being_written)
    write_subject(there.file, captured("film"))
    anew = there.file.read_bytes()
    (there.data / "go").touch()
    assert there.end().stage is ExpressionStage.FAILED
    assert there.file.read_bytes() == anew


def test_one_capture_at_a_time_also_of_another_kind(studio: Opener) -> None:
    there = studio(add_still)
    with there.webcam, pytest.raises(ConflictError, match="another capture runs"):
        there.job.start()
    there.filming.go_on.clear()
    there.job.start()
    with pytest.raises(ConflictError, match="being taken already"):
        there.job.start()
    with pytest.raises(ConflictError):
        there.send()
    assert there.webcam.locked()


def test_only_a_stored_subject_gets_stills(studio: Opener, tmp_path: Path) -> None:
    there = studio(add_still)
    with pytest.raises(NotFoundError):
        there.job.start("nobody")
    there.scenes.choose_stored_subject(None)
    with pytest.raises(ConflictError, match="nobody is shown"):
        there.job.start()
    write_subject(tmp_path / "bea.relit", captured("film"))
    there.scenes.load_configured_subject(str(tmp_path / "bea.relit"))
    with pytest.raises(ConflictError, match="command line"):
        there.job.start()
    assert there.job.status() == ExpressionCaptureStatus()


def test_stills_of_a_video_that_is_sent(studio: Opener) -> None:
    there = studio(add_still)
    there.send()
    done = there.end()
    assert (done.stage, done.film, done.progress) == (ExpressionStage.DONE, "my talk.mov", 1.0)
    assert there.stages_until("done") == ["receiving", "building", "done"]
    assert count_stills(there.file) == 1
    assert list(there.storage.expression_capture.iterdir()) == []


def test_a_video_that_gives_none_is_called_by_its_name(studio: Opener) -> None:
    there = studio(add_still)
    there.send(b"another")
    failed = there.end()
    assert (failed.what, failed.cure) == ("no face was found in 'my talk.mov'", "look into the camera")
    assert there.is_as_before()


def test_a_canceled_video_leaves_nothing(studio: Opener) -> None:
    there = studio(add_still, wait_with_video)
    there.send()
    wait_until(lambda: there.job.status().progress == 0.85)
    assert there.job.cancel().stage is ExpressionStage.CANCELED
    assert there.is_as_before()


def test_an_upload_that_breaks_off_leaves_what_was_there(studio: Opener) -> None:
    there = studio(add_still)
    with pytest.raises(ConflictError, match="canceled"):
        there.send(b"half", meanwhile=lambda upload: upload.canceled.set())
    assert there.job.status() == ExpressionCaptureStatus()
    assert there.is_as_before()
    with pytest.raises(InputError, match="no film by its name"):
        there.send(name="talk.txt")


def test_a_video_that_a_killed_camera_has_left_is_deleted(studio: Opener) -> None:
    there = studio(add_still)
    there.send()
    there.end()
    (there.storage.expression_capture / "video.mp4").write_bytes(VIDEO)
    studio(add_still)
    assert list(there.storage.expression_capture.iterdir()) == []


def test_a_second_camera_leaves_the_video_of_the_first_alone(studio: Opener, tmp_path: Path) -> None:
    there = studio(add_still, wait_with_video)
    there.send()
    wait_until(lambda: there.job.status().progress == 0.85)
    second = Studio(tmp_path, add_still)
    assert [path.name for path in there.storage.expression_capture.iterdir()] == ["video.mov"]
    with pytest.raises(ConflictError, match="another Relit Camera"):
        second.send()
    second.job.close()
    there.job.cancel()
