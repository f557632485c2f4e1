"""The keeper in virtual time: what it shows when the camera is late, killed, restarted or gone for good."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from itertools import pairwise

import pytest

from relit_camera.base.errors import DeviceError
from relit_camera.devices.keeper.keeper import PICTURE_SLOTS, Keeper
from relit_camera.devices.keeper.keeper_state import FILMED_S, LAST_PICTURE_S
from relit_camera.devices.keeper.kept_output import RGB, OutputOptions, picture_bytes
from tests.virtual_clock import VirtualClock

FPS, KEEP_S, VERSION = 25.0, 60.0, "1.0 1"
SIZE = (4, 2)
OPTIONS = OutputOptions(SIZE, FPS, "Relit Camera")
PLACEHOLDER = 9


@dataclass
class FakeOutput:
    """Remembers what it is shown.

    Attributes:
        shown: the time and the first byte of each picture.
        given: the pictures.
    """

    clock: VirtualClock
    size: tuple[int, int]
    shown: list[tuple[float, int]]
    node: str = "/dev/video10"
    layout: str = RGB
    closed: bool = False
    fails: bool = False
    is_bound: bool = False
    given: list[memoryview] = field(default_factory=list)

    @property
    def place(self) -> str:
        return self.node

    def describe(self) -> dict[str, object]:
        return {"kind": "camera", "id": self.node, "size": self.size}

    def send(self, picture: memoryview) -> None:
        assert not self.closed
        assert len(picture) == picture_bytes(self.size, self.layout)
        if self.fails:
            raise DeviceError("it is gone", "plug it in")
        self.given.append(picture)
        self.shown.append((self.clock.now(), picture[0]))

    def close(self) -> None:
        self.closed = True


@dataclass
class Bench:
    """A keeper, what it has opened, and a camera that talks to it."""

    clock: VirtualClock = field(default_factory=VirtualClock)
    outputs: list[FakeOutput] = field(default_factory=list)
    shown: list[tuple[float, int]] = field(default_factory=list)
    ended_at: float | None = None

    def __post_init__(self) -> None:
        self.keeper = Keeper(VERSION, self.open, self.clock)
        self.memory = bytearray()
        self.slot = 0

    def open(self, options: OutputOptions) -> FakeOutput:
        self.outputs.append(FakeOutput(self.clock, options.size, self.shown))
        return self.outputs[-1]

    def greet(self, options: OutputOptions = OPTIONS, version: str = VERSION) -> dict[str, object]:
        """A camera comes."""
        answer = self.keeper.handle({"hello": version, "output": asdict(options), "keep_s": KEEP_S})
        assert answer is not None
        if "info" in answer:
            width, height = answer["size"]
            count = picture_bytes((width, height), RGB)
            self.memory = bytearray((PICTURE_SLOTS + 1) * count)
            self.memory[PICTURE_SLOTS * count :] = bytes([PLACEHOLDER]) * count
            assert self.keeper.handle({"memory": True}, memoryview(self.memory)) == {}
        return dict(answer)

    def publish(self, value: int, repeatable: bool = True) -> dict[str, object]:
        """The camera shows a picture."""
        count = len(self.memory) // (PICTURE_SLOTS + 1)
        self.memory[self.slot * count : (self.slot + 1) * count] = bytes([value]) * count
        answer = self.keeper.handle({"picture": self.slot, "repeatable": repeatable})
        self.slot = 1 - self.slot
        assert answer is not None
        return dict(answer)

    def pass_time(self, seconds: float, every: Callable[[], object] | None = None) -> None:
        """Let time pass; `every` is called at the frame rate."""
        until, due = self.clock.now() + seconds, self.clock.now()
        while self.clock.now() < until and self.ended_at is None:
            if every is not None and self.clock.now() >= due:
                every()
                due += 1 / FPS
            wait_s = self.keeper.step()
            if wait_s is None:
                self.ended_at = self.clock.now()
                break
            until_next = min(until, due if every else until) - self.clock.now()
            self.clock.sleep(max(1e-6, min(wait_s, until_next)))

    @property
    def longest_gap_s(self) -> float:
        return max(later - earlier for (earlier, _), (later, _) in pairwise(self.shown))


@pytest.fixture
def bench() -> Bench:
    made = Bench()
    assert made.greet() == {"info": made.outputs[0].describe(), "layout": RGB, "size": SIZE}
    return made


def test_while_pictures_come_in_time_nothing_is_added(bench: Bench) -> None:
    values = iter(range(1, 200))
    bench.pass_time(4, lambda: bench.publish(next(values)))
    shown = [value for _, value in bench.shown]
    assert shown == list(range(1, len(shown) + 1))
    assert len(shown) in (100, 101)
    assert bench.longest_gap_s == pytest.approx(1 / FPS)


def test_a_killed_camera_is_bridged_without_a_gap_and_then_continued(bench: Bench) -> None:
    bench.pass_time(1, lambda: bench.publish(7))
    bench.keeper.camera_left()
    bench.pass_time(5)
    bench.greet()
    bench.pass_time(1)  # it starts
    bench.pass_time(1, lambda: bench.publish(8))
    values = [value for _, value in bench.shown]
    assert values == sorted(values)
    assert set(values) == {7, 8}
    assert bench.longest_gap_s <= 1.5 / FPS + 1e-9
    assert len(bench.outputs) == 1
    assert not bench.outputs[0].closed


def test_a_camera_that_hangs_is_bridged_for_as_long_as_it_hangs(bench: Bench) -> None:
    bench.publish(7)
    bench.pass_time(3 * KEEP_S)
    assert bench.ended_at is None
    assert bench.longest_gap_s <= 1.5 / FPS + 1e-9
    assert [value for _, value in bench.shown][-1] == PLACEHOLDER


def test_a_camera_that_is_gone_for_good_leaves_its_last_picture_then_the_placeholder_then_nothing(bench: Bench) -> None:
    bench.publish(7)
    left_at = bench.clock.now()
    bench.keeper.camera_left()
    bench.pass_time(2 * KEEP_S)
    last = [at for at, value in bench.shown if value == 7]
    placeholder = [at for at, value in bench.shown if value == PLACEHOLDER]
    assert last[-1] - left_at == pytest.approx(LAST_PICTURE_S, abs=2 / FPS)
    assert placeholder[0] - last[-1] <= 1.5 / FPS
    assert bench.ended_at is not None
    assert bench.ended_at - left_at == pytest.approx(KEEP_S, abs=2 / FPS)
    assert bench.outputs[0].closed


def test_a_picture_that_may_be_as_filmed_is_not_shown_without_the_camera(bench: Bench) -> None:
    bench.publish(7, repeatable=False)
    bench.pass_time(0.8 * FILMED_S)  # it is late: what it would show itself is shown
    bench.keeper.camera_left()
    gone_at = bench.clock.now()
    bench.pass_time(1)
    bench.greet()  # nor because another one has come
    bench.pass_time(1)
    assert {value for at, value in bench.shown if at < gone_at} == {7}
    assert {value for at, value in bench.shown if at > gone_at} == {PLACEHOLDER}
    assert bench.longest_gap_s <= 1.5 / FPS + 1e-9


def test_a_camera_that_hangs_shows_no_picture_as_filmed_for_long(bench: Bench) -> None:
    bench.publish(7, repeatable=False)
    shown_at = bench.clock.now()
    bench.pass_time(3)
    assert {value for at, value in bench.shown if at < shown_at + FILMED_S} == {7}
    assert {value for at, value in bench.shown if at > shown_at + FILMED_S + 1 / FPS} == {PLACEHOLDER}


def test_until_the_first_picture_the_placeholder_is_shown(bench: Bench) -> None:
    bench.pass_time(1)
    assert {value for _, value in bench.shown} == {PLACEHOLDER}
    assert bench.longest_gap_s <= 1 / FPS + 1e-9
    bench.publish(7)
    assert bench.shown[-1][1] == 7


def test_a_goodbye_ends_it_at_once(bench: Bench) -> None:
    bench.publish(7)
    assert bench.keeper.handle({"goodbye": "end"}) is None
    assert bench.keeper.step() is None
    assert bench.outputs[0].closed


def test_a_camera_that_is_restarted_hands_over(bench: Bench) -> None:
    bench.publish(7)
    assert bench.keeper.handle({"goodbye": "hand-over"}) is None
    bench.pass_time(2)
    assert bench.longest_gap_s <= 1.5 / FPS + 1e-9
    bench.greet()
    assert len(bench.outputs) == 1


def test_another_size_opens_it_anew(bench: Bench) -> None:
    bench.publish(7)
    bench.keeper.camera_left()
    other = OutputOptions((8, 4), FPS, "Relit Camera")
    assert bench.greet(other)["info"] == {"kind": "camera", "id": "/dev/video10", "size": (8, 4)}
    assert bench.outputs[0].closed
    bench.pass_time(1)
    assert bench.shown[-1][1] == PLACEHOLDER  # a picture of the old size could not be shown
    assert bench.longest_gap_s <= 1.5 / FPS + 1e-9
    bench.publish(8)
    assert bench.shown[-1][1] == 8


def test_a_camera_of_another_version_is_told_and_may_end_it(bench: Bench) -> None:
    bench.publish(7)
    bench.keeper.camera_left()
    assert bench.greet(version="2.0 1") == {"other_version": VERSION}
    bench.pass_time(1)
    assert bench.shown[-1][1] == 7  # it goes on until the other one is ready
    assert bench.keeper.handle({"goodbye": "end"}) is None
    assert bench.keeper.step() is None


@pytest.mark.parametrize("other", [OutputOptions((8, 4), FPS, "Relit Camera"), OutputOptions(SIZE, 30, "Relit Camera")])
def test_what_is_read_and_would_be_lost_is_not_opened_anew(bench: Bench, other: OutputOptions) -> None:
    bench.publish(7)
    bench.keeper.camera_left()
    bench.outputs[0].is_bound = True
    assert bench.greet(other, "2.0 1")["size"] == SIZE
    bench.publish(8)
    assert bench.shown[-1][1] == 8
    assert len(bench.outputs) == 1
    bench.keeper.camera_left()
    bench.outputs[0].is_bound = False
    assert bench.greet(other)["size"] == other.size
    assert len(bench.outputs) == 2


def test_a_camera_that_says_other_things_is_not_served_whoever_reads(bench: Bench) -> None:
    bench.keeper.camera_left()
    bench.outputs[0].is_bound = True
    assert bench.greet(version="1.0 2") == {"other_version": VERSION}


def test_what_a_sink_says_of_itself_is_told_when_it_changes(bench: Bench) -> None:
    assert bench.publish(7) == {}
    bench.outputs[0].node = "/dev/video11"
    assert bench.publish(8) == {"info": {"kind": "camera", "id": "/dev/video11", "size": SIZE}}
    assert bench.publish(9) == {}


def test_a_device_that_fails_is_told_and_opened_again(bench: Bench) -> None:
    bench.publish(7)
    bench.outputs[0].fails = True
    assert bench.publish(8) == {"error": ["DeviceError", "it is gone", "plug it in"]}
    assert bench.outputs[0].closed
    assert bench.publish(8) == {"error": ["DeviceError", "the keeper holds no virtual camera", ""]}
    bench.greet()
    assert bench.publish(9) == {}
    assert len(bench.outputs) == 2


def test_a_device_that_fails_without_a_camera_is_given_up(bench: Bench) -> None:
    bench.publish(7)
    bench.keeper.camera_left()
    bench.outputs[0].fails = True
    bench.pass_time(1)
    assert bench.ended_at is not None


def test_why_it_cannot_be_opened_is_told() -> None:
    def missing(options: OutputOptions) -> FakeOutput:
        raise DeviceError("there is none", "load it")

    keeper = Keeper(VERSION, missing, VirtualClock())
    hello = {"hello": VERSION, "output": asdict(OPTIONS), "keep_s": KEEP_S}
    assert keeper.handle(hello) == {"error": ["DeviceError", "there is none", "load it"]}
    assert keeper.step() is not None  # the camera asks again
    keeper.camera_left()
    assert keeper.step() is None


def test_memory_that_its_pictures_would_not_fit_into_is_refused(bench: Bench) -> None:
    short = memoryview(bench.memory)[:-1]
    assert bench.keeper.handle({"memory": True}, short) == {
        "error": ["DeviceError", "the keeper holds nothing of that size", ""]
    }


def test_the_same_picture_again_is_the_same_object(bench: Bench) -> None:
    bench.publish(7)
    assert bench.keeper.handle({"picture": 0, "repeatable": True}) == {}
    bench.pass_time(1)  # the keeper repeats it
    bench.publish(8)
    bench.publish(9)
    bench.greet()  # another camera, with a memory of its own
    bench.slot = 0
    bench.publish(5)
    given = [(picture, value) for picture, (_, value) in zip(bench.outputs[0].given, bench.shown, strict=True)]
    assert [value for _, value in given[-3:]] == [8, 9, 5]
    assert len({id(picture) for picture, value in given if value == 7}) == 1
    assert len({id(picture) for picture, _ in given}) == 4


def test_memory_that_is_too_small_is_refused(bench: Bench) -> None:
    answer = bench.keeper.handle({"memory": True}, memoryview(bytearray(10)))
    assert answer is not None
    assert "error" in answer
