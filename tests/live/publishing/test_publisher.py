import threading
import time

import numpy as np
import pytest

from relit_camera.base.errors import DeviceError, ImageError
from relit_camera.devices.sinks.sink import NullSink
from relit_camera.live.publishing import publisher as module
from relit_camera.live.publishing.placeholder_image import BACKGROUND_COLOR, placeholder
from relit_camera.live.publishing.publisher import PublishedPicture, Publisher
from tests.small_camera import wait_until

pytestmark = pytest.mark.real_time

SIZE = (64, 48)
PLACEHOLDER = np.full((48, 64, 3), 7, np.uint8)


class RecordingSink(NullSink):
    """Remembers value and time of each picture; fails while `error` is set."""

    def __init__(self):
        super().__init__(SIZE)
        self.values, self.times, self.error, self.attempts = [], [], None, 0

    def write(self, image):
        self.attempts += 1
        if self.error:
            raise self.error
        super().write(image)
        self.values.append(int(image[0, 0, 0]))
        self.times.append(time.monotonic())


def picture(value, captured_at=None):
    at = time.monotonic() if captured_at is None else captured_at
    return PublishedPicture(np.full((48, 64, 3), value, np.uint8), at, value)


@pytest.fixture
def sink():
    return RecordingSink()


@pytest.fixture
def make(sink):
    made = []

    def start(fps=100.0, **options):
        publisher = Publisher(options.pop("sink", sink), fps, PLACEHOLDER, **options)
        made.append(publisher)
        publisher.start()
        return publisher

    yield start
    for publisher in made:
        assert publisher.stop()


def test_there_is_always_a_picture(make, sink):
    publisher = make()
    wait_until(lambda: len(sink.values) >= 5)
    assert set(sink.values) == {7}
    publisher.pictures.put(picture(50))
    wait_until(lambda: sink.values.count(50) >= 5)  # repeated while nothing newer comes
    assert publisher.counts.repeated >= 8
    assert publisher.counts.published == pytest.approx(len(sink.values), abs=1)


def test_the_newest_picture_wins_and_the_others_are_counted(make, sink):
    publisher = make(fps=20)
    wait_until(lambda: sink.values)
    for value in range(100, 110):
        publisher.pictures.put(picture(value))
    wait_until(lambda: 109 in sink.values)
    assert publisher.counts.dropped >= 8


def test_a_late_picture_is_waited_for_but_a_missing_one_is_not(make, sink):
    period = 0.5
    publisher = make(fps=1 / period)
    publisher.pictures.put(picture(1))
    wait_until(lambda: 1 in sink.values)
    due = sink.times[-1] + period
    time.sleep(max(0.0, due + period / 5 - time.monotonic()))
    publisher.pictures.put(picture(2))
    wait_until(lambda: 2 in sink.values)
    assert sink.times[sink.values.index(2)] - due < period / 2  # not a whole period later
    wait_until(lambda: sink.values.count(2) == 5)
    steps = np.diff(sink.times[-3:])
    np.testing.assert_allclose(steps, period, atol=period / 4)


def test_a_picture_that_waited_long_gives_way_to_its_successor(make, sink):
    period = 0.5
    publisher = make(fps=1 / period)
    publisher.pictures.put(picture(1))
    wait_until(lambda: 1 in sink.values)
    due = sink.times[-1] + period
    time.sleep(period / 7)
    publisher.pictures.put(picture(2))
    time.sleep(max(0.0, due + period / 7 - time.monotonic()))
    publisher.pictures.put(picture(3))
    wait_until(lambda: 3 in sink.values)
    assert 2 not in sink.values
    assert sink.times[sink.values.index(3)] - due < period / 2
    assert publisher.counts.dropped == 1


def test_the_rate_is_kept_without_drift(make, sink):
    start = time.monotonic()
    publisher = make(fps=25)
    feeding = threading.Event()

    def feed():  # at another rate than the publisher's
        while not feeding.wait(0.053):
            publisher.pictures.put(picture(1))

    feeder = threading.Thread(target=feed)
    feeder.start()
    time.sleep(2.5)
    count, took = len(sink.times), time.monotonic() - start
    feeding.set()
    feeder.join()
    assert count == pytest.approx(25 * took, rel=0.1)
    assert publisher.fps == pytest.approx(25, rel=0.1)


def test_latency_is_from_capture_to_the_end_of_writing(make, sink):
    publisher = make(fps=100)
    for value in range(20):
        publisher.pictures.put(picture(value, captured_at=time.monotonic() - 0.2))
        time.sleep(0.02)
    latency = publisher.latency_ms
    assert 200 <= latency.p50 < 260
    assert latency.p95 >= latency.p50


def test_a_repeated_picture_has_no_latency(make, sink):
    publisher = make()
    publisher.pictures.put(picture(1))
    wait_until(lambda: sink.values.count(1) > 200)
    assert publisher.latency_ms.p95 < 1000  # not the age of the repeated picture


def test_a_failing_sink_is_told_once_and_tried_again(make, sink, monkeypatch):
    monkeypatch.setattr(module, "RETRY_S", 0.1)
    told = []
    sink.error = DeviceError("the virtual camera is gone")
    publisher = make(on_sink_error=told.append)
    wait_until(lambda: sink.attempts >= 3)
    assert told == [sink.error]
    assert publisher.counts.published == 0
    sink.error = None
    wait_until(lambda: len(sink.values) >= 3)
    assert told[1:] == [None]


def test_a_fault_of_the_sink_does_not_end_the_thread(make, sink, monkeypatch):
    monkeypatch.setattr(module, "RETRY_S", 0.05)
    sink.error = ZeroDivisionError("a fault")
    make()
    wait_until(lambda: sink.attempts >= 2)
    sink.error = None
    wait_until(lambda: sink.values)


def test_failed_writes_are_not_hammered(make, sink, monkeypatch):
    monkeypatch.setattr(module, "RETRY_S", 60.0)
    sink.error = DeviceError("gone")
    make(fps=200)
    wait_until(lambda: sink.attempts)
    time.sleep(0.5)
    assert sink.attempts == 1


def test_the_placeholder_comes_back_when_pictures_are_stale(make, sink):
    publisher = make(stale_after_s=0.2)
    publisher.pictures.put(picture(90))
    wait_until(lambda: 90 in sink.values)
    wait_until(lambda: sink.values[-1] == 7)
    publisher.placeholder = np.full((48, 64, 3), 8, np.uint8)
    wait_until(lambda: sink.values[-1] == 8)
    publisher.pictures.put(picture(91))
    wait_until(lambda: 91 in sink.values)


def test_a_late_picture_does_not_take_the_placeholders_place(make, sink):
    publisher = make(stale_after_s=0.2)
    publisher.show_placeholder(np.full((48, 64, 3), 8, np.uint8), 0)
    publisher.pictures.put(picture(1))
    wait_until(lambda: 1 in sink.values)
    publisher.show_placeholder(np.full((48, 64, 3), 9, np.uint8), 3)
    publisher.pictures.put(picture(2))
    wait_until(lambda: 2 in sink.values)  # late, but the placeholder is not shown yet
    wait_until(lambda: sink.values[-1] == 9)
    publisher.hold = True
    publisher.pictures.put(picture(3))
    wait_until(lambda: publisher.counts.dropped == 1)
    publisher.pictures.put(picture(4))
    wait_until(lambda: 4 in sink.values)
    assert 3 not in sink.values


def test_previews_get_each_shown_picture_once(make, sink):
    publisher = make()
    number, image, _ = publisher.shown.newer(0, 5)
    assert image is PLACEHOLDER
    assert publisher.shown.newer(number, 0.1) is None  # repeated pictures are not news
    publisher.pictures.put(picture(33))
    number, image, _ = publisher.shown.newer(number, 5)
    assert image[0, 0, 0] == 33
    publisher.stop()
    start = time.monotonic()
    assert publisher.shown.newer(number, 10) is None
    assert time.monotonic() - start < 1


def test_stopping_is_quick(sink):
    publisher = Publisher(sink, 0.5, PLACEHOLDER)  # it would sleep two seconds
    publisher.start()
    wait_until(lambda: sink.values)
    start = time.monotonic()
    assert publisher.stop()
    assert time.monotonic() - start < 0.9
    assert publisher.stop()
    assert Publisher(sink, 30, PLACEHOLDER).stop()  # never started


def test_a_stuck_sink_does_not_hold_up_stopping():
    free = threading.Event()

    class StuckSink(NullSink):
        def write(self, image):
            free.wait(20)

    publisher = Publisher(StuckSink(SIZE), 30, PLACEHOLDER)
    publisher.start()
    start = time.monotonic()
    assert not publisher.stop()
    assert time.monotonic() - start < 2
    free.set()
    wait_until(publisher.stop)


def test_the_publisher_never_waits_for_a_slow_pipeline(make, sink):
    publisher, ended = make(fps=50), threading.Event()

    def pipeline() -> None:
        value = 100
        while not ended.wait(0.13):  # six and a half periods a picture
            value += 1
            publisher.pictures.put(picture(value))

    thread = threading.Thread(target=pipeline)
    thread.start()
    wait_until(lambda: max(sink.values, default=0) >= 105)
    ended.set()
    thread.join()
    gaps = np.diff(sink.times)
    assert np.median(gaps) == pytest.approx(0.02, abs=0.005)
    assert publisher.counts.repeated > 3 * len(set(sink.values))


@pytest.mark.parametrize("size", [(1280, 720), (320, 240), (480, 640), (64, 64)])
def test_our_placeholder_is_dark_and_of_the_size_asked_for(size):
    image = placeholder(size, "HD Webcam is unplugged")
    assert image.shape == (size[1], size[0], 3)
    assert image.dtype == np.uint8
    assert 15 < np.median(image) < 60
    assert image.max() > 180  # the lit ball and the title


def test_the_reason_is_written_below_and_fits():
    size = (640, 360)
    plain, told = placeholder(size), placeholder(size, "no webcam")
    rows, columns = np.nonzero((plain != told).any(axis=2))
    assert rows.min() > size[1] // 2
    assert abs((columns.min() + columns.max()) / 2 - size[0] / 2) < 4
    long = placeholder(size, "a reason that goes on and on " * 5 + "é漢")
    columns = np.nonzero((plain != long).any(axis=2))[1]
    assert columns.min() > 5
    assert columns.max() < size[0] - 5


def test_a_picture_of_the_users_own_is_fitted_whole(tmp_path):
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
