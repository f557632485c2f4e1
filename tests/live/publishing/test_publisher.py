"""The publisher: a picture at every tick, in virtual time; its thread, and the placeholder picture."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.errors import DeviceError, ImageError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.devices.sinks.sink import NullSink
from relit_camera.live.publishing.placeholder_image import BACKGROUND_COLOR, placeholder
from relit_camera.live.publishing.publisher import RETRY_S, PublishedPicture, Publisher
from tests.small_camera import WAIT_S, wait_until
from tests.virtual_clock import VirtualClock

SIZE = (64, 48)


def image(value: int) -> DisplayImage:
    return np.full((SIZE[1], SIZE[0], 3), value, np.uint8)


PLACEHOLDER = image(7)


class RecordingSink(NullSink):
    """Remembers value and time of each picture; fails while `error` is set."""

    def __init__(self, clock: VirtualClock, write_s: float = 0.0) -> None:
        super().__init__(SIZE)
        self._clock, self._write_s = clock, write_s
        self.start = clock.now()
        self.values: list[int] = []
        self.times: list[float] = []
        self.attempts: list[float] = []
        self.error: Exception | None = None

    def write(self, image: DisplayImage) -> None:
        self.attempts.append(self._clock.now() - self.start)
        if self.error is not None:
            raise self.error
        self._clock.sleep(self._write_s)
        super().write(image)
        self.values.append(int(image[0, 0, 0]))
        self.times.append(self._clock.now() - self.start)


class Publishing:
    """A publisher in virtual time. Schedule what happens, then `run`."""

    def __init__(
        self,
        fps: float = 100.0,
        stale_after_s: float | None = None,
        write_s: float = 0.0,
        error: Exception | None = None,
    ) -> None:
        self.clock = VirtualClock()
        self.sink = RecordingSink(self.clock, write_s)
        self.sink.error = error
        self.sink_errors: list[Exception | None] = []
        self.unlit_allowed = False
        self.publisher = Publisher(
            self.sink,
            fps,
            PLACEHOLDER,
            stale_after_s=stale_after_s,
            on_sink_error=self.sink_errors.append,
            unlit_allowed=lambda: self.unlit_allowed,
            clock=self.clock,
        )

    def put(self, at: float, value: int, age_s: float = 0.0, unlit: bool = False) -> None:
        """At `at` seconds a picture of frame `value` is ready, captured `age_s` before."""
        self.clock.at(
            at,
            lambda: self.publisher.pictures.put(PublishedPicture(image(value), self.clock.now() - age_s, value, unlit)),
        )

    def show_placeholder(self, at: float, value: int, last_index: int, at_once: bool = False) -> None:
        self.clock.at(at, lambda: self.publisher.show_placeholder(image(value), last_index, at_once))

    def run(self, seconds: float) -> RecordingSink:
        """Publish for some seconds."""
        self.clock.at(seconds, self.publisher.stop)
        self.publisher.run()
        return self.sink

    def shown_at(self, seconds: float) -> int:
        """The value that the sink shows at a time."""
        return self.sink.values[int(np.searchsorted(self.sink.times, seconds, side="right")) - 1]


def test_there_is_always_a_picture() -> None:
    camera = Publishing(fps=100)
    camera.put(0.055, 50)
    sink = camera.run(0.105)
    assert sink.values == [7] * 6 + [50] * 5  # repeated while nothing newer comes
    assert camera.publisher.counts.published == 11
    assert camera.publisher.counts.repeated == 10


def test_the_newest_picture_wins_and_the_others_are_counted() -> None:
    camera = Publishing(fps=20)
    for value in range(100, 110):
        camera.put(0.01, value)
    sink = camera.run(0.2)
    assert sink.values[:2] == [7, 109]
    assert camera.publisher.counts.dropped == 9


def test_a_late_picture_is_waited_for_but_a_missing_one_is_not() -> None:
    camera = Publishing(fps=2)
    camera.put(0.4, 1)
    camera.put(1.1, 2)  # due at the tick of 1.0
    sink = camera.run(4.2)
    assert sink.values[:3] == [7, 1, 2]
    assert sink.times[2] == pytest.approx(1.1, abs=0.01)  # not a whole period later
    assert sink.times[3] == pytest.approx(1.5 + 0.2, abs=0.01)  # the next may be late too
    np.testing.assert_allclose(np.diff(sink.times[4:]), 0.5, atol=0.01)  # then none is expected any more


def test_a_picture_that_waited_long_gives_way_to_its_successor() -> None:
    camera = Publishing(fps=2)
    camera.put(0.4, 1)
    camera.put(0.55, 2)
    camera.put(1.05, 3)
    sink = camera.run(1.4)
    assert sink.values == [7, 1, 3]
    assert sink.times[2] == pytest.approx(1.05, abs=0.01)
    assert camera.publisher.counts.dropped == 1


@pytest.mark.parametrize("pictures_fps", [19.0, 25.0, 60.0])
def test_the_rate_is_kept_without_drift(pictures_fps: float) -> None:
    camera = Publishing(fps=25, write_s=0.003)
    for number in range(int(60 * pictures_fps)):
        camera.put(number / pictures_fps, number % 256)
    sink = camera.run(60.0)
    assert len(sink.times) == pytest.approx(25 * 60, rel=0.005)
    assert camera.publisher.fps == pytest.approx(25, rel=0.05)


def test_latency_is_from_capture_to_the_end_of_writing() -> None:
    camera = Publishing(fps=100, write_s=0.002)
    for number in range(200):
        camera.put(number / 100, number, age_s=0.2)
    camera.run(2.0)
    assert camera.publisher.latency_ms.p50 == pytest.approx(203, abs=1)  # a tenth of a period before the tick
    assert camera.publisher.latency_ms.p95 >= camera.publisher.latency_ms.p50


def test_a_repeated_picture_has_no_latency() -> None:
    camera = Publishing(fps=100)
    camera.put(0.0, 1)
    sink = camera.run(10.0)
    assert sink.values.count(1) > 900
    assert camera.publisher.latency_ms.p95 < 11  # not the age of the repeated picture


def test_a_failing_sink_is_reported_once_and_tried_again() -> None:
    gone = DeviceError("the virtual camera is gone")
    camera = Publishing(fps=20, error=gone)
    camera.clock.at(2.5, lambda: setattr(camera.sink, "error", None))
    sink = camera.run(4.0)
    pauses = np.diff(sink.attempts[:4])
    assert (pauses >= RETRY_S).all()  # not at each tick
    assert (pauses < RETRY_S + 0.06).all()  # but at the next one after the pause
    assert sink.times[0] == sink.attempts[3]
    assert camera.sink_errors == [gone, None]
    assert camera.publisher.counts.published == len(sink.values) > 10


def test_a_sink_that_fails_for_another_reason_is_reported_again() -> None:
    missing, denied = DeviceError("the module is not loaded", "load it"), DeviceError("no permission", "join video")
    camera = Publishing(fps=20, error=missing)
    camera.clock.at(2.5, lambda: setattr(camera.sink, "error", denied))
    camera.clock.at(5.5, lambda: setattr(camera.sink, "error", None))
    camera.run(8.0)
    assert camera.sink_errors == [missing, denied, None]


@pytest.mark.parametrize("error", [None, DeviceError("the module is not loaded")])
def test_new_pictures_are_counted_without_repetitions_and_without_a_sink_too(error: Exception | None) -> None:
    camera = Publishing(fps=30, error=error)
    for number in range(80):
        camera.put(0.1 * number, number)
    camera.clock.at(7.0, lambda: rates.append(camera.publisher.new_fps))
    rates: list[float] = []
    camera.run(14.0)
    assert rates == [pytest.approx(10.0, rel=0.1)]
    assert camera.publisher.new_fps == 0.0


def test_a_fault_in_the_sink_does_not_end_publishing() -> None:
    camera = Publishing(error=ZeroDivisionError("a fault"))
    camera.clock.at(0.5, lambda: setattr(camera.sink, "error", None))
    assert camera.run(2.0).values


def test_the_placeholder_comes_back_when_pictures_are_stale() -> None:
    camera = Publishing(stale_after_s=3.0)
    camera.put(1.0, 90)
    camera.show_placeholder(5.0, 8, last_index=-1)
    camera.put(6.0, 91)
    camera.run(7.0)
    assert [camera.shown_at(at) for at in (0.9, 1.02, 3.99, 4.02, 5.02, 6.02)] == [7, 90, 90, 7, 8, 91]


def test_after_the_program_stood_still_the_last_picture_is_shown_on() -> None:
    camera = Publishing(stale_after_s=3.0)
    camera.put(1.0, 90)
    camera.clock.at(2.0, lambda: camera.clock.sleep(60.0))
    camera.run(70.0)
    assert [camera.shown_at(at) for at in (1.9, 62.1, 64.9, 65.1)] == [90, 90, 90, 7]


def test_a_late_picture_does_not_replace_the_placeholder() -> None:
    camera = Publishing(stale_after_s=3.0)
    camera.show_placeholder(0.5, 8, last_index=0)
    camera.put(1.0, 1)
    camera.show_placeholder(1.5, 9, last_index=3)
    camera.put(2.0, 2)  # late, but the placeholder is not shown yet
    camera.put(6.0, 3)
    camera.clock.at(6.5, lambda: setattr(camera.publisher, "hold", True))
    camera.put(7.0, 4)
    sink = camera.run(8.0)
    assert [camera.shown_at(at) for at in (0.4, 0.6, 1.1, 2.1, 5.1, 6.2, 7.1)] == [7, 8, 1, 2, 9, 9, 4]
    assert 3 not in sink.values
    assert camera.publisher.counts.dropped == 1


def test_whoever_hides_is_gone_at_once() -> None:
    camera = Publishing(stale_after_s=3.0)
    camera.put(1.0, 1)
    camera.show_placeholder(1.5, 8, last_index=2, at_once=True)
    camera.put(1.6, 2)  # late
    camera.put(2.0, 3)
    camera.run(3.0)
    assert [camera.shown_at(at) for at in (1.45, 1.55, 1.7, 2.1)] == [1, 8, 8, 3]


def test_a_held_picture_stays_and_a_replaced_one_does_not_come_back() -> None:
    camera = Publishing(stale_after_s=3.0)
    camera.put(0.5, 1)
    for at, hold in ((1.0, True), (20.0, False), (30.0, True)):
        camera.clock.at(at, lambda hold=hold: setattr(camera.publisher, "hold", hold))  # type: ignore[misc]
    camera.run(40.0)
    assert [camera.shown_at(at) for at in (0.6, 19.9, 22.9, 23.1, 29.0, 39.0)] == [1, 1, 1, 7, 7, 7]


def test_previews_get_each_shown_picture_once() -> None:
    camera = Publishing()
    numbers: list[int] = []

    def look() -> None:
        found = camera.publisher.shown.newer(numbers[-1] if numbers else 0, 0)
        if found is not None:
            numbers.append(found[0])

    camera.clock.every(0.001, look)
    camera.put(0.5, 33)
    camera.run(1.0)
    assert numbers == [1, 2]  # repeated pictures are not news


def test_a_slow_sink_delays_ticks_but_is_not_made_up_for() -> None:
    camera = Publishing(fps=50)
    camera.clock.at(1.0, lambda: camera.clock.sleep(10.0))  # the machine sleeps
    sink = camera.run(12.0)
    gaps = np.diff(sink.times)
    assert gaps.max() == pytest.approx(10.0, abs=0.1)
    assert np.sort(gaps)[:-1] == pytest.approx(0.02, abs=1e-6)


# The thread. What would be waited for in vain is an hour away: then a test does not end in time.

HOUR_S = 3600.0


def test_stopping_does_not_wait_for_the_next_tick_and_may_be_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("relit_camera.live.publishing.publisher.STOP_TIMEOUT_S", WAIT_S)
    sink = RecordingSink(VirtualClock())
    publisher = Publisher(sink, 1 / HOUR_S, PLACEHOLDER)
    publisher.start()
    wait_until(lambda: bool(sink.values))
    assert publisher.stop()
    assert publisher.shown.newer(publisher.shown.count, HOUR_S) is None  # who waits for a preview is let go at once
    assert publisher.stop()
    assert Publisher(sink, 30, PLACEHOLDER).stop()  # never started


def test_a_sink_that_hangs_does_not_hold_up_stopping(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("relit_camera.live.publishing.publisher.STOP_TIMEOUT_S", 0.1)
    writing, free = threading.Event(), threading.Event()

    class HangingSink(NullSink):
        def write(self, image: DisplayImage) -> None:
            writing.set()
            free.wait(HOUR_S)

    publisher = Publisher(HangingSink(SIZE), 30, PLACEHOLDER)
    publisher.start()
    assert writing.wait(WAIT_S)
    assert not publisher.stop()
    assert not publisher.ended()
    free.set()
    assert publisher.ended(WAIT_S)


# The placeholder picture.


@pytest.mark.parametrize("size", [(1280, 720), (320, 240), (480, 640), (64, 64)])
def test_our_placeholder_is_dark_and_of_the_size_asked_for(size: tuple[int, int]) -> None:
    image = placeholder(size, "HD Webcam is unplugged")
    assert image.shape == (size[1], size[0], 3)
    assert image.dtype == np.uint8
    assert 15 < np.median(image) < 60
    assert image.max() > 180  # the lit ball and the title


def test_the_reason_is_written_below_and_fits() -> None:
    size = (640, 360)
    plain, with_reason = placeholder(size), placeholder(size, "no webcam")
    rows, columns = np.nonzero((plain != with_reason).any(axis=2))
    assert rows.min() > size[1] // 2
    assert abs((columns.min() + columns.max()) / 2 - size[0] / 2) < 4
    long = placeholder(size, "a reason that goes on and on " * 5 + "é漢")
    columns = np.nonzero((plain != long).any(axis=2))[1]
    assert columns.min() > 5
    assert columns.max() < size[0] - 5


def test_a_picture_of_the_users_own_is_fitted_whole(tmp_path: Path) -> None:
    from relit_camera.base.images.color import uint8_from_linear
    from relit_camera.base.images.image_files import write_display

    path = tmp_path / "own.png"
    write_display(path, np.full((100, 100, 3), (10, 200, 30), np.uint8))
    image = placeholder((320, 180), "not shown", path)
    assert image.shape == (180, 320, 3)
    inside = (image == (10, 200, 30)).all(axis=2)
    assert inside[:, 71:249].all()
    assert (image[:, :68] == uint8_from_linear(BACKGROUND_COLOR)).all()
    with pytest.raises(ImageError, match=r"gone\.png"):
        placeholder((320, 180), "", tmp_path / "gone.png")


def test_a_picture_as_filmed_is_not_shown_unless_that_is_allowed() -> None:
    camera = Publishing(fps=10)
    camera.put(0.05, 1)
    camera.put(0.15, 2, unlit=True)
    camera.clock.at(0.35, lambda: setattr(camera, "unlit_allowed", True))
    camera.put(0.45, 3, unlit=True)
    sink = camera.run(0.65)
    assert sink.values == [7, 1, 1, 1, 1, 3, 3]
    assert camera.publisher.unlit


def test_a_picture_as_filmed_goes_when_the_permission_does_even_where_it_is_held() -> None:
    camera = Publishing(fps=10)
    camera.unlit_allowed = camera.publisher.hold = True
    camera.put(0.05, 1, unlit=True)
    camera.clock.at(0.25, lambda: setattr(camera, "unlit_allowed", False))
    sink = camera.run(0.45)
    assert sink.values == [7, 1, 1, 7, 7]
    assert not camera.publisher.unlit
