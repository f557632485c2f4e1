"""A device and PipeWire together: one picture for both, and either is enough."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.config.settings import OutputSettings
from relit_camera.base.errors import DeviceError, ImageError, InputError
from relit_camera.base.images.color import rgb_to_i420
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.devices.on_demand.on_demand_source import DemandWatch
from relit_camera.devices.on_demand.reader_list import all_readers
from relit_camera.devices.sinks import picture_conversion
from relit_camera.devices.sinks.call_app_sink import RETRY_S, CallAppSink, CameraPlace
from relit_camera.devices.sinks.picture_conversion import I420Converter
from relit_camera.devices.sinks.pipewire import pipewire_library
from relit_camera.devices.sinks.pipewire.pipewire_sink import PipeWireSink, session_socket
from relit_camera.devices.sinks.sink import Readers, SinkInfo
from relit_camera.devices.sinks.sink_factory import open_sink
from relit_camera.devices.sources.pattern_source import draw_pattern
from tests.virtual_clock import VirtualClock

SIZE = (320, 180)
NODE = "/dev/video10"


class FakeNode:
    """A camera in a session that exists only here."""

    def __init__(self) -> None:
        self.sent: list[DisplayImage] = []
        self.reading, self.closed, self.ended = Readers(0), False, False

    def send(self, image: DisplayImage) -> None:
        if self.ended:
            raise OSError(32, "Broken pipe")
        self.sent.append(image)

    def readers(self) -> Readers:
        return self.reading

    def close(self) -> None:
        self.closed = True


class FakeSession:
    """Opens cameras, as long as it runs."""

    def __init__(self) -> None:
        self.runs = True
        self.nodes: list[FakeNode] = []

    def __call__(self, size: tuple[int, int], fps: float, label: str) -> FakeNode:
        if not self.runs:
            raise DeviceError("no PipeWire session runs", "start it")
        self.nodes.append(FakeNode())
        return self.nodes[-1]

    def end(self) -> None:
        self.runs = False
        for node in self.nodes:
            node.ended = True


class FakeDevice:
    """A loopback device that works while it is there."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self.closed = False

    def write(self, image: DisplayImage) -> None:
        self._machine.require_device()
        self._machine.written.append(image)

    def describe(self) -> SinkInfo:
        return SinkInfo("camera", NODE, (640, 360))

    def close(self) -> None:
        self.closed = True


class Machine:
    """A machine with a session and a device, either of which may be missing."""

    def __init__(self) -> None:
        self.clock, self.session = VirtualClock(), FakeSession()
        self.has_device = self.device_works = True
        self.written: list[DisplayImage] = []

    def require_device(self) -> None:
        if not self.has_device or not self.device_works:
            raise DeviceError("no device" if not self.has_device else "in use", "sudo modprobe v4l2loopback")

    def open_device(self) -> FakeDevice:
        self.require_device()
        return FakeDevice(self)

    def sink(self) -> CallAppSink:
        places = (
            CameraPlace("device", self.open_device, lambda: self.has_device),
            CameraPlace("PipeWire", lambda: PipeWireSink(SIZE, 30, open_node=self.session), lambda: self.session.runs),
        )
        return CallAppSink(places, SIZE, self.clock)


@pytest.fixture
def machine() -> Machine:
    return Machine()


def test_both_show_the_same_picture(machine: Machine) -> None:
    sink = machine.sink()
    image = draw_pattern(SIZE, 1)
    sink.write(image)
    assert machine.written[0] is machine.session.nodes[0].sent[0] is image
    assert sink.describe().name == f"camera {NODE} and PipeWire"
    assert (sink.describe().id, sink.describe().size) == (NODE, (640, 360))
    sink.close()
    sink.close()
    assert machine.session.nodes[0].closed


def test_either_is_enough(machine: Machine) -> None:
    machine.has_device = False
    sink = machine.sink()
    sink.write(draw_pattern(SIZE, 1))
    assert sink.describe() == SinkInfo("camera", "", SIZE, Readers(0))
    assert sink.describe().name == "camera PipeWire"
    machine.has_device, machine.session.runs = True, False
    sink = machine.sink()
    sink.write(draw_pattern(SIZE, 1))
    assert sink.describe().name == f"camera {NODE}"


def test_neither_is_told_with_both_cures(machine: Machine) -> None:
    machine.has_device = machine.session.runs = False
    with pytest.raises(
        DeviceError, match=r"no device; no PipeWire session runs; sudo modprobe v4l2loopback; or start it"
    ):
        machine.sink()


def test_a_device_that_is_there_and_fails_is_told_alone(machine: Machine) -> None:
    machine.device_works = machine.session.runs = False
    with pytest.raises(DeviceError, match=r"^in use; sudo modprobe v4l2loopback$"):
        machine.sink()


def test_one_that_ends_is_looked_for_each_second_while_the_other_goes_on(machine: Machine) -> None:
    sink = machine.sink()
    machine.session.end()
    for number in range(3):
        sink.write(draw_pattern(SIZE, number))
    assert len(machine.written) == 3
    assert sink.describe().name == f"camera {NODE}"
    assert machine.session.nodes[0].closed
    machine.session.runs = True
    sink.write(draw_pattern(SIZE, 3))
    assert len(machine.session.nodes) == 1  # not yet
    machine.clock.sleep(RETRY_S)
    sink.write(draw_pattern(SIZE, 4))
    assert len(machine.session.nodes[1].sent) == 1
    assert sink.describe().name == f"camera {NODE} and PipeWire"


def test_a_device_that_is_there_and_not_used_is_a_trouble_one_that_is_not_there_is_none(machine: Machine) -> None:
    machine.device_works = False
    sink = machine.sink()
    assert str(sink.describe().trouble) == "in use; sudo modprobe v4l2loopback"
    machine.has_device = False
    machine.clock.sleep(RETRY_S)
    sink.write(draw_pattern(SIZE, 1))
    assert sink.describe().trouble is None


def test_when_all_fail_each_picture_says_so_and_either_ends_it(machine: Machine) -> None:
    sink = machine.sink()
    machine.session.end()
    machine.has_device = False
    for _ in range(2):
        with pytest.raises(DeviceError, match="no device"):
            sink.write(draw_pattern(SIZE, 0))
    machine.session.runs = True
    machine.clock.sleep(RETRY_S)
    sink.write(draw_pattern(SIZE, 1))


def test_wrong_pictures_are_no_trouble_of_a_camera(machine: Machine) -> None:
    machine.has_device = False
    with pytest.raises(ImageError, match="float32"):
        machine.sink().write(np.zeros((180, 320, 3), np.float32))


def test_a_picture_is_converted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[DisplayImage] = []

    def counted(image: DisplayImage) -> object:
        calls.append(image)
        return rgb_to_i420(image)

    monkeypatch.setattr(picture_conversion, "rgb_to_i420", counted)
    convert, image, other = I420Converter(), draw_pattern(SIZE, 1), draw_pattern(SIZE, 2)
    assert convert(image) is convert(image)
    assert (convert(other) == rgb_to_i420(other)).all()
    assert len(calls) == 2


# On demand.


def test_who_reads_through_pipewire_wakes_the_webcam(machine: Machine) -> None:
    machine.has_device = False
    sink = machine.sink()
    demand = DemandWatch(sink)
    assert not demand.wanted()
    machine.session.nodes[0].reading = Readers(1, ("Firefox",))
    assert demand.wanted()
    demand.close()


@pytest.mark.parametrize(
    ("device", "info", "readers"),
    [
        (Readers(2, ("chromium",)), SinkInfo("camera", NODE, SIZE), Readers(2, ("chromium",))),
        (Readers(), SinkInfo("camera", "", SIZE, Readers(1, ("Firefox",))), Readers(1, ("Firefox",))),
        (Readers(1, ("zoom",)), SinkInfo("camera", NODE, SIZE, Readers(1, ("zoom",))), Readers(2, ("zoom",))),
        (Readers(), SinkInfo("camera", NODE, SIZE, Readers(0)), Readers(0)),
        (Readers(), SinkInfo("null", "", SIZE), Readers()),
    ],
)
def test_readers_of_both_are_one_list(device: Readers, info: SinkInfo, readers: Readers) -> None:
    assert all_readers(device, info) == readers


# PipeWire alone.


def test_a_session_that_ends_is_told_and_looked_for_again() -> None:
    session = FakeSession()
    sink = PipeWireSink(SIZE, 30, open_node=session)
    session.end()
    with pytest.raises(DeviceError, match=r"session has ended: Broken pipe; .*systemctl --user start pipewire"):
        sink.write(draw_pattern(SIZE, 0))
    assert sink.describe().pipewire is None
    with pytest.raises(DeviceError, match="no PipeWire session runs"):
        sink.write(draw_pattern(SIZE, 1))
    session.runs = True
    sink.write(draw_pattern(SIZE, 2))
    assert len(session.nodes[1].sent) == 1


def test_pictures_of_another_size_fill_it() -> None:
    session = FakeSession()
    PipeWireSink(SIZE, 30, open_node=session).write(draw_pattern((640, 480), 0))
    assert session.nodes[0].sent[0].shape == (180, 320, 3)


def test_odd_sizes_are_refused() -> None:
    with pytest.raises(InputError, match="321x180"):
        PipeWireSink((321, 180), 30, open_node=FakeSession())


def test_no_session_is_told_with_its_cure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIPEWIRE_RUNTIME_DIR", str(tmp_path))
    with pytest.raises(DeviceError, match=r"there is no .*pipewire-0; log in to a desktop"):
        open_sink(OutputSettings(sink="pipewire"))
    monkeypatch.delenv("PIPEWIRE_RUNTIME_DIR")
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    with pytest.raises(DeviceError, match="XDG_RUNTIME_DIR is not set"):
        open_sink(OutputSettings(sink="pipewire"))


def test_a_missing_library_is_told_with_its_cure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "pipewire-0").touch()
    monkeypatch.setenv("PIPEWIRE_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr(pipewire_library, "LIBRARY", "libpipewire-of-nobody.so.0")
    pipewire_library.load_pipewire.cache_clear()
    with pytest.raises(DeviceError, match=r"library cannot be used: .*nobody.*; install PipeWire"):
        open_sink(OutputSettings(sink="pipewire"))


@pytest.mark.parametrize(
    ("environment", "path"),
    [
        ({"XDG_RUNTIME_DIR": "/run/user/1000"}, "/run/user/1000/pipewire-0"),
        ({"XDG_RUNTIME_DIR": "/run/user/1000", "PIPEWIRE_RUNTIME_DIR": "/run/other"}, "/run/other/pipewire-0"),
        ({"XDG_RUNTIME_DIR": "/run/user/1000", "PIPEWIRE_REMOTE": "mine"}, "/run/user/1000/mine"),
        ({"PIPEWIRE_REMOTE": "/run/theirs"}, "/run/theirs"),
        ({}, None),
    ],
)
def test_where_the_session_is(environment: dict[str, str], path: str | None) -> None:
    assert session_socket(environment) == (None if path is None else Path(path))
