"""Devices, source, tracker and models of a camera that is made of parts, without threads."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from relit_camera.app.setup import camera_setup
from relit_camera.app.setup.camera_setup import CameraSetup
from relit_camera.app.setup.pipeline_choice import PipelineChoice
from relit_camera.base.config.settings import OutputSettings, RelitSettings, SourceSettings
from relit_camera.base.errors import ConflictError, DeviceError, ModelError, NotFoundError
from relit_camera.devices.device_users import DeviceUser
from relit_camera.devices.sinks.sink import NullSink, SinkInfo
from relit_camera.devices.sources.changeable_source import ChangeableSource
from relit_camera.devices.webcam_formats import FrameSize
from relit_camera.live.status.camera_status import DegradationCode
from relit_camera.live.status.event_hub import EventHub
from relit_camera.live.status.status_board import StatusBoard
from tests.devices.fake_devices import FakeTree
from tests.devices.test_changeable_source import Machine
from tests.small_camera import SteadyTracker, memory_source
from tests.virtual_clock import VirtualClock

SIZES = (FrameSize(1280, 720, (30.0,)), FrameSize(640, 360, (30.0,)))


class PublishingSink(NullSink):
    def describe(self) -> SinkInfo:
        return SinkInfo("camera", self.node, (1280, 720))

    node = ""


class Parts:
    """A set-up of a machine with two webcams and a virtual camera in a folder.

    Attributes:
        replaced: how often another pipeline was asked for, and what makes it.
    """

    def __init__(self, folder: Path, source: str = "one") -> None:
        self.tree = FakeTree(folder)
        self.tree.add_webcam(0, "First", by_id="one")
        self.tree.add_webcam(2, "Second", usb="1-3:1.0", by_id="two")
        self.machine = Machine("one", "two", "pattern", source)
        self.settings = RelitSettings(source=SourceSettings(source=source), matte="none")
        self.source = ChangeableSource(self.settings.source, self.machine.make, clock=self.machine.clock)
        self.sink = PublishingSink((1280, 720))
        self.sink.node = self.tree.add_loopback(10, "Relit Camera")
        self.board = StatusBoard(EventHub())
        self.pipelines = PipelineChoice(self.settings, SteadyTracker())
        self.replaced: list[Callable[[], Any] | None] = []
        self.pipelines.replace_pipeline = self.replaced.append
        self.woken = 0
        self.setup = self.of(self.source)

    def of(self, source: Any) -> CameraSetup:
        def wake() -> None:
            self.woken += 1

        return CameraSetup(
            self.settings,
            source,
            self.sink,
            self.board,
            self.pipelines,
            lambda values: (),
            wake,
            self.tree,
            clock=self.machine.clock,
        )


@pytest.fixture
def parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Parts:
    monkeypatch.setattr(camera_setup, "list_frame_sizes", lambda node: SIZES)
    monkeypatch.setattr(
        camera_setup, "find_device_users", lambda node: [DeviceUser(7, "cheese")] if node.endswith("video2") else []
    )
    return Parts(tmp_path)


def test_devices_are_listed_with_their_users(parts: Parts) -> None:
    parts.source.read(0.1)
    found = parts.setup.devices()
    assert [(each.device, each.name, each.in_use_by, each.is_current) for each in found.webcams] == [
        ("one", "First", (), True),
        ("two", "Second", ("cheese",), False),
    ]
    assert found.webcams[0].sizes == SIZES
    (virtual,) = found.virtual_cameras
    assert (virtual.device, virtual.name, virtual.is_current) == (parts.sink.node, "Relit Camera", True)


def test_another_webcam_is_chosen(parts: Parts) -> None:
    parts.source.read(0.1)
    status = parts.setup.change_source(device="two")
    assert (status.device, status.state, status.width) == ("two", "running", 1280)
    assert parts.woken == 1
    assert parts.replaced == []  # the pipeline stays
    assert parts.setup.source() == status


def test_a_node_names_a_webcam_as_well(parts: Parts) -> None:
    parts.source.read(0.1)
    assert parts.setup.change_source(device=str(parts.tree.dev / "video2")).device == "two"


@pytest.mark.parametrize("device", ["three", "/etc/passwd", "clip.mp4", ""])
def test_no_other_file_or_device_can_be_opened(parts: Parts, device: str) -> None:
    with pytest.raises(NotFoundError, match="there are: one, two"):
        parts.setup.change_source(device=device)
    assert parts.source.settings.source == "one"


def test_the_source_of_the_start_and_the_pattern_can_be_chosen_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(camera_setup, "list_frame_sizes", lambda node: SIZES)
    parts = Parts(tmp_path, source="/films/talk.mp4")
    parts.source.read(0.1)
    assert parts.setup.change_source(device="pattern").device == "pattern"
    assert parts.setup.change_source(device="talk.mp4").device == "/films/talk.mp4"


def test_a_smaller_size_makes_smaller_pictures_of_the_output_s_shape(parts: Parts) -> None:
    parts.source.read(0.1)
    parts.setup.change_source(width=640, height=360)
    assert parts.pipelines.size == (640, 360)
    assert parts.replaced == [None]
    parts.setup.change_source(fps=15.0)
    assert parts.source.settings.fps == 15.0
    assert parts.replaced == [None]
    parts.setup.change_source(width=640, height=480)  # of another shape
    assert parts.pipelines.size == (854, 480)
    parts.setup.change_source(width=1920, height=1080)
    assert parts.pipelines.size == (1280, 720)


def test_another_rate_leaves_the_size_of_the_pictures(parts: Parts) -> None:
    parts.pipelines = PipelineChoice(
        parts.settings.model_copy(update={"output": OutputSettings(width=1920, height=1080)}), SteadyTracker()
    )
    parts.pipelines.replace_pipeline = parts.replaced.append
    setup = parts.of(parts.source)
    parts.source.read(0.1)
    setup.change_source(fps=15.0)
    setup.change_source(device="two")
    assert (parts.pipelines.size, parts.replaced) == ((1920, 1080), [])
    setup.change_source(width=1280, height=720)
    assert parts.pipelines.size == (1920, 1080)  # that is the size it has
    setup.change_source(width=640)
    assert parts.pipelines.size == (1280, 720)


def test_a_device_that_fails_is_a_conflict(parts: Parts, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(settings: SourceSettings) -> None:
        raise DeviceError("the webcam is used by another program", "close cheese")

    parts.source.read(0.1)
    monkeypatch.setattr(parts.source, "change", fail)
    with pytest.raises(ConflictError, match="another program; close cheese"):
        parts.setup.change_source(device="two")
    assert parts.setup.settings.source.source == "one"


def test_one_that_is_busy_changes_nothing(parts: Parts) -> None:
    parts.source.read(0.1)
    parts.machine.busy.add("two")
    with pytest.raises(ConflictError):
        parts.setup.change_source(device="two", width=640, height=360)
    assert (parts.setup.source().device, parts.setup.source().width) == ("one", 1280)
    assert parts.pipelines.size == (1280, 720)


def test_a_source_that_cannot_be_changed_says_so(parts: Parts) -> None:
    with pytest.raises(ConflictError, match="cannot be changed while it runs"):
        parts.of(memory_source()).change_source(width=640)


def test_a_missing_webcam_is_told_with_its_cure(parts: Parts) -> None:
    parts.board.report(DegradationCode.SOURCE_FAILED, NotFoundError("there is no webcam", "plug one in"))
    assert (parts.setup.source().what, parts.setup.source().cure) == ("there is no webcam", "plug one in")
    parts.source.read(0.1)  # it runs now
    assert parts.setup.source().what == ""


def test_another_tracker_follows_the_face(parts: Parts, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []

    def make(settings: RelitSettings) -> SteadyTracker:
        opened.append(settings.tracker.name)
        return SteadyTracker()

    monkeypatch.setattr(camera_setup, "make_tracker", make)
    choice = parts.setup.tracker()
    assert choice.name == "mesh"
    assert {"mesh", "openseeface"} <= set(choice.names)
    assert "recorded" not in choice.names
    assert parts.setup.change_tracker("openseeface").name == "openseeface"
    assert parts.setup.change_tracker("openseeface").name == "openseeface"
    assert opened == ["openseeface"]
    assert len(parts.replaced) == 1
    for name in ("recorded:/etc/passwd", "magic"):
        with pytest.raises(NotFoundError):
            parts.setup.change_tracker(name)


def test_a_tracker_without_models_changes_nothing(parts: Parts, monkeypatch: pytest.MonkeyPatch) -> None:
    def make(settings: RelitSettings) -> SteadyTracker:
        raise ModelError("model openseeface is not pulled", "run `relit models pull openseeface`")

    monkeypatch.setattr(camera_setup, "make_tracker", make)
    with pytest.raises(ConflictError, match="relit models pull openseeface"):
        parts.setup.change_tracker("openseeface")
    assert parts.setup.tracker().name == "mesh"
    assert parts.replaced == []


def test_models_that_come_from_anywhere_end_the_wait(parts: Parts, monkeypatch: pytest.MonkeyPatch) -> None:
    missing = ["face_mesh"]
    clock: VirtualClock = parts.machine.clock
    monkeypatch.setattr(camera_setup, "missing_models", lambda tracker, matte="": list(missing))
    monkeypatch.setattr(threading.Thread, "start", lambda thread: None)
    parts.setup.wait_for_models(ModelError("model face_mesh is not pulled", "run `relit models pull face_mesh`"))
    assert parts.setup.models().missing == ("face_mesh",)
    (degradation,) = parts.board.degradations()
    assert (degradation.code, degradation.cure) == (
        DegradationCode.MODELS_MISSING,
        "run `relit models pull face_mesh`",
    )
    clock.at(20.0, missing.clear)
    began = clock.now()
    parts.setup.watch_models()
    assert clock.now() - began == pytest.approx(20.0, abs=1.1)
    assert parts.board.degradations() == []
    assert parts.replaced == [None]


@pytest.mark.parametrize("first", ["watch", "pull"])
def test_models_that_are_pulled_while_they_are_waited_for_begin_the_pipeline_once(
    parts: Parts, monkeypatch: pytest.MonkeyPatch, first: str
) -> None:
    missing = ["face_mesh"]
    monkeypatch.setattr(camera_setup, "missing_models", lambda tracker, matte="": list(missing))
    monkeypatch.setattr(threading.Thread, "start", lambda thread: None)
    parts.setup.wait_for_models(ModelError("model face_mesh is not pulled", "run `relit models pull face_mesh`"))
    parts.setup.pull_models()
    missing.clear()
    both = [parts.setup.watch_models, parts.setup._models_came]  # what the two threads do
    for come in both if first == "watch" else both[::-1]:
        come()
    assert (parts.replaced, parts.board.degradations()) == ([None], [])


def test_a_matte_that_is_pulled_after_the_tracker_is_used_too(parts: Parts, monkeypatch: pytest.MonkeyPatch) -> None:
    missing = ["face_mesh", "selfie"]
    monkeypatch.setattr(
        camera_setup, "missing_models", lambda tracker, matte="": [x for x in missing if matte or x != "selfie"]
    )
    monkeypatch.setattr(threading.Thread, "start", lambda thread: None)
    parts.setup.pull_models()
    missing.remove("face_mesh")
    parts.setup.watch_models()
    missing.remove("selfie")
    parts.setup._models_came()
    assert parts.replaced == [None, None]


def test_closing_ends_the_wait(parts: Parts, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(camera_setup, "missing_models", lambda tracker, matte="": ["face_mesh"])
    parts.machine.clock.at(3.0, parts.setup.close)
    parts.setup.watch_models()
    assert parts.replaced == []
