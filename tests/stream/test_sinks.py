import errno
from itertools import repeat
from types import SimpleNamespace

import numpy as np
import pytest

from relit_camera.config.settings import OutputSettings
from relit_camera.errors import DeviceError, ImageError, InputError, StorageError, VideoError
from relit_camera.stream.devices import DeviceTree
from relit_camera.stream.holders import Holder
from relit_camera.stream.sinks import camera as camera_module
from relit_camera.stream.sinks import loopback
from relit_camera.stream.sinks.base import SinkInfo
from relit_camera.stream.sinks.camera import CameraSink
from relit_camera.stream.sinks.factory import open_sink, published_label
from relit_camera.stream.sinks.file import FileSink
from relit_camera.stream.sinks.null import NullSink
from relit_camera.stream.sources.pattern import draw_pattern, read_number
from relit_camera.video.reader import VideoReader
from tests.stream.fake_devices import FakeTree

SIZE = (320, 180)


class FakeCamera:
    """Stands for `pyvirtualcam.Camera`."""

    def __init__(self, width, height, fps, device):
        self.size, self.fps, self.device = (width, height), fps, device
        self.sent, self.closed, self.fails = [], False, False

    def send(self, image):
        assert not self.closed
        if self.fails:
            raise RuntimeError("error writing frame")
        assert image.shape == (self.size[1], self.size[0], 3)
        assert image.flags["C_CONTIGUOUS"]
        self.sent.append(image)

    def close(self):
        self.closed = True


class Opener:
    """Opens fake cameras, all remembered; the errors given are raised first."""

    def __init__(self, *errors):
        self.errors, self.cameras = list(errors), []

    def __call__(self, width, height, fps, device):
        if self.errors:
            raise self.errors.pop(0)
        self.cameras.append(FakeCamera(width, height, fps, device))
        return self.cameras[-1]


@pytest.fixture
def tree(tmp_path):
    tree = FakeTree(tmp_path)
    tree.add_loopback(3, "Other Cam")
    tree.add_loopback(10, "Relit Camera")
    return tree


def test_the_camera_is_found_by_its_label_and_opened_by_its_node(tree):
    opener = Opener()
    sink = CameraSink(SIZE, 30, tree=tree, open_camera=opener)
    image = draw_pattern(SIZE, 1)
    sink.write(image)
    (camera,) = opener.cameras
    assert (camera.size, camera.fps, camera.device) == (SIZE, 30, str(tree.dev / "video10"))
    assert (camera.sent[0] == image).all()
    assert sink.describe() == SinkInfo("camera", str(tree.dev / "video10"), SIZE)
    sink.close()
    sink.close()
    assert camera.closed


def test_a_node_may_be_named(tree):
    opener = Opener()
    CameraSink(SIZE, 30, device=str(tree.dev / "video3"), tree=tree, open_camera=opener)
    assert opener.cameras[0].device == str(tree.dev / "video3")


def test_pictures_are_scaled_to_the_size_that_the_device_kept(tree):
    def opener(width, height, fps, device):
        tree.set_format(10, "YU12:640x360@30\n")  # a reader still holds the device at its old size
        cameras.append(FakeCamera(width, height, fps, device))
        return cameras[-1]

    cameras = []
    sink = CameraSink(SIZE, 30, tree=tree, open_camera=opener)
    assert [camera.size for camera in cameras] == [SIZE, (640, 360)]
    assert cameras[0].closed
    sink.write(draw_pattern(SIZE, 77))
    assert cameras[1].sent[0].shape == (360, 640, 3)
    assert read_number(cameras[1].sent[0]) == 77
    assert sink.describe().size == (640, 360)


def test_a_size_that_is_told_only_after_the_first_picture_is_followed_too(tree):
    opener = Opener()
    sink = CameraSink(SIZE, 30, tree=tree, open_camera=opener)
    tree.set_format(10, "YU12:640x360@30\n")
    for number in range(3):
        sink.write(draw_pattern(SIZE, number))
    assert [camera.size for camera in opener.cameras] == [SIZE, (640, 360)]
    assert [read_number(image) for image in opener.cameras[1].sent] == [1, 2]


def test_odd_sizes_are_refused(tree):
    with pytest.raises(InputError, match="641x480"):
        CameraSink((641, 480), 30, tree=tree, open_camera=Opener())


def test_a_missing_camera_comes_with_its_command(tmp_path):
    with pytest.raises(DeviceError, match=r"not loaded; run: .*exclusive_caps=1 card_label=\"Relit Camera\""):
        CameraSink(SIZE, 30, tree=DeviceTree(tmp_path, tmp_path), open_camera=Opener())


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (RuntimeError("'v4l2loopback' backend: Device /dev/video10 is not a video output device."), "is in use"),
        (RuntimeError("'v4l2loopback' backend: Device /dev/video10 is already in use."), "is in use"),
        (RuntimeError("something else"), "cannot be opened: something else"),
        (ImportError("no such module"), "pip install pyvirtualcam"),
    ],
)
def test_what_pyvirtualcam_says_is_explained(tree, error, message):
    with pytest.raises(DeviceError, match=message):
        CameraSink(SIZE, 30, tree=tree, open_camera=Opener(error))


def test_no_permission_is_told_with_its_cure(tree, monkeypatch):
    monkeypatch.setattr(camera_module.os, "access", lambda *_: False)
    with pytest.raises(DeviceError, match=r"no permission .*usermod -aG video"):
        CameraSink(SIZE, 30, tree=tree, open_camera=Opener())


def test_after_a_failed_write_the_next_one_opens_again(tree):
    opener = Opener()
    sink = CameraSink(SIZE, 30, tree=tree, open_camera=opener)
    opener.cameras[0].fails = True
    with pytest.raises(DeviceError, match="takes no pictures"):
        sink.write(draw_pattern(SIZE, 0))
    assert opener.cameras[0].closed
    tree.remove(10)
    with pytest.raises(DeviceError, match="no virtual camera is called"):
        sink.write(draw_pattern(SIZE, 1))
    tree.add_loopback(10, "Relit Camera")
    sink.write(draw_pattern(SIZE, 2))
    assert read_number(opener.cameras[1].sent[0]) == 2


def test_a_second_relit_camera_is_refused_until_the_first_lets_go(tree):
    first, opener = CameraSink(SIZE, 30, tree=tree, open_camera=Opener()), Opener()
    with pytest.raises(DeviceError, match=r"another Relit Camera publishes to .*video10 already; stop that one"):
        CameraSink(SIZE, 30, tree=tree, open_camera=opener)
    assert opener.cameras == []
    first.close()
    CameraSink(SIZE, 30, tree=tree, open_camera=opener).close()
    assert len(opener.cameras) == 1


def test_a_camera_that_cannot_be_opened_is_not_claimed(tree):
    with pytest.raises(DeviceError, match="something else"):
        CameraSink(SIZE, 30, tree=tree, open_camera=Opener(RuntimeError("something else")))
    CameraSink(SIZE, 30, tree=tree, open_camera=Opener()).close()


@pytest.mark.parametrize(("text", "now"), [("\n", "was taken away or reset"), ("YU12:640x360@30\n", "is 640x360 now")])
def test_a_device_that_drops_what_is_written_is_noticed_and_opened_anew(tree, monkeypatch, text, now):
    monkeypatch.setattr(camera_module, "CHECK_S", 0.0)
    tree.set_format(10, "YU12:320x180@30\n")
    opener = Opener()
    sink = CameraSink(SIZE, 30, tree=tree, open_camera=opener)
    sink.write(draw_pattern(SIZE, 0))
    tree.set_format(10, text)
    with pytest.raises(DeviceError, match=f"takes no pictures: it {now}"):
        sink.write(draw_pattern(SIZE, 1))
    tree.set_format(10, "YU12:320x180@30\n")
    sink.write(draw_pattern(SIZE, 2))
    assert [camera.closed for camera in opener.cameras] == [True, False]


def test_only_uint8_pictures_are_taken(tree):
    sink = CameraSink(SIZE, 30, tree=tree, open_camera=Opener())
    with pytest.raises(ImageError, match="float32"):
        sink.write(np.zeros((180, 320, 3), np.float32))


class FakeDevice:
    """Answers the ioctl calls of `revive` as a loopback device would."""

    def __init__(self, monkeypatch, capabilities):
        import fcntl

        self.capabilities, self.calls = capabilities, []
        monkeypatch.setattr(fcntl, "ioctl", self.ioctl)

    def ioctl(self, device, request, argument):
        self.calls.append(request)
        if request == loopback.VIDIOC_QUERYCAP:
            assert len(argument) == 104
            argument[88:92] = self.capabilities.to_bytes(4, "little")
            return 0
        raise OSError(22, "Invalid argument")


@pytest.mark.parametrize(
    ("capabilities", "state", "revived"),
    [
        (0x05200000, None, True),  # neither capture nor output, no state file: 0.12 after its first writer
        (0x05200001, None, True),  # capture: its writer has gone, a reader has not
        (0x05200002, None, False),  # output: free already
        (0x05200000, "output", False),  # newer versions have no need
    ],
)
def test_only_a_stuck_device_is_revived(tmp_path, monkeypatch, capabilities, state, revived):
    tree = FakeTree(tmp_path)
    node = tree.add_loopback(10, "Relit Camera", state=state)
    monkeypatch.setattr(loopback.sys, "platform", "linux")
    device = FakeDevice(monkeypatch, capabilities)
    assert loopback.revive(node, tree) is revived
    assert (loopback.VIDIOC_STREAMON in device.calls) is revived


@pytest.mark.parametrize("is_reader", [True, False])
def test_a_stuck_device_is_revived_beside_readers_only(tmp_path, monkeypatch, is_reader):
    tree = FakeTree(tmp_path)
    node = tree.add_loopback(10, "Relit Camera")
    monkeypatch.setattr(loopback.sys, "platform", "linux")
    monkeypatch.setattr(loopback, "holders", lambda _: [Holder(7, "program")])
    monkeypatch.setattr(loopback, "maps", lambda holder, _: is_reader)
    FakeDevice(monkeypatch, 0x05200001)
    assert loopback.revive(node, tree) is is_reader


def test_what_is_no_video_device_is_left_alone(tree):
    assert loopback.revive(str(tree.dev / "video10"), tree) is False
    assert loopback.revive(str(tree.dev / "video99"), tree) is False


def test_a_file_keeps_the_times_of_publishing(tmp_path, monkeypatch):
    from relit_camera.stream.sinks import file as module

    clock = iter([100.0, 100.1, 100.15, 101.0])
    monkeypatch.setattr(module.time, "monotonic", lambda: next(clock))
    path = tmp_path / "out.mp4"
    sink = FileSink(path, SIZE, 30)
    for number in range(4):
        sink.write(draw_pattern(SIZE, number))
    assert not path.exists()
    sink.close()
    monkeypatch.undo()
    assert sink.describe() == SinkInfo("file", str(path), SIZE)
    with VideoReader(path) as video:
        frames = list(video)
    assert [read_number(frame.image) for frame in frames] == [0, 1, 2, 3]
    assert [frame.time_s for frame in frames] == pytest.approx([0, 0.1, 0.15, 1.0], abs=1e-3)


def test_a_file_that_failed_is_lost_and_says_so_to_the_end(tmp_path, monkeypatch):
    path = tmp_path / "out.mp4"
    sink = FileSink(path, SIZE, 30)
    sink.write(draw_pattern(SIZE, 0))
    with pytest.raises(ImageError):
        sink.write(draw_pattern((128, 96), 1))  # no failure of the file

    def full(packet):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(sink._video, "_container", SimpleNamespace(mux=full))
    said = r"out\.mp4: Input/output error"
    with pytest.raises(StorageError, match=said):  # the encoder keeps some pictures before it gives the first away
        any(map(sink.write, repeat(draw_pattern(SIZE, 1), 100)))
    assert list(tmp_path.iterdir()) == []
    for call in (lambda: sink.write(draw_pattern(SIZE, 100)), sink.close, sink.close):
        with pytest.raises(StorageError, match=said):
            call()
    assert list(tmp_path.iterdir()) == []


def test_the_null_sink_counts_and_keeps_the_last():
    sink = NullSink(SIZE)
    for number in range(3):
        sink.write(draw_pattern(SIZE, number))
    assert sink.count == 3
    assert read_number(sink.last) == 2
    sink.close()


def test_the_camera_published_to_is_known_by_its_label(tree):
    assert published_label(settings(tree.dev / "video3"), tree) == "Other Cam"
    assert published_label(settings("camera"), tree) == "Relit Camera"
    assert published_label(settings("null"), tree) == "Relit Camera"


def settings(sink):
    return OutputSettings(sink=str(sink), width=320, height=180)


def test_sinks_are_opened_by_name(tmp_path, tree, monkeypatch):
    opener = Opener()
    monkeypatch.setattr(camera_module, "_pyvirtualcam", opener)
    assert isinstance(open_sink(settings("null")), NullSink)
    assert open_sink(settings("camera"), tree).describe().id == str(tree.dev / "video10")
    assert open_sink(settings(tree.dev / "video3"), tree).describe().id == str(tree.dev / "video3")
    file = open_sink(settings(tmp_path / "out.mkv"))
    assert file.describe().kind == "file"
    file.close()
    assert not (tmp_path / "out.mkv").exists()  # nothing was written


def test_unknown_sinks_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"unknown sink 'cloud'; use camera, null, /dev/videoN, or a file ending in"):
        open_sink(settings("cloud"))
    with pytest.raises(StorageError, match="create the folder"):
        open_sink(settings(tmp_path / "nowhere" / "out.mp4"))
    with pytest.raises(VideoError):
        FileSink(tmp_path / "out.txt", SIZE, 30)
