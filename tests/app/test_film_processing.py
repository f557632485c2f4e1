"""A capture from a film beside the running camera: what is kept, told, stored and shown, and every way it can end."""

from __future__ import annotations

import errno
import stat
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from unittest.mock import Mock

import pytest

from relit_camera.app.captures.film.film_coda import STAGE as CODA
from relit_camera.app.captures.film.film_folder import RECORD_NAME
from relit_camera.app.captures.film.film_processing import FilmBuilder, FilmLimits, FilmProcessing
from relit_camera.app.captures.film.film_progress import SHARES, FilmProgress
from relit_camera.app.captures.film.film_worker import DRAWING
from relit_camera.base.config.look import Look, Mode
from relit_camera.base.config.settings import StorageSettings
from relit_camera.base.errors import ConflictError, InputError, NotFoundError, StorageError
from relit_camera.capture.film.pipeline.film_capture import STAGES
from relit_camera.capture.film.pipeline.film_subject import BUILDING
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.event_hub import EventHub
from relit_camera.live.status.film_status import FilmCaptureStatus, FilmOptions, FilmStage
from relit_camera.subject.subject_file import write_subject
from tests.app.film_builders import FILM, build_film, die_of_film, keep_and_wait, refuse_film
from tests.app.subject_builders import captured
from tests.small_camera import WAIT_S, wait_until
from tests.virtual_clock import VirtualClock


class Studio:
    """A scene controller, a listener, and the capture under test; its folder outlives it."""

    def __init__(self, folder: Path, build: FilmBuilder) -> None:
        storage = StorageSettings(data_dir=folder)
        self.folder = storage.film_capture
        self.scenes = SceneController(storage)
        self.scenes.set_look(Look(mode=Mode.PORTRAIT))
        events = EventHub()
        self._listening = events.listen()
        self.events = self._listening.__enter__()
        limits = FilmLimits(timeout_s=120.0, event_interval_s=0.0)
        self.capture = FilmProcessing(self.folder, self.scenes, events, build, limits)

    def send(
        self,
        name: str = "me",
        data: bytes = FILM,
        file: str = "evening.MP4",
        options: FilmOptions | None = None,
        meanwhile: Callable[[], object] = lambda: None,
    ) -> None:
        """Send a film; `meanwhile` is called before its end."""
        with self.capture.receive(name, file, options or FilmOptions()) as upload:
            upload.path.write_bytes(data)
            meanwhile()

    def end(self) -> FilmCaptureStatus:
        wait_until(lambda: not self.capture.status().stage.is_running)
        return self.capture.status()

    def told(self) -> list[FilmStage]:
        """The stages that were told since the last call, each once."""
        stages: list[FilmStage] = []
        while not self.events.empty():
            event = self.events.get()
            if event.kind == "film-capture" and (not stages or stages[-1] != event.data["stage"]):
                stages.append(event.data["stage"])
        return stages

    def files(self) -> set[str]:
        return {path.name for path in self.folder.iterdir()} if self.folder.exists() else set()


Opener = Callable[[FilmBuilder], Studio]


@pytest.fixture
def studio(tmp_path: Path, forked_workers: None) -> Iterator[Opener]:
    studios: list[Studio] = []

    def make(build: FilmBuilder) -> Studio:
        for each in studios:  # another one is a restart
            each.capture.close()
        studios.append(Studio(tmp_path, build))
        return studios[-1]

    yield make
    for each in studios:
        each.capture.close()


@pytest.mark.slow
def test_a_film_becomes_a_subject_that_is_shown_and_the_film_is_deleted(studio: Opener) -> None:
    there = studio(build_film)
    assert there.capture.status() == FilmCaptureStatus()
    there.send(options=FilmOptions(light_distance_cm=70))
    done = there.end()
    assert (done.stage, done.subject, done.film, done.progress) == (FilmStage.DONE, "me", "evening.MP4", 1.0)
    assert {step.state for step in done.stages} == {"done"}
    assert not done.can_resume
    assert done.report is not None
    assert done.report.because == "evening.MP4 at 70 cm"
    assert done.report.pictures == ("/api/v1/captures/film/pictures/studio.jpg",)
    assert there.capture.picture("studio") == b"a picture"
    assert there.told() == ["receiving", "reading", "building", "done"]
    assert (there.scenes.scene.subject_name, there.scenes.scene.look.mode) == ("me", Mode.LIVE)
    assert there.files() == {RECORD_NAME, "pictures"}
    assert stat.S_IMODE(there.folder.stat().st_mode) == 0o700


def test_the_report_is_there_after_a_restart(studio: Opener) -> None:
    there = studio(build_film)
    there.send()
    before = there.end()
    again = studio(build_film).capture.status()
    assert (again.stage, again.report, again.progress) == (FilmStage.DONE, before.report, 1.0)


def test_somebody_who_was_chosen_meanwhile_stays(studio: Opener) -> None:
    there = studio(keep_and_wait)
    there.send()
    wait_until(lambda: there.capture.status().stage is FilmStage.BUILDING)
    there.capture.cancel()
    there.scenes.show_subject("other", captured(None))
    there.capture.resume()
    there.scenes.show_subject("another", captured(None))
    assert there.end().stage is FilmStage.DONE
    assert there.scenes.scene.subject_name == "another"
    assert there.scenes.subjects.names() == ["me"]


def test_a_film_that_is_refused_is_kept_for_other_options(studio: Opener) -> None:
    there = studio(refuse_film)
    there.send()
    failed = there.end()
    assert (failed.stage, failed.what, failed.cure) == (
        FilmStage.FAILED,
        "no flash found in 'evening.MP4' and kept",
        "let a light blink",
    )
    assert failed.can_resume
    assert [step.state for step in failed.stages][:2] == ["running", "waiting"]
    assert there.scenes.subjects.names() == []
    there.capture.resume(FilmOptions(light_distance_cm=80))
    assert there.end().stage is FilmStage.DONE


def test_a_canceled_capture_leaves_no_subject_and_goes_on_where_it_was(studio: Opener) -> None:
    there = studio(keep_and_wait)
    there.send()
    wait_until(lambda: there.capture.status().stage is FilmStage.BUILDING)
    with pytest.raises(ConflictError, match="runs already"):
        there.send()
    canceled = there.capture.cancel()
    assert (canceled.stage, canceled.can_resume) == (FilmStage.CANCELED, True)
    assert there.scenes.subjects.names() == []
    assert list(there.scenes.subjects.folder.iterdir()) == []
    assert there.capture.resume().stage is FilmStage.READING
    assert there.end().stage is FilmStage.DONE


def test_a_camera_that_ends_tells_at_its_next_start_that_it_can_go_on(studio: Opener) -> None:
    there = studio(keep_and_wait)
    there.send()
    wait_until(lambda: there.capture.status().stage is FilmStage.BUILDING)
    there.capture.close()
    later = studio(keep_and_wait)
    waiting = later.capture.status()
    assert (waiting.stage, waiting.subject, waiting.can_resume) == (FilmStage.INTERRUPTED, "me", True)
    later.capture.resume()
    assert later.end().stage is FilmStage.DONE
    assert later.files() == {RECORD_NAME, "pictures"}


def test_an_upload_that_breaks_off_leaves_everything_as_it_was(studio: Opener) -> None:
    there = studio(refuse_film)
    there.send()
    before, files = there.end(), there.files()

    def break_off() -> None:
        assert there.capture.status().stage is FilmStage.RECEIVING
        raise OSError("the browser is gone")

    with pytest.raises(OSError, match="gone"):
        there.send("you", b"half", "other.mov", meanwhile=break_off)
    assert there.capture.status() == before
    assert there.files() == files
    there.capture.resume(FilmOptions(light_distance_cm=80))
    assert there.end().stage is FilmStage.DONE


def test_an_upload_that_is_canceled_is_not_begun(studio: Opener) -> None:
    there = studio(build_film)
    ended: list[FilmCaptureStatus] = []
    cancel = threading.Thread(target=lambda: ended.append(there.capture.cancel(forget=True)))

    def send_while_somebody_cancels() -> None:
        with there.capture.receive("me", "evening.mp4", FilmOptions()) as upload:
            upload.path.write_bytes(FILM)
            cancel.start()
            assert upload.canceled.wait(WAIT_S)
            upload.require_wanted()

    with pytest.raises(ConflictError, match="was canceled"):
        send_while_somebody_cancels()
    cancel.join(WAIT_S)
    assert [each.stage for each in ended] == [FilmStage.IDLE]  # once the upload had ended
    assert there.files() == set()
    assert there.told() == ["receiving", "idle"]


def test_another_film_replaces_the_one_that_is_there(studio: Opener) -> None:
    there = studio(refuse_film)
    there.send(file="first.mov")
    there.end()
    there.send(file="second.mp4")
    assert there.end().film == "second.mp4"
    record = there.capture._files.read()
    assert record is not None
    assert there.files() == {RECORD_NAME, record.film}
    assert record.film.endswith(".mp4")


@pytest.mark.parametrize("build", [refuse_film, build_film])
def test_what_is_kept_can_be_forgotten(studio: Opener, build: FilmBuilder) -> None:
    there = studio(build)
    there.send()
    there.end()
    assert there.capture.cancel(forget=True) == FilmCaptureStatus()
    assert there.files() == set()
    with pytest.raises(ConflictError, match="no film"):
        there.capture.resume()
    with pytest.raises(NotFoundError):
        there.capture.picture("studio")
    assert studio(build).capture.status() == FilmCaptureStatus()


def test_a_worker_that_dies_is_a_failure(studio: Opener) -> None:
    there = studio(die_of_film)
    there.send()
    failed = there.end()
    assert failed.stage is FilmStage.FAILED
    assert "died (exit code 9)" in failed.what
    assert "memory" in failed.cure
    assert failed.can_resume


def test_a_fault_ends_it_as_a_failure(studio: Opener) -> None:
    there = studio(build_film)
    there.send(data=b"another film")
    assert "AssertionError" in there.end().what


def test_names_and_suffixes_are_checked_before_anything_is_written(studio: Opener) -> None:
    there = studio(build_film)
    write_subject(there.scenes.subjects.new_path("olat"), captured("pictures"))
    with pytest.raises(ConflictError, match="captured in a better way"):
        there.send("olat")
    with pytest.raises(InputError, match="cannot name a subject"):
        there.send("../x")
    with pytest.raises(InputError, match="no film by its name"):
        there.send(file="notes.txt")
    assert there.files() == set()
    assert there.capture.status() == FilmCaptureStatus()


@pytest.mark.parametrize("content", [b"", b"{}", b"not JSON", b"[" * 100_000])
def test_a_damaged_record_is_no_reason_not_to_start(studio: Opener, content: bytes) -> None:
    there = studio(refuse_film)
    there.send()
    there.end()
    (there.folder / RECORD_NAME).write_bytes(content)
    again = studio(build_film)
    assert again.capture.status() == FilmCaptureStatus()
    assert again.files() == set()
    again.send()
    assert again.end().stage is FilmStage.DONE


def test_a_record_that_cannot_be_read_now_deletes_nothing(studio: Opener, monkeypatch: pytest.MonkeyPatch) -> None:
    there = studio(refuse_film)
    there.send()
    there.end()
    kept = there.files()
    with monkeypatch.context() as patched:

        def fail(path: Path) -> bytes:
            raise PermissionError(errno.EACCES, "Permission denied")

        patched.setattr(Path, "read_bytes", fail)
        again = studio(build_film)
        assert again.capture.status() == FilmCaptureStatus()
        with pytest.raises(StorageError, match="Permission denied"):
            again.send()
    assert again.files() == kept
    assert studio(refuse_film).capture.status().can_resume


def test_what_a_killed_camera_left_beside_its_record_is_deleted(studio: Opener) -> None:
    there = studio(refuse_film)
    there.send()
    there.end()
    kept = there.files()
    (there.folder / "film-0.mp4").write_bytes(FILM)
    assert studio(build_film).files() == kept
    done = studio(build_film)
    done.send()
    done.end()
    kept = done.files()
    (done.folder / "film-0.mp4").write_bytes(FILM)
    (done.folder / "stage.npz").write_bytes(FILM)
    assert studio(build_film).files() == kept


def test_a_film_that_is_gone_cannot_be_resumed(studio: Opener) -> None:
    there = studio(refuse_film)
    there.send()
    there.end()
    next(there.folder.glob("film-*.mp4")).unlink()
    assert not studio(refuse_film).capture.status().can_resume


def test_a_record_that_cannot_be_written_is_told_and_nothing_begins(
    studio: Opener, monkeypatch: pytest.MonkeyPatch
) -> None:
    there = studio(build_film)

    def full(*_: object) -> None:
        raise StorageError("cannot write capture.json: no space", "free some space")

    monkeypatch.setattr("relit_camera.app.captures.film.film_folder.write_atomic", full)
    with pytest.raises(StorageError):
        there.send()
    assert there.capture.status() == FilmCaptureStatus()
    assert there.files() == set()


def test_a_film_whose_record_cannot_be_written_leaves_the_one_before(
    studio: Opener, monkeypatch: pytest.MonkeyPatch
) -> None:
    there = studio(refuse_film)
    there.send(file="first.mov")
    before, files = there.end(), there.files()

    def full(*_: object) -> None:
        raise StorageError("cannot write capture.json: no space", "free some space")

    with monkeypatch.context() as patched:
        patched.setattr("relit_camera.app.captures.film.film_folder.write_atomic", full)
        with pytest.raises(StorageError):
            there.send("you", b"another film", "second.mp4")
    assert (there.capture.status(), there.files()) == (before, files)
    there.capture.resume(FilmOptions(light_distance_cm=80))
    done = there.end()
    assert (done.stage, done.subject, done.film) == (FilmStage.DONE, "me", "first.mov")


def test_work_that_cannot_begin_is_told_and_can_be_resumed(studio: Opener, monkeypatch: pytest.MonkeyPatch) -> None:
    there = studio(build_film)

    with monkeypatch.context() as patched:
        patched.setattr(threading.Thread, "start", Mock(side_effect=RuntimeError("can't start new thread")))
        with pytest.raises(RuntimeError):
            there.send()
    assert (there.capture.status().stage, there.capture.status().can_resume) == (FilmStage.INTERRUPTED, True)
    assert there.told()[-1] == "interrupted"
    there.capture.resume()
    assert there.end().stage is FilmStage.DONE


def test_another_process_deletes_nothing_and_is_refused(studio: Opener, tmp_path: Path) -> None:
    there = studio(build_film)
    with there.capture.receive("me", "evening.mp4", FilmOptions()) as upload:
        upload.path.write_bytes(FILM)
        other = Studio(tmp_path, build_film)
        assert upload.path.exists()
        with pytest.raises(ConflictError, match="another Relit Camera") as refused:
            other.send("you")
        assert "data folder of its own" in refused.value.cure
        with pytest.raises(ConflictError, match="another Relit Camera"):
            other.capture.cancel(forget=True)
        assert other.capture.status() == FilmCaptureStatus()
    assert there.end().stage is FilmStage.DONE
    there.capture.close()
    other.send("you")  # it has the folder from now on
    assert other.end().stage is FilmStage.DONE
    other.capture.close()


def test_the_report_has_the_new_name_of_its_subject_and_goes_with_it(studio: Opener) -> None:
    there = studio(build_film)
    there.send()
    there.end()
    there.capture.subject_renamed("you", "she")
    assert there.capture.status().subject == "me"
    there.scenes.rename_stored_subject("me", "ada")
    there.capture.subject_renamed("me", "ada")
    assert there.capture.status().subject == "ada"
    again = studio(build_film)
    assert again.capture.status().subject == "ada"
    again.capture.subject_removed("me")
    assert again.capture.picture("studio") == b"a picture"
    again.capture.subject_removed("ada")
    assert (again.capture.status(), again.files()) == (FilmCaptureStatus(), set())


def test_the_report_of_a_subject_that_was_deleted_by_other_means_goes_at_the_next_start(studio: Opener) -> None:
    there = studio(build_film)
    there.send()
    there.end()
    there.scenes.subjects.remove("me")
    again = studio(build_film)
    assert (again.capture.status(), again.files()) == (FilmCaptureStatus(), set())


def test_a_mode_that_was_chosen_meanwhile_stays_though_it_is_the_same_again(studio: Opener) -> None:
    there = studio(keep_and_wait)
    there.send()
    wait_until(lambda: there.capture.status().stage is FilmStage.BUILDING)
    there.capture.cancel()
    there.capture.resume()
    there.scenes.update_look(lambda look: look.model_copy(update={"mode": Mode.LIVE}))
    there.scenes.update_look(lambda look: look.model_copy(update={"mode": Mode.PORTRAIT}))
    assert there.end().stage is FilmStage.DONE
    assert (there.scenes.scene.subject_name, there.scenes.scene.look.mode) == ("me", Mode.PORTRAIT)


def test_the_steps_are_those_that_the_work_tells() -> None:
    assert tuple(SHARES) == (*STAGES, BUILDING, CODA, DRAWING)
    assert sum(SHARES.values()) == pytest.approx(1)


def test_steps_are_timed_and_those_that_were_kept_are_passed_over() -> None:
    clock = VirtualClock()
    progress = FilmProgress(clock)
    assert {step.state for step in progress.steps()} == {"waiting"}
    assert progress.share() == 0
    assert progress.note("Looking for flashes", 0, None)
    clock.sleep(3)
    assert not progress.note("Looking for flashes", 1, 2)
    first = progress.steps()[0]
    assert (first.state, first.seconds) == ("running", 3.0)
    assert progress.share() == pytest.approx(SHARES["Looking for flashes"] / 2)
    assert not progress.note("something else", 0, None)
    assert progress.note("Building the field", 0, None)
    clock.sleep(2)
    states = [step.state for step in progress.steps()]
    assert states == ["done"] * 6 + ["running", "waiting", "waiting"]
    assert progress.is_building
    progress.finish()
    assert [(step.state, step.seconds) for step in progress.steps()][-3:] == [
        ("done", 2.0),
        ("done", 0.0),
        ("done", 0.0),
    ]
    assert progress.share() == 1
