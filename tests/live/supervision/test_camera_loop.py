"""The camera loop in virtual time: what is shown and said when the source gives frames, none, or fails."""

from __future__ import annotations

import queue
import threading
from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from relit_camera.base.config.look import ANYONE, Look, Mode
from relit_camera.base.errors import VideoError
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.base.rotations import Rotation
from relit_camera.devices.sinks.sink import NullSink
from relit_camera.devices.sources.source import SourceInfo, SourceState
from relit_camera.face.face_state import FaceStatus
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.filmed_frames import FilmedFrames
from relit_camera.live.frame_recorder import FrameRecorder
from relit_camera.live.pipeline import RenderedFrame
from relit_camera.live.publishing.placeholder_image import Placeholder
from relit_camera.live.publishing.publisher import PublishedPicture, Publisher
from relit_camera.live.publishing.what_is_shown import Shown
from relit_camera.live.scene.scene import Scene
from relit_camera.live.status.camera_status import CameraState, DegradationCode
from relit_camera.live.status.event_hub import Event, EventHub
from relit_camera.live.status.status_board import StatusBoard
from relit_camera.live.supervision.camera_loop import CameraLoop, Placeholders, publish_if_current
from relit_camera.live.supervision.fallback_renderer import FallbackPicture, FallbackRenderer
from relit_camera.live.supervision.pipeline_supervisor import PipelineSupervisor, ShownPicture
from tests.virtual_clock import VirtualClock

SIZE = (8, 6)
FPS = 20.0


def image(value: int) -> DisplayImage:
    return np.full((SIZE[1], SIZE[0], 3), value, np.uint8)


PICTURE, FALLBACK, WAITING, RELEASED, CAPTURING, NOBODY = map(image, range(1, 7))


def showing(picture: DisplayImage) -> Placeholder:
    return Placeholder(lambda: picture)


class FakeSource:
    """Gives a frame each twentieth of a second while its state is `running`; raises `error`."""

    def __init__(self, clock: VirtualClock) -> None:
        self._clock = clock
        self.state, self.reason = SourceState.RUNNING, ""
        self.error: Exception | None = None
        self.index, self.reads = -1, 0

    def read(self, timeout_s: float) -> Frame | None:
        self.reads += 1
        if self.error is not None:
            raise self.error
        if self.state is SourceState.ENDED:
            return None  # at once
        if self.state is not SourceState.RUNNING:
            self._clock.sleep(timeout_s)
            return None
        self._clock.sleep(1 / FPS)
        self.index += 1
        return Frame(image(0), self.index, self._clock.now(), self.index / FPS)

    def describe(self) -> SourceInfo:
        return SourceInfo("pattern", "", SIZE, FPS)

    def close(self) -> None:
        pass


class FakeSupervisor:
    """A pipeline that needs no time. While `fails`, no picture comes; while `late`, its messages do not."""

    def __init__(self, camera: LoopUnderTest) -> None:
        self._camera = camera
        self._shown: list[ShownPicture] = []
        self.fails = self.late = False
        self.face = FaceStatus.FOUND
        self.kind = Shown.RELIT

    def handle_messages(self) -> list[ShownPicture]:
        if self.late:
            return []
        shown, self._shown = self._shown, []
        return shown

    def submit_frame(self, frame: Frame) -> bool:
        camera = self._camera
        camera.board.report(DegradationCode.PICTURE_FAILED, VideoError("x") if self.fails else None)
        if self.fails:
            return False
        rendered = RenderedFrame(PICTURE, replace(MOTION, status=self.face), camera.scene, self.kind)
        if publish_if_current(camera.publisher, lambda: camera.scene, frame, rendered):
            self._shown.append(ShownPicture(frame, rendered, camera.clock.now()))
        return True


class FakeFallback:
    released = forgotten = 0
    unlit = False

    def picture(self, frame: Frame, scene: Scene) -> FallbackPicture:
        return FallbackPicture(FALLBACK, self.unlit)

    def forget(self) -> None:
        self.forgotten += 1

    def release(self, now: float) -> None:
        self.released += 1

    def note_live(self, frame: Frame, rendered: RenderedFrame) -> None:
        self.live = frame.index


NOTHING = np.zeros((0, 3))
MOTION = FaceMotion(
    FaceStatus.FOUND, 1.0, Rotation.identity(), np.zeros(3), NOTHING, np.zeros((0, 2), np.float32), None, None
)


class LoopUnderTest:
    """A camera loop in virtual time. Schedule what happens by `clock.at`, then `run`."""

    def __init__(self) -> None:
        self.clock = VirtualClock()
        self.source, self.fallback, self.supervisor = FakeSource(self.clock), FakeFallback(), FakeSupervisor(self)
        self.scene = Scene(Look(), unlit_allowed=True)
        self.capturing = False
        self.recorder = FrameRecorder(self.clock)
        self.filmed = FilmedFrames(SIZE, self.clock)
        events = EventHub()
        self.board = StatusBoard(events)
        self.publisher = Publisher(NullSink(SIZE), FPS, image(0), clock=self.clock)
        self.loop = CameraLoop(
            self.source,
            cast(PipelineSupervisor, self.supervisor),
            cast(FallbackRenderer, self.fallback),
            self.publisher,
            Placeholders(*map(showing, (WAITING, RELEASED, CAPTURING, NOBODY))),
            lambda: self.scene,
            self.board,
            self.recorder,
            self.filmed,
            lambda: self.capturing,
            clock=self.clock,
        )
        self._listening = events.listen()
        self.queue: queue.Queue[Event] = self._listening.__enter__()

    def run(self, seconds: float) -> None:
        stopping = threading.Event()
        self.clock.at(seconds, stopping.set)
        self.loop.run(stopping)

    def newest(self) -> PublishedPicture:
        found = self.publisher.pictures.newer(0, 0)
        assert found is not None
        return found[1]

    def events(self) -> list[tuple[str, str]]:
        """Kind and first detail of what was said since the last call."""
        said = []
        while not self.queue.empty():
            event = self.queue.get()
            said.append((event.kind, str(next(iter(event.data.values())))))
        return said


@pytest.fixture
def camera() -> LoopUnderTest:
    return LoopUnderTest()


def test_live_frames_are_rendered_and_counted(camera: LoopUnderTest) -> None:
    camera.run(10.0)
    assert camera.events() == [("tracking", "found"), ("state", "live")]
    assert camera.newest().image is PICTURE
    assert camera.loop.camera_rate.rate() == pytest.approx(FPS, rel=0.05)
    assert camera.loop.pipeline_rate.rate() == pytest.approx(FPS, rel=0.05)
    assert camera.fallback.released > 0


def test_frames_that_the_source_dropped_are_counted(camera: LoopUnderTest) -> None:
    camera.clock.at(1.0, lambda: setattr(camera.source, "index", camera.source.index + 7))
    camera.run(2.0)
    assert camera.loop.skipped == 7


def test_without_a_face_it_searches(camera: LoopUnderTest) -> None:
    camera.clock.at(1.0, lambda: setattr(camera.supervisor, "face", FaceStatus.LOST))
    camera.run(2.0)
    assert camera.events()[2:] == [("tracking", "lost"), ("state", "searching")]


def test_whoever_comes_is_relit_where_that_is_chosen(camera: LoopUnderTest) -> None:
    camera.scene = replace(camera.scene, subject_name=ANYONE, unlit_allowed=False)
    camera.run(1.0)
    assert camera.newest().image is PICTURE
    assert camera.board.state is CameraState.LIVE


@pytest.mark.parametrize("mode", list(Mode))
def test_without_a_subject_nothing_is_shown_where_unlit_is_forbidden(camera: LoopUnderTest, mode: Mode) -> None:
    camera.scene = replace(camera.scene, look=Look(mode=mode), unlit_allowed=False)
    camera.run(1.0)
    assert camera.publisher.placeholder is NOBODY
    assert camera.publisher.pictures.newer(0, 0) is None
    assert camera.board.state is CameraState.NO_SUBJECT
    camera.capturing = True
    camera.run(1.0)
    assert camera.publisher.placeholder is CAPTURING
    assert camera.publisher.pictures.newer(0, 0) is None
    assert camera.board.state is CameraState.CAPTURING
    camera.scene = replace(camera.scene, unlit_allowed=True)
    camera.run(1.0)
    assert camera.newest().image is PICTURE
    assert camera.board.state is CameraState.LIVE


def test_a_late_unlit_picture_is_not_shown_once_that_is_forbidden(camera: LoopUnderTest) -> None:
    rendered = RenderedFrame(PICTURE, None, camera.scene, unlit=True)
    forbidden = replace(camera.scene, unlit_allowed=False)
    frame = Frame(image(0), 0, camera.clock.now(), 0.0)
    assert publish_if_current(camera.publisher, lambda: camera.scene, frame, rendered)
    assert camera.newest().unlit
    assert not publish_if_current(camera.publisher, lambda: forbidden, frame, rendered)


def test_a_late_picture_of_a_portrait_that_others_move_is_not_shown_once_that_is_forbidden(
    camera: LoopUnderTest,
) -> None:
    allowed = replace(camera.scene, avatar_allowed=True)
    moved = RenderedFrame(PICTURE, None, allowed, other_person=True)
    hidden = RenderedFrame(PICTURE, None, camera.scene, Shown.PLACEHOLDER, other_person=True)
    frame = Frame(image(0), 0, camera.clock.now(), 0.0)
    assert publish_if_current(camera.publisher, lambda: allowed, frame, moved)
    assert not publish_if_current(camera.publisher, lambda: camera.scene, frame, moved)
    assert publish_if_current(camera.publisher, lambda: camera.scene, frame, replace(moved, other_person=False))
    assert publish_if_current(camera.publisher, lambda: camera.scene, frame, hidden)


def test_the_state_says_where_a_placeholder_is_shown_in_place_of_a_portrait(camera: LoopUnderTest) -> None:
    camera.supervisor.kind = Shown.PLACEHOLDER
    camera.run(1.0)
    assert camera.board.state is CameraState.OTHER_PERSON
    camera.supervisor.kind = Shown.RELIT
    camera.run(1.0)
    assert camera.board.state is CameraState.LIVE


def test_an_unlit_fallback_is_marked(camera: LoopUnderTest) -> None:
    camera.supervisor.fails = camera.fallback.unlit = True
    camera.run(1.0)
    assert camera.newest().unlit


def test_frames_as_filmed_are_kept_while_somebody_asks(camera: LoopUnderTest) -> None:
    camera.run(1.0)
    camera.clock.every(1 / FPS, lambda: camera.loop.step(threading.Event()))
    assert camera.filmed.newer(-1, 1.0) is not None
    last, picture = camera.filmed.newer(0, 1.0) or (0, FALLBACK)
    np.testing.assert_array_equal(picture, image(0))
    camera.clock.sleep(4.0)
    assert camera.filmed.newer(last, 0.0) is None
    following = camera.filmed.newer(last, 1.0)
    assert following is not None
    assert following[0] > last


def test_frames_are_recorded_while_they_are_shown(camera: LoopUnderTest) -> None:
    camera.clock.every(1 / FPS, lambda: camera.loop.step(threading.Event()))
    frames = camera.recorder.record(5, 0.2, 10.0)
    times = np.array([frame.captured_at for frame in frames])
    assert len(frames) == 5
    assert ((np.diff(times) >= 0.2 - 1e-9) & (np.diff(times) < 0.3)).all()
    assert camera.newest().image is PICTURE


def test_while_the_pipeline_fails_the_fallback_is_shown(camera: LoopUnderTest) -> None:
    camera.clock.at(1.0, lambda: setattr(camera.supervisor, "fails", True))
    camera.run(2.0)
    assert camera.newest().image is FALLBACK
    assert camera.board.state is CameraState.FALLBACK
    camera.supervisor.fails = False
    camera.run(2.0)
    assert camera.newest().image is PICTURE
    assert camera.board.state is CameraState.LIVE
    kinds = ("tracking", "state", "degraded", "state", "recovered", "state")
    assert tuple(kind for kind, _ in camera.events()) == kinds


def test_a_late_picture_of_a_frame_before_the_failure_is_no_recovery(camera: LoopUnderTest) -> None:
    camera.clock.at(0.9, lambda: setattr(camera.supervisor, "late", True))
    camera.clock.at(1.0, lambda: setattr(camera.supervisor, "fails", True))
    camera.clock.at(1.5, lambda: setattr(camera.supervisor, "late", False))
    camera.run(2.0)
    states = [detail for kind, detail in camera.events() if kind == "state"]
    assert states == ["live", "standing-in"]


def test_a_source_without_frames_is_waited_for_and_says_why(camera: LoopUnderTest) -> None:
    def unplug() -> None:
        camera.source.state, camera.source.reason = SourceState.RECONNECTING, "HD Webcam is unplugged"

    camera.clock.at(1.0, unplug)
    camera.run(5.0)
    assert camera.publisher.placeholder is WAITING
    assert camera.publisher.superseded_index == camera.source.index
    (degradation,) = camera.board.degradations()
    assert (degradation.code, degradation.why) == (DegradationCode.SOURCE_FAILED, "HD Webcam is unplugged")
    assert camera.board.state is CameraState.WAITING
    camera.source.state, camera.source.reason = SourceState.RUNNING, ""
    camera.run(1.0)
    assert camera.board.degradations() == []
    assert camera.board.state is CameraState.LIVE


def test_a_late_picture_does_not_make_a_waiting_camera_live(camera: LoopUnderTest) -> None:
    camera.run(1.0)
    camera.supervisor.late = True
    camera.run(0.2)
    camera.source.state, camera.source.reason = SourceState.RECONNECTING, "HD Webcam is unplugged"
    camera.run(1.0)
    camera.supervisor.late = False
    camera.run(1.0)
    assert [data for kind, data in camera.events() if kind == "state"] == ["live", "waiting"]


def test_a_source_that_has_not_begun_is_starting_until_it_says_why(camera: LoopUnderTest) -> None:
    camera.source.state = SourceState.OPENING
    camera.run(5.0)
    assert camera.board.state is CameraState.STARTING
    camera.source.reason = "HD Webcam cannot be opened"
    camera.run(1.0)
    assert camera.board.state is CameraState.WAITING


def test_a_source_that_raises_is_read_again_every_second(camera: LoopUnderTest) -> None:
    camera.source.error = VideoError("clip.mp4 is damaged", "copy it again")
    camera.run(60.0)
    assert camera.source.reads == pytest.approx(60, abs=1)
    (degradation,) = camera.board.degradations()
    assert (degradation.code, degradation.cure) == (DegradationCode.SOURCE_FAILED, "copy it again")
    assert camera.events() == [("degraded", "source failed"), ("state", "waiting")]  # once


def test_a_source_that_ended_is_not_read_in_a_busy_loop(camera: LoopUnderTest) -> None:
    camera.clock.at(1.0, lambda: setattr(camera.source, "state", SourceState.ENDED))
    camera.run(61.0)
    assert camera.source.reads == pytest.approx(FPS + 60 / 0.2, abs=5)
    assert camera.board.state is CameraState.WAITING


def test_a_released_source_is_no_failure(camera: LoopUnderTest) -> None:
    camera.clock.at(1.0, lambda: setattr(camera.source, "state", SourceState.RELEASED))
    camera.run(5.0)
    assert camera.board.state is CameraState.RELEASED
    assert camera.board.degradations() == []
    assert camera.publisher.placeholder is RELEASED


def test_a_frozen_scene_renders_nothing_and_holds_the_picture(camera: LoopUnderTest) -> None:
    camera.run(1.0)
    camera.scene = replace(camera.scene, frozen=True)
    count = camera.publisher.pictures.count
    camera.run(10.0)
    assert camera.publisher.hold
    assert camera.publisher.pictures.count == count
    camera.scene = replace(camera.scene, frozen=False)
    camera.run(1.0)
    assert not camera.publisher.hold
    assert camera.publisher.pictures.count > count


def test_nothing_follows_stopping(camera: LoopUnderTest) -> None:
    camera.board.set_state(CameraState.STOPPING)
    camera.run(1.0)
    assert camera.board.state is CameraState.STOPPING
    assert [data for kind, data in camera.events() if kind == "state"] == ["stopping"]


@pytest.mark.parametrize(
    "changed",
    [
        {"frozen": True},
        {"subject": object()},
        {"subject_name": ANYONE},
        {"look": Look(mode=Mode.PORTRAIT)},
        {"revision": 9},
    ],
)
def test_a_late_picture_of_another_subject_or_mode_is_not_published(
    camera: LoopUnderTest, changed: dict[str, object]
) -> None:
    frame = Frame(image(0), 5, camera.clock.now(), 0.0)
    rendered = RenderedFrame(PICTURE, None, camera.scene)
    now = replace(camera.scene, **changed)  # type: ignore[arg-type]
    shown = publish_if_current(camera.publisher, lambda: now, frame, rendered)
    assert shown is ("revision" in changed)
    assert camera.publisher.pictures.count == int(shown)
