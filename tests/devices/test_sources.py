import itertools
import threading
import time

import cv2
import numpy as np
import pytest

from relit_camera.base.config.settings import SourceSettings
from relit_camera.base.errors import DeviceError, IllegalTransitionError, ImageError, InputError, VideoError
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.base.video.video_writer import VideoWriter
from relit_camera.devices.device_discovery import DeviceFolders
from relit_camera.devices.sources.pattern_source import draw_pattern, pattern_source
from relit_camera.devices.sources.playback_source import PlaybackSource
from relit_camera.devices.sources.source import TRANSITIONS, SourceInfo, SourceState, SourceStateMachine
from relit_camera.devices.sources.source_factory import open_source
from relit_camera.devices.sources.webcam_source import BACKOFF_S, WebcamSource, stall_timeout
from tests.devices.fake_devices import FakeCapture, FakeTree
from tests.small_camera import WAIT_S, wait_until
from tests.vm.guest.pattern_number import read_number

S = SourceState
INFO = SourceInfo("test", "test", (64, 48), 50.0)


def pictures(count=None, interval_s=0.02):
    for number in itertools.count() if count is None else range(count):
        yield np.full((48, 64, 3), number % 256, np.uint8), number * interval_s


def drain(source):
    frames = []
    while (frame := source.read(WAIT_S)) is not None:
        frames.append(frame)
    return frames


def source_threads():
    return {thread for thread in threading.enumerate() if thread.name.startswith("source-")}


@pytest.fixture(autouse=True)
def no_threads_left():
    before = source_threads()  # what another test left is that test's fault
    yield
    wait_until(lambda: source_threads() <= before)


def test_every_state_can_be_left_for_the_end_and_reached_from_idle():
    assert set(TRANSITIONS) == set(S) - {S.RELEASED}
    assert all(S.ENDED in targets or state is S.ENDED for state, targets in TRANSITIONS.items())
    reached = {S.IDLE}
    for _ in TRANSITIONS:
        reached |= {target for state in reached for target in TRANSITIONS[state]}
    assert reached == set(TRANSITIONS)


def machine_in(state: SourceState) -> SourceStateMachine:
    """A machine brought to a state by a shortest way of legal transitions."""
    ways: list[list[SourceState]] = [[S.IDLE]]
    while (way := ways.pop(0))[-1] is not state:
        ways += [[*way, target] for target in TRANSITIONS[way[-1]]]
    machine = SourceStateMachine()
    for step in way[1:]:
        machine.transition(step)
    return machine


@pytest.mark.parametrize(("start", "to"), [(a, b) for a in TRANSITIONS for b in TRANSITIONS if a is not b])
def test_only_moves_of_the_table_are_legal(start, to):
    machine = machine_in(start)
    if to in TRANSITIONS[start]:
        machine.transition(to)
        assert machine.state is to
    else:
        with pytest.raises(IllegalTransitionError, match=f"from {start} to {to}"):
            machine.transition(to)
        assert machine.state is start


def test_a_conditional_move_is_made_only_from_its_state():
    machine = SourceStateMachine()
    machine.transition(S.STALLED, only_from=S.RUNNING)
    assert machine.state is S.IDLE


def test_a_failure_is_raised_after_the_good_frames_and_again():
    def play():
        yield np.zeros((48, 64, 3), np.uint8), 0.0
        raise VideoError("the rest is gone")

    source = PlaybackSource(INFO, play())
    assert source.read(WAIT_S).index == 0
    for _ in range(2):
        with pytest.raises(VideoError, match="the rest is gone"):
            source.read(WAIT_S)
    assert source.state is S.FAILED
    assert source.reason == "the rest is gone"
    source.close()
    assert source.state is S.ENDED


def test_playback_keeps_the_pictures_own_time():
    source = PlaybackSource(INFO, pictures(26))
    start = time.monotonic()
    frames = drain(source)
    took = time.monotonic() - start
    assert 0.48 <= took < 2.0  # 25 intervals of 20 ms, on a busy machine too
    assert frames[-1].index == 25
    assert all(frame.captured_at - start >= frame.time_s - 0.005 for frame in frames)
    assert source.state is S.ENDED
    source.close()


def test_playback_drops_what_nobody_came_for():
    played = itertools.count()
    last = 0

    def play():
        nonlocal last
        for picture in pictures():
            last = next(played)
            yield picture

    source = PlaybackSource(INFO, play())
    source.read(WAIT_S)
    wait_until(lambda: last >= 10)
    assert source.read(WAIT_S).index >= 9
    source.close()


@pytest.mark.slow
def test_playback_does_not_rush_after_a_pause():
    times = []

    def play():
        for number in range(12):
            if number == 3:
                time.sleep(0.9)  # the program was suspended, or the disk asleep
            times.append(time.monotonic())
            yield np.zeros((48, 64, 3), np.uint8), number * 0.05

    source = PlaybackSource(INFO, play())
    drain(source)
    assert times[-1] - times[4] >= 0.25  # of 0.35: it goes on at its own pace
    source.close()


def test_closing_a_source_is_quick():
    source = PlaybackSource(INFO, pictures(interval_s=60))
    source.read(WAIT_S)
    start = time.monotonic()
    source.close()
    source.close()
    assert time.monotonic() - start < 1
    assert source.state is S.ENDED
    assert source.read(0) is None


def test_read_waits_no_longer_than_told():
    source = PlaybackSource(INFO, pictures(interval_s=60))
    source.read(WAIT_S)
    start = time.monotonic()
    assert source.read(0.1) is None
    assert 0.09 <= time.monotonic() - start < 1
    source.close()


@pytest.mark.parametrize("size", [(1280, 720), (640, 480), (129, 97)])
@pytest.mark.parametrize("number", [0, 1, 255, 256, 123456, (1 << 24) - 1])
def test_the_patterns_number_is_read_back(size, number):
    assert read_number(draw_pattern(size, number)) == number


def test_the_patterns_number_survives_scaling_and_a_codec(tmp_path):
    path = tmp_path / "pattern.mp4"
    with VideoWriter(path, (640, 360), 30, crf=30) as video:
        for number in range(700, 715):
            video.write(draw_pattern((640, 360), number))
    with VideoReader(path) as video:
        assert [read_number(frame.image) for frame in video] == list(range(700, 715))
    small = cv2.resize(draw_pattern((1280, 720), 4711), (426, 240), interpolation=cv2.INTER_AREA)
    assert read_number(small) == 4711


def test_what_is_no_pattern_has_no_number():
    rng = np.random.default_rng(3)
    others = [np.zeros((96, 128, 3), np.uint8), np.full((96, 128, 3), 255, np.uint8)]
    others += [draw_pattern((256, 144), 5)[::-1], rng.integers(0, 256, (96, 128, 3), dtype=np.uint8)]
    assert [read_number(image) for image in others] == [None] * 4


def test_the_pattern_moves_and_is_numbered_by_its_index():
    source = pattern_source((320, 180), 100)
    frames = [source.read(WAIT_S) for _ in range(5)]
    assert [read_number(frame.image) for frame in frames] == [frame.index for frame in frames]
    assert [frame.time_s for frame in frames] == pytest.approx([frame.index / 100 for frame in frames])
    assert (frames[0].image[90] != frames[4].image[90]).any()
    source.close()
    with pytest.raises(InputError, match="64x48"):
        pattern_source((64, 48), 30)


def settings(source, fps=30.0):
    return SourceSettings(source=str(source), width=320, height=180, fps=fps)


@pytest.fixture
def clip(tmp_path):
    path = tmp_path / "clip.mp4"
    with VideoWriter(path, (320, 180), 25) as video:
        for number in range(10):
            video.write(draw_pattern((320, 180), number))
    return path


def test_a_video_file_loops_in_its_own_time_and_goes_on_counting(clip):
    source = open_source(settings(clip))
    assert source.describe() == SourceInfo("file", str(clip), (320, 180), 25.0)
    assert source.state is S.IDLE
    began = time.monotonic()
    frame = source.read(WAIT_S)
    assert read_number(frame.image) == frame.index < 10
    while frame.index < 12:
        frame = source.read(WAIT_S)
    assert read_number(frame.image) == frame.index % 10
    assert frame.time_s == pytest.approx(0.04 * frame.index)
    assert frame.captured_at - began >= frame.time_s - 0.005
    assert source.state is S.RUNNING
    source.close()


def test_a_picture_file_is_a_source(tmp_path):
    path = tmp_path / "still.png"
    image = draw_pattern((320, 180), 42)
    cv2.imwrite(str(path), image[..., ::-1])
    source = open_source(settings(path, fps=100))
    frames = [source.read(WAIT_S), source.read(WAIT_S)]
    assert frames[1].index > frames[0].index
    assert (frames[1].image == image).all()
    assert source.describe().kind == "still"
    source.close()


@pytest.mark.parametrize("name", ["pattern", "webcam"])
def test_a_file_that_exists_comes_before_a_plug_in_of_its_name(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with VideoWriter(tmp_path / "clip.mp4", (320, 180), 25) as writer:
        writer.write(draw_pattern((320, 180), 3), 0.0)
    (tmp_path / "clip.mp4").rename(name)
    source = open_source(settings(name))
    assert (source.describe().kind, source.describe().id) == ("file", name)
    source.close()


def test_the_pattern_is_a_source_by_name():
    source = open_source(settings("pattern"))
    assert read_number(source.read(WAIT_S).image) is not None
    assert source.describe().kind == "pattern"
    source.close()


def test_unknown_sources_say_what_there_is(tmp_path):
    tree = FakeTree(tmp_path / "tree")
    tree.add_webcam(0, "HD Webcam", by_id="usb-hd-video-index0")
    with pytest.raises(DeviceError, match=r"no webcam 'sofa'; there are: usb-hd-video-index0 \(HD Webcam\)"):
        open_source(settings("sofa"), tree=tree)
    with pytest.raises(VideoError, match=r"no file .*gone\.mp4; check the path"):
        open_source(settings(tmp_path / "gone.mp4"), tree=tree)
    with pytest.raises(DeviceError, match="there is no webcam;"):
        open_source(settings("webcam"), tree=DeviceFolders(tmp_path / "none", tmp_path / "none"))
    broken = tmp_path / "broken.png"
    broken.write_bytes(b"no picture")
    with pytest.raises(ImageError, match=r"broken\.png"):
        open_source(settings(broken), tree=tree)
    (tmp_path / "empty.mp4").touch()
    with pytest.raises(VideoError, match="is empty"):
        open_source(settings(tmp_path / "empty.mp4"), tree=tree)


class Opener:
    """Hands out prepared captures and remembers what was asked."""

    def __init__(self, *captures):
        self.captures, self.calls, self.times = list(captures), [], []

    def __call__(self, node, size, fps):
        self.calls.append((node, size, fps))
        self.times.append(time.monotonic())
        return self.captures.pop(0) if self.captures else FakeCapture()


@pytest.fixture
def tree(tmp_path):
    tree = FakeTree(tmp_path)
    tree.add_webcam(0, "HD Webcam", by_id="usb-hd-video-index0")
    return tree


def webcam(tree, *captures, stall_timeout_s=0.3, text="webcam"):
    opener = Opener(*captures)
    source = WebcamSource(text, (1280, 720), 30, tree=tree, open_capture=opener, stall_timeout_s=stall_timeout_s)
    return source, opener


def test_a_webcam_gives_rgb_frames_of_its_own_size(tree):
    capture = FakeCapture(size=(64, 48))
    source, opener = webcam(tree, capture, stall_timeout_s=WAIT_S)
    assert source.state is S.IDLE
    assert opener.calls == []  # nothing is opened before the first read
    before = time.monotonic()
    frames = [source.read(WAIT_S), source.read(WAIT_S)]
    assert opener.calls == [(str(tree.dev / "video0"), (1280, 720), 30)]
    assert tuple(frames[0].image[0, 0]) == (200, 20, 10)
    assert frames[1].index > frames[0].index
    assert before < frames[0].captured_at < frames[1].captured_at <= time.monotonic()
    assert source.state is S.RUNNING
    assert source.reason == ""
    assert source.describe() == SourceInfo("webcam", "usb-hd-video-index0", (64, 48), 30)
    source.close()
    assert capture.released
    assert capture.threads.isdisjoint({threading.get_ident()})  # OpenCV only ever in the reader thread
    assert len(capture.threads) == 1


def test_a_silent_webcam_is_stalled_then_reopened(tree):
    silent = FakeCapture()
    source, opener = webcam(tree, silent)
    assert source.read(WAIT_S) is not None
    silent.mode = "silent"
    wait_until(lambda: source.state is not S.RUNNING)
    assert source.state in (S.STALLED, S.RECONNECTING, S.OPENING)
    assert "gives no pictures" in source.reason
    wait_until(lambda: source.read(0.1) is not None and len(opener.calls) == 2)
    assert silent.released
    wait_until(lambda: source.state is S.RUNNING)
    source.close()


@pytest.mark.slow
def test_a_stuck_webcam_is_stalled_and_does_not_hold_up_closing(tree):
    capture = FakeCapture()
    source, _ = webcam(tree, capture)
    assert source.read(WAIT_S) is not None
    capture.mode = "stuck"
    wait_until(lambda: source.state is S.STALLED)
    assert source.reason == "HD Webcam gives no pictures"
    start = time.monotonic()
    source.close()
    assert time.monotonic() - start < 2.9
    assert source.state is S.ENDED
    capture.unstick.set()
    wait_until(lambda: capture.released)
    assert source.state is S.ENDED


def test_an_unplugged_webcam_comes_back_under_another_node(tree):
    capture = FakeCapture()
    source, opener = webcam(tree, capture)
    last = source.read(WAIT_S)
    tree.remove(0)
    capture.mode = "silent"
    wait_until(lambda: source.reason == "HD Webcam is unplugged")
    assert source.state in (S.RECONNECTING, S.OPENING)
    source.read(0)  # one that came before
    assert source.read(0.05) is None
    tree.add_webcam(3, "HD Webcam", usb="1-4:1.0", by_id="usb-hd-video-index0")
    wait_until(lambda: len(opener.calls) == 2)
    assert opener.calls[1][0] == str(tree.dev / "video3")
    frame = source.read(WAIT_S)
    assert frame.index > last.index
    assert frame.time_s > last.time_s
    assert source.reason == ""
    source.close()


@pytest.mark.slow
def test_a_busy_webcam_is_tried_again_at_growing_pauses(tree):
    busy = [FakeCapture(opened=False) for _ in range(3)]
    source, opener = webcam(tree, *busy)
    assert source.read(0) is None
    wait_until(lambda: "another program may be using it" in source.reason)
    assert source.read(WAIT_S) is not None
    assert all(capture.released for capture in busy)
    pauses = np.diff(opener.times)
    assert (pauses > 0.95 * np.array(BACKOFF_S[:3])).all()
    assert pauses[0] < BACKOFF_S[-1]
    source.close()


def test_closing_interrupts_the_pause_between_attempts(tree):
    source, _ = webcam(tree, *[FakeCapture(opened=False) for _ in range(9)])
    source.read(0.8)
    start = time.monotonic()
    source.close()
    assert time.monotonic() - start < 1


def test_a_webcam_that_is_missing_at_the_start_is_an_error(tree):
    with pytest.raises(DeviceError, match="no webcam 'usb-other'"):
        webcam(tree, text="usb-other")


def test_a_stall_is_four_frames_or_two_seconds() -> None:
    assert stall_timeout(30) == 2.0
    assert stall_timeout(1) == 4.0


def test_opencv_is_asked_for_motion_jpeg_first_and_a_queue_of_one(monkeypatch):
    from relit_camera.devices.sources import webcam_source as module

    asked = []

    class Recorder(FakeCapture):
        def __init__(self, node, api):
            super().__init__()
            asked.append((node, api))

        def set(self, key, value):
            asked.append((key, value))
            return True

    monkeypatch.setattr(module.cv2, "VideoCapture", Recorder)
    monkeypatch.setattr(module.sys, "platform", "linux")
    module.open_with_opencv("/dev/video7", (1280, 720), 30.0)
    assert asked == [
        ("/dev/video7", cv2.CAP_V4L2),
        (cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG")),
        (cv2.CAP_PROP_FRAME_WIDTH, 1280),
        (cv2.CAP_PROP_FRAME_HEIGHT, 720),
        (cv2.CAP_PROP_FPS, 30.0),
        (cv2.CAP_PROP_BUFFERSIZE, 1),
    ]
