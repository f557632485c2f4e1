"""Videos that are sent to the running camera and relit: what is kept, told, and every way it can end."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from unittest.mock import Mock

import pytest

from relit_camera.app.demo import demo_files
from relit_camera.app.replay.replay_jobs import ReplayJobs, ReplayLimits, ReplayWriter
from relit_camera.app.replay.replay_worker import write_replay
from relit_camera.base.config.look import Lighting, Look
from relit_camera.base.config.settings import RelitSettings, StorageSettings, TrackerSettings
from relit_camera.base.errors import ConflictError, InputError, NotFoundError
from relit_camera.base.video.video_readers import VideoReader, probe_video
from relit_camera.base.video.video_writer import VideoWriter
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.event_hub import EventHub
from relit_camera.live.status.replay_status import ReplayStage, ReplayStatus
from relit_camera.subject.subject_file import write_subject
from tests.app.replay_writers import VIDEO, refuse_video, write_half_and_wait, write_quickly
from tests.app.subject_builders import captured
from tests.small_camera import WAIT_S, wait_until


class Room:
    """A scene with a subject of a file, a listener, and the jobs under test; its folder outlives it."""

    def __init__(
        self, folder: Path, write: ReplayWriter, settings: RelitSettings | None = None, event_interval_s: float = 0.0
    ) -> None:
        storage = StorageSettings(data_dir=folder)
        self.folder = storage.replays
        self.scenes = SceneController(storage)
        self.scenes.set_unlit_allowed(True)
        self.scenes.set_look(Look(lighting=Lighting(yaw_deg=40, split=0.5)))
        self.scenes.show_subject("file", captured("film"))
        events = EventHub()
        self._listening = events.listen()
        self.events = self._listening.__enter__()
        settings = (settings or RelitSettings()).model_copy(update={"storage": storage})
        limits = ReplayLimits(timeout_s=120.0, event_interval_s=event_interval_s)
        self.settings = settings
        self.jobs = ReplayJobs(self.folder, lambda: self.settings, self.scenes, events, write, limits)

    def send(self, name: str = "talk", data: bytes = VIDEO, meanwhile: Callable[[], object] = lambda: None) -> None:
        """Send a video; `meanwhile` is called before its end."""
        with self.jobs.receive(name, "my talk.mov") as upload:
            upload.path.write_bytes(data)
            meanwhile()

    def end(self, name: str = "talk") -> ReplayStatus:
        wait_until(lambda: not self.jobs.status(name).stage.is_running, 120)
        return self.jobs.status(name)

    def stages(self) -> list[str]:
        """The stages that were told since the last call."""
        told = []
        while not self.events.empty():
            event = self.events.get()
            if event.kind == "replay":
                told.append(str(event.data["stage"]))
        return told

    def files(self) -> set[str]:
        return {path.name for path in self.folder.iterdir()}


Opener = Callable[[ReplayWriter], Room]


@pytest.fixture
def room(tmp_path: Path, forked_workers: None) -> Iterator[Opener]:
    rooms: list[Room] = []

    def make(write: ReplayWriter) -> Room:
        for each in rooms:  # another one is a restart
            each.jobs.close()
        rooms.append(Room(tmp_path, write))
        return rooms[-1]

    yield make
    for each in rooms:
        each.jobs.close()


def test_a_video_is_relit_as_the_scene_says_whole_and_kept(room: Opener) -> None:
    there = room(write_quickly)
    there.send()
    done = there.end()
    path = "/api/v1/replays/talk/video"
    what = "no face was found in 2 of 30 frames; slow: a network is missing"
    assert done == ReplayStatus("talk", ReplayStage.DONE, 1.0, 30, path, what)
    assert there.jobs.video("talk").read_text() == "16 pixels at 40, split 0 by mesh"
    assert there.files() == {"talk.mp4"}
    told = [there.events.get(timeout=WAIT_S).data for _ in range(4)]
    assert [each["stage"] for each in told] == ["receiving", "working", "working", "done"]
    assert (told[2]["progress"], told[2]["frames"]) == (0.5, 15)
    again = room(write_quickly)
    assert again.jobs.all() == [ReplayStatus("talk", ReplayStage.DONE, 1.0, video=path)]
    with pytest.raises(ConflictError, match="there is a replay 'talk'"):
        again.send()


def test_a_stored_subject_is_read_by_the_worker(room: Opener) -> None:
    there = room(write_quickly)
    write_subject(there.scenes.subjects.new_path("ada"), captured("film"))
    there.scenes.choose_stored_subject("ada")
    there.send()
    there.end()
    assert there.jobs.video("talk").read_text().startswith("ada at")


def test_one_at_a_time_and_removed_while_it_runs(room: Opener) -> None:
    there = room(write_half_and_wait)
    there.send()
    wait_until(lambda: there.jobs.status("talk").progress == 0.5)
    with pytest.raises(ConflictError, match="relit already"):
        there.send("other")
    with pytest.raises(ConflictError, match="no video yet"):
        there.jobs.video("talk")
    there.jobs.remove("talk")
    assert there.files() == set()
    assert there.jobs.all() == []
    with pytest.raises(NotFoundError):
        there.jobs.status("talk")


def test_another_replay_that_has_begun_meanwhile_is_not_canceled(room: Opener, monkeypatch: pytest.MonkeyPatch) -> None:
    there = room(write_half_and_wait)
    there.send("other")
    wait_until(lambda: there.jobs.status("other").progress == 0.5)
    monkeypatch.setattr(there.jobs, "status", lambda name: ReplayStatus(name, ReplayStage.WORKING))  # told before
    there.jobs.remove("talk")
    assert [each.stage for each in there.jobs.all()] == [ReplayStage.WORKING]
    there.jobs.remove("other")
    assert there.jobs.all() == []


def test_a_camera_that_ends_leaves_nothing_of_it(room: Opener) -> None:
    there = room(write_half_and_wait)
    there.send()
    wait_until(lambda: there.jobs.status("talk").progress == 0.5)
    there.jobs.close()
    assert there.end().stage is ReplayStage.CANCELED
    assert there.files() == set()
    (there.folder / ".sent").mkdir()
    (there.folder / ".sent" / "video.mp4").write_bytes(VIDEO)  # of one that was killed
    assert room(write_quickly).files() == set()


def test_what_is_refused_is_told_until_it_is_removed_or_another_is_sent(room: Opener) -> None:
    there = room(refuse_video)
    there.send()
    failed = there.end()
    assert (failed.stage, failed.what, failed.cure) == (
        ReplayStage.FAILED,
        "no face was found in 'my talk.mov', which gave half.mp4",
        "look toward the camera",
    )
    assert there.jobs.all() == [failed]
    with pytest.raises(ConflictError, match="it has failed"):
        there.jobs.video("talk")
    assert there.files() == set()
    there.send()
    there.end()
    there.jobs.remove("talk")
    assert there.jobs.all() == []


def test_before_its_end_there_is_no_video(room: Opener) -> None:
    there = room(write_quickly)
    with there.jobs.receive("talk", "my talk.mov") as upload:
        upload.path.write_bytes(VIDEO)
        with pytest.raises(ConflictError, match="no video yet"):
            there.jobs.video("talk")
    with pytest.raises(NotFoundError):
        there.jobs.video("song")


def test_an_upload_that_breaks_off_or_is_removed_is_not_begun(room: Opener) -> None:
    there = room(write_quickly)

    def break_off() -> None:
        raise OSError("the browser is gone")

    with pytest.raises(OSError, match="gone"):
        there.send(meanwhile=break_off)
    assert there.stages() == ["receiving", "canceled"]  # whoever shows it must hear of its end
    remove = threading.Thread(target=there.jobs.remove, args=("talk",))

    def send_while_somebody_removes() -> None:
        with there.jobs.receive("talk", "my talk.mov") as upload:
            upload.path.write_bytes(VIDEO)
            remove.start()
            assert upload.canceled.wait(WAIT_S)
            upload.require_wanted()

    with pytest.raises(ConflictError, match="canceled"):
        send_while_somebody_removes()
    remove.join(WAIT_S)
    assert there.files() == set()
    assert there.jobs.all() == []


def test_the_end_is_told_however_soon_it_comes(tmp_path: Path) -> None:
    there = Room(tmp_path, write_quickly, event_interval_s=3600.0)
    with pytest.raises(OSError, match="gone"), there.jobs.receive("talk", "my talk.mov"):
        raise OSError("the browser is gone")
    assert there.stages() == ["receiving", "canceled"]
    there.jobs.close()


def test_work_that_cannot_begin_leaves_nothing(room: Opener, monkeypatch: pytest.MonkeyPatch) -> None:
    there = room(write_quickly)

    with monkeypatch.context() as patched:
        patched.setattr(threading.Thread, "start", Mock(side_effect=RuntimeError("can't start new thread")))
        with pytest.raises(RuntimeError):
            there.send()
    assert (there.files(), there.jobs.all()) == (set(), [])
    there.send()
    assert there.end().stage is ReplayStage.DONE


def test_another_process_deletes_nothing_and_is_refused(room: Opener, tmp_path: Path) -> None:
    there = room(write_quickly)
    with there.jobs.receive("talk", "my talk.mov") as upload:
        upload.path.write_bytes(VIDEO)
        other = Room(tmp_path, write_quickly)
        assert upload.path.exists()
        with pytest.raises(ConflictError, match="another Relit Camera"):
            other.send("song")
    assert there.end().stage is ReplayStage.DONE
    there.jobs.close()
    other.send("song")
    assert other.end("song").stage is ReplayStage.DONE
    other.jobs.close()


def test_a_tracker_that_was_chosen_since_the_start_is_used(room: Opener) -> None:
    there = room(write_quickly)
    there.settings = there.settings.model_copy(update={"tracker": TrackerSettings(name="openseeface")})
    there.send()
    there.end()
    assert there.jobs.video("talk").read_text().endswith("by openseeface")


def test_nobody_to_relight_names_and_suffixes_are_told_first(room: Opener) -> None:
    there = room(write_quickly)
    with pytest.raises(InputError, match="cannot name a replay"):
        there.send("../x")
    with pytest.raises(InputError, match="no film by its name"), there.jobs.receive("talk", "talk.txt"):
        pass
    there.scenes.choose_stored_subject(None)
    with pytest.raises(ConflictError, match="nobody is shown"):
        there.send()
    assert not there.folder.exists()


@pytest.mark.slow
def test_a_real_video_is_relit(tmp_path: Path) -> None:
    """Half a second of the demonstration's clip, with its recorded track: no network is needed."""
    clip = tmp_path / "clip.mp4"
    with VideoReader(demo_files.CLIP) as live, VideoWriter(clip, (live.info.width, live.info.height), 24.0) as cut:
        for frame in islice(live, 12):
            cut.write(frame.image)
    settings = RelitSettings(tracker=TrackerSettings(name=f"recorded:{demo_files.TRACK}"))
    there = Room(tmp_path, write_replay, settings)
    there.scenes.set_look(Look(lighting=Lighting(environment="party")))
    there.scenes.load_configured_subject(str(demo_files.SUBJECT))
    there.send(data=clip.read_bytes())
    done = there.end()
    assert done.stage is ReplayStage.DONE, done
    assert "no face" not in done.what
    before, after = probe_video(clip), probe_video(there.jobs.video("talk"))
    assert (after.width, after.height, done.frames) == (before.width, before.height, before.frames)
    with VideoReader(clip) as live, VideoReader(there.jobs.video("talk")) as relit:
        first, second = next(iter(live)).image, next(iter(relit)).image
    assert abs(first.astype(float) - second).mean() > 5
