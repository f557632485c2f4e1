"""A source that is missing at first, and is replaced while it is read, in virtual time."""

from __future__ import annotations

import threading
from collections.abc import Callable
from unittest.mock import Mock

import numpy as np
import pytest

from relit_camera.base.config.settings import SourceSettings
from relit_camera.base.errors import ConflictError, DeviceError, RelitError, VideoError
from relit_camera.base.images.image_types import Frame
from relit_camera.devices.device_discovery import FIRST_WEBCAM
from relit_camera.devices.sources.changeable_source import TRIAL_S, ChangeableSource
from relit_camera.devices.sources.source import SourceInfo, SourceState
from tests.virtual_clock import VirtualClock

PICTURE = np.zeros((2, 2, 3), np.uint8)


class Webcam:
    """Gives thirty frames a second from its first read on, unless it is busy or silent."""

    reason = ""

    def __init__(self, machine: Machine, settings: SourceSettings) -> None:
        self._machine, self.settings = machine, settings
        self._id = machine.first if settings.source == FIRST_WEBCAM else settings.source
        self.state, self.index, self.closed = SourceState.IDLE, -1, False

    def read(self, timeout_s: float) -> Frame | None:
        clock, name = self._machine.clock, self.settings.source
        if name in self._machine.busy:
            self.state, self.reason = SourceState.RECONNECTING, f"{name} cannot be opened"
        if name in self._machine.busy or name in self._machine.silent:
            clock.wait(threading.Event(), timeout_s)
            return None
        others = [each for each in self._machine.made if each is not self and each.is_open]
        assert not [each for each in others if each.describe().id == self._id], "a device is opened once only"
        clock.wait(threading.Event(), 1 / 30)
        self.state = SourceState.RUNNING
        self.index += 1
        return Frame(PICTURE, self.index, clock.now(), self.index / 30)

    @property
    def is_open(self) -> bool:
        return self.state is SourceState.RUNNING and not self.closed

    def describe(self) -> SourceInfo:
        return SourceInfo("webcam", self._id, (self.settings.width, self.settings.height), 30.0)

    def close(self) -> None:
        self.closed = True


class Machine:
    """Webcams by name that are plugged in, those that another program uses, and those that give nothing."""

    def __init__(self, *plugged: str) -> None:
        self.clock = VirtualClock()
        self.plugged, self.busy, self.silent = set(plugged), set[str](), set[str]()
        self.first = plugged[0] if plugged else ""
        self.made: list[Webcam] = []
        self.new_sources = 0

    def make(self, settings: SourceSettings) -> Webcam:
        if settings.source not in {*self.plugged, FIRST_WEBCAM}:
            raise DeviceError(f"there is no webcam '{settings.source}'", "plug it in")
        self.made.append(Webcam(self, settings))
        return self.made[-1]

    def source(self, wanted: Callable[[], bool] | None = None, name: str = "one") -> ChangeableSource:
        return ChangeableSource(settings(name), self.make, wanted, self.clock, self.count_new_source)

    def count_new_source(self) -> None:
        self.new_sources += 1


def settings(name: str = "one", **changes: object) -> SourceSettings:
    return SourceSettings(source=name).model_copy(update=changes)


def read(source: ChangeableSource, count: int) -> list[Frame]:
    frames = [source.read(1.0) for _ in range(count)]
    return [frame for frame in frames if frame is not None]


def test_it_is_made_as_soon_as_it_is_plugged_in() -> None:
    machine = Machine()
    source = machine.source()
    assert str(source.opening_error) == "there is no webcam 'one'; plug it in"
    for _ in range(3):
        with pytest.raises(DeviceError, match="there is no webcam 'one'; plug it in"):
            source.read(0.1)
    assert source.state is SourceState.RECONNECTING
    assert (source.describe().id, source.describe().size) == ("one", (1280, 720))
    machine.plugged.add("one")
    assert [frame.index for frame in read(source, 3)] == [0, 1, 2]
    assert source.state is SourceState.RUNNING


def test_the_first_webcam_has_no_name_before_it_is_there() -> None:
    machine = Machine()
    source = ChangeableSource(SourceSettings(), machine.make, clock=machine.clock)
    assert (source.describe().kind, source.describe().id) == ("webcam", "")


def test_wrong_settings_are_an_error_at_once() -> None:
    def make(settings: SourceSettings) -> Webcam:
        raise VideoError("there is no file none.mp4", "check the path")

    with pytest.raises(VideoError):
        ChangeableSource(settings(), make)


def test_another_webcam_takes_over_and_the_count_of_frames_goes_on() -> None:
    machine = Machine("one", "two")
    source = machine.source()
    before = read(source, 5)
    machine.clock.sleep(1.0)
    source.change(settings("two"))
    after = read(source, 5)
    assert [frame.index for frame in before + after] == list(range(10))
    assert all(np.diff([frame.time_s for frame in before + after]) > 0)
    assert after[0].time_s - before[-1].time_s > 1.0
    assert machine.made[0].closed
    assert not machine.made[1].closed
    assert source.settings.source == "two"


def test_the_same_webcam_in_another_size_is_closed_before_it_is_opened_again() -> None:
    machine = Machine("one")
    source = machine.source()
    read(source, 3)
    source.change(settings(width=640, height=360))
    assert [frame.index for frame in read(source, 2)] == [3, 4]
    assert source.describe().size == (640, 360)
    assert machine.made[0].closed


def test_while_the_same_webcam_is_opened_again_nothing_is_read_and_nothing_fails() -> None:
    machine = Machine("one")
    source = machine.source()
    read(source, 3)
    seen: list[tuple[Frame | None, SourceState]] = []
    machine.silent.add("one")
    machine.clock.at(1.0, lambda: seen.append((source.read(0.0), source.state)))
    machine.clock.at(2.0, machine.silent.clear)
    source.change(settings(width=640, height=360))
    assert seen == [(None, SourceState.OPENING)]
    assert read(source, 1)[0].index == 3


@pytest.mark.parametrize("fault", ["busy", "silent"])
def test_one_that_gives_no_frames_changes_nothing(fault: str) -> None:
    machine = Machine("one", "two")
    source = machine.source()
    read(source, 3)
    getattr(machine, fault).add("two")
    began = machine.clock.now()
    with pytest.raises(ConflictError, match=r"two (cannot be opened|gives no frames); close the program"):
        source.change(settings("two"))
    assert machine.clock.now() - began <= TRIAL_S + 0.2
    assert [frame.index for frame in read(source, 3)] == [3, 4, 5]
    assert source.settings.source == "one"
    assert len(machine.made) == 2
    assert machine.made[1].closed
    assert not machine.made[0].closed


def test_a_size_that_the_webcam_does_not_give_brings_the_old_one_back() -> None:
    machine = Machine("one")
    source = machine.source()
    read(source, 3)
    machine.busy.add("one")
    with pytest.raises(ConflictError):
        source.change(settings(width=640, height=360))
    machine.busy.clear()
    assert [frame.index for frame in read(source, 2)] == [3, 4]
    assert source.describe().size == (1280, 720)


def test_an_error_that_nobody_expected_brings_the_old_one_back(monkeypatch: pytest.MonkeyPatch) -> None:
    machine = Machine("one")
    source = machine.source()
    read(source, 3)
    with monkeypatch.context() as patched:
        patched.setattr(Webcam, "read", Mock(side_effect=OSError("a driver's fault")))
        with pytest.raises(OSError, match="a driver's fault"):
            source.change(settings(width=640, height=360))
    assert machine.made[1].closed
    assert [frame.index for frame in read(source, 2)] == [3, 4]


def test_one_that_does_not_exist_is_told_and_the_old_one_goes_on() -> None:
    machine = Machine("one")
    source = machine.source()
    read(source, 1)
    with pytest.raises(RelitError, match="there is no webcam 'three'"):
        source.change(settings("three"))
    assert len(read(source, 2)) == 2


def test_from_a_missing_webcam_to_one_that_is_there() -> None:
    machine = Machine("two")
    source = machine.source()
    with pytest.raises(DeviceError):
        source.read(0.1)
    source.change(settings("two"))
    assert [frame.index for frame in read(source, 2)] == [0, 1]


def test_on_demand_the_new_one_is_closed_when_nobody_looks() -> None:
    machine, wanted = Machine("one", "two"), [True]
    source = machine.source(lambda: wanted[0])
    read(source, 2)
    source.change(settings("two"))
    assert len(read(source, 2)) == 2
    wanted[0] = False
    assert source.read(0.1) is None
    assert source.state is SourceState.RELEASED
    assert machine.made[1].closed
    wanted[0] = True
    assert read(source, 1)[0].index == 4
    assert machine.made[-1].settings.source == "two"


def test_before_frames_of_another_webcam_come_it_is_told() -> None:
    machine = Machine("one", "two")
    source = machine.source()
    read(source, 3)
    source.change(settings(width=640, height=360))
    read(source, 3)
    assert machine.new_sources == 0
    source.change(settings("two"))
    assert machine.new_sources == 0
    read(source, 1)
    assert machine.new_sources == 1
    read(source, 3)
    assert machine.new_sources == 1


def test_the_first_webcam_may_be_another_one_after_a_change_of_the_rate() -> None:
    machine = Machine("one", "two")
    source = machine.source(name=FIRST_WEBCAM)
    read(source, 3)
    machine.first = "two"
    source.change(settings(FIRST_WEBCAM, fps=15.0))
    read(source, 3)
    assert machine.new_sources == 1


def test_the_first_webcam_may_be_another_one_when_it_is_opened_on_demand() -> None:
    machine, wanted = Machine("one", "two"), [True]
    source = machine.source(lambda: wanted[0], FIRST_WEBCAM)
    read(source, 3)
    for first, expected in (("one", 0), ("two", 1), ("two", 1)):
        wanted[0] = False
        read(source, 1)
        wanted[0], machine.first = True, first
        read(source, 3)
        assert machine.new_sources == expected


def test_a_frame_of_another_webcam_is_not_given_while_that_cannot_be_told() -> None:
    def fail() -> None:
        raise RelitError("what is allowed cannot be changed", "wait")

    machine = Machine("one", "two")
    source = ChangeableSource(settings(), machine.make, clock=machine.clock, before_new_source=fail)
    read(source, 1)
    source.change(settings("two"))
    for _ in range(2):
        with pytest.raises(RelitError, match="what is allowed cannot be changed"):
            source.read(0.1)


def test_closing_ends_it_for_good() -> None:
    machine = Machine("one")
    source = machine.source()
    read(source, 1)
    source.close()
    source.close()
    assert machine.made[0].closed
    assert source.state is SourceState.ENDED
    missing = Machine().source()
    missing.close()
    assert missing.read(0.1) is None
