import contextlib
import errno
import inspect
from itertools import repeat
from pathlib import Path
from types import SimpleNamespace

import av
import cv2
import numpy as np
import pytest

from relit_camera.base.config.settings import OutputSettings
from relit_camera.base.errors import DeviceError, ImageError, InputError, StorageError, VideoError
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.devices import v4l2, v4l2loopback_output
from relit_camera.devices.device_discovery import DeviceFolders
from relit_camera.devices.device_users import DeviceUser
from relit_camera.devices.sinks import call_app_cameras, camera_device
from relit_camera.devices.sinks import virtual_camera_sink as camera_module
from relit_camera.devices.sinks.sink import NullSink, SinkInfo
from relit_camera.devices.sinks.sink_factory import open_sink, published_label
from relit_camera.devices.sinks.video_file_sink import VideoFileSink
from relit_camera.devices.sinks.virtual_camera_sink import VirtualCameraSink
from relit_camera.devices.sources.pattern_source import draw_pattern
from tests.devices.fake_devices import FakeTree
from tests.vm.guest.pattern_number import read_number

SIZE = (320, 180)


class FakeOutput:
    """Stands for a device that is open."""

    def __init__(self, size, fps, node):
        self.size, self.fps, self.node = size, fps, node
        self.sent, self.closed, self.fails = [], False, False

    def send(self, image):
        assert not self.closed
        if self.fails:
            raise OSError(errno.EIO, "Input/output error")
        assert image.shape == (self.size[1], self.size[0], 3)
        assert image.flags["C_CONTIGUOUS"]
        self.sent.append(image)

    def close(self):
        self.closed = True


class Opener:
    """Opens fake devices, all remembered; the errors given are raised first."""

    def __init__(self, *errors, size=None):
        self.errors, self.size, self.cameras = list(errors), size, []

    def __call__(self, size, fps, node):
        if self.errors:
            raise self.errors.pop(0)
        self.cameras.append(FakeOutput(self.size or size, fps, node))
        return self.cameras[-1]


@pytest.fixture
def tree(tmp_path):
    tree = FakeTree(tmp_path)
    tree.add_loopback(3, "Other Cam")
    tree.add_loopback(10, "Relit Camera")
    return tree


def test_the_camera_is_found_by_its_label_and_opened_by_its_node(tree):
    opener = Opener()
    sink = VirtualCameraSink(SIZE, 30, tree=tree, open_output=opener)
    image = draw_pattern(SIZE, 1)
    sink.write(image)
    (camera,) = opener.cameras
    assert (camera.size, camera.fps, camera.node) == (SIZE, 30, str(tree.dev / "video10"))
    assert (camera.sent[0] == image).all()
    assert sink.describe() == SinkInfo("camera", str(tree.dev / "video10"), SIZE)
    sink.close()
    sink.close()
    assert camera.closed


def test_a_node_may_be_named(tree):
    opener = Opener()
    VirtualCameraSink(SIZE, 30, device=str(tree.dev / "video3"), tree=tree, open_output=opener)
    assert opener.cameras[0].node == str(tree.dev / "video3")


def test_pictures_fill_the_size_that_the_device_kept(tree):
    opener = Opener(size=(240, 240))  # a reader still holds the device at its old size
    sink = VirtualCameraSink(SIZE, 30, tree=tree, open_output=opener)
    picture = np.zeros((180, 320, 3), np.uint8)
    picture[:, 70:250] = 200  # the square that is kept
    sink.write(picture)
    assert (opener.cameras[0].sent[0] == 200).mean() > 0.97
    assert sink.describe().size == (240, 240)


def test_odd_sizes_are_refused(tree):
    with pytest.raises(InputError, match="641x480"):
        VirtualCameraSink((641, 480), 30, tree=tree, open_output=Opener())


def test_a_missing_camera_comes_with_its_command(tmp_path):
    with pytest.raises(DeviceError, match=r"not loaded; run: .*exclusive_caps=1 card_label=\"Relit Camera\""):
        VirtualCameraSink(SIZE, 30, tree=DeviceFolders(tmp_path, tmp_path), open_output=Opener())


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (OSError(errno.EBUSY, "a program still shows it"), "is in use: a program still shows it; stop"),
        (OSError(errno.EBUSY, "Device or resource busy"), "is in use: Device or resource busy; stop that program"),
        (OSError(errno.ENOTTY, "Inappropriate ioctl for device"), "cannot be opened: Inappropriate ioctl for device"),
        (RuntimeError("no backend"), "there is no virtual camera: no backend; `relit doctor` says"),
        (ImportError("no such module"), "pyvirtualcam cannot be used: no such module; `relit doctor` says"),
    ],
)
def test_why_it_cannot_be_opened_is_explained(tree, error, message):
    with pytest.raises(DeviceError, match=message):
        VirtualCameraSink(SIZE, 30, tree=tree, open_output=Opener(error))


def test_faults_of_ours_are_not_explained_away(tree):
    with pytest.raises(KeyError):
        VirtualCameraSink(SIZE, 30, tree=tree, open_output=Opener(KeyError("of ours")))


def test_no_permission_is_told_with_its_cure(tree, monkeypatch):
    monkeypatch.setattr(camera_device.os, "access", lambda *_: False)
    with pytest.raises(DeviceError, match=r"no permission .*usermod -aG video"):
        VirtualCameraSink(SIZE, 30, tree=tree, open_output=Opener())


def test_after_a_failed_write_the_next_one_opens_again(tree):
    opener = Opener()
    sink = VirtualCameraSink(SIZE, 30, tree=tree, open_output=opener)
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
    first, opener = VirtualCameraSink(SIZE, 30, tree=tree, open_output=Opener()), Opener()
    with pytest.raises(DeviceError, match=r"another Relit Camera publishes to .*video10 already; stop that one"):
        VirtualCameraSink(SIZE, 30, tree=tree, open_output=opener)
    assert opener.cameras == []
    first.close()
    VirtualCameraSink(SIZE, 30, tree=tree, open_output=opener).close()
    assert len(opener.cameras) == 1


def test_a_camera_that_cannot_be_opened_is_not_claimed(tree):
    with pytest.raises(DeviceError, match="something else"):
        VirtualCameraSink(SIZE, 30, tree=tree, open_output=Opener(OSError(errno.EIO, "something else")))
    VirtualCameraSink(SIZE, 30, tree=tree, open_output=Opener()).close()


def test_elsewhere_pyvirtualcam_is_the_camera(monkeypatch):
    import pyvirtualcam

    calls = []

    class Camera:
        device = "OBS Virtual Camera"

        def __init__(self, width, height, fps, device):
            calls.append((width, height, fps, device))

        def send(self, image):
            calls.append(image)

        def close(self):
            calls.append("closed")

    assert {"width", "height", "fps", "device"} <= set(inspect.signature(pyvirtualcam.Camera).parameters)
    monkeypatch.setattr(pyvirtualcam, "Camera", Camera)
    monkeypatch.setattr(camera_device.sys, "platform", "darwin")
    sink = VirtualCameraSink(SIZE, 30)
    image = draw_pattern(SIZE, 1)
    sink.write(image)
    sink.close()
    assert sink.describe() == SinkInfo("camera", "OBS Virtual Camera", SIZE)
    assert calls[0] == (*SIZE, 30, None)
    assert (calls[1] == image).all()
    assert calls[2] == "closed"


def test_only_uint8_pictures_are_taken(tree):
    sink = VirtualCameraSink(SIZE, 30, tree=tree, open_output=Opener())
    with pytest.raises(ImageError, match="float32"):
        sink.write(np.zeros((180, 320, 3), np.float32))


class FakeDevice:
    """Answers ioctl calls as a loopback device would."""

    def __init__(self, monkeypatch, capabilities, kept=None, refuses=False):
        import fcntl

        self.capabilities, self.kept, self.refuses, self.calls = capabilities, kept, refuses, []
        monkeypatch.setattr(fcntl, "ioctl", self.ioctl)

    def ioctl(self, device, request, argument):
        self.calls.append(request)
        if request == v4l2.VIDIOC_QUERYCAP:
            assert len(argument) == 104
            argument[88:92] = self.capabilities.to_bytes(4, "little")
            return 0
        if request in (v4l2.VIDIOC_S_FMT, v4l2.VIDIOC_G_FMT):
            assert len(argument) == 208
            asked = int.from_bytes(argument[8:12], "little"), int.from_bytes(argument[12:16], "little")
            if self.refuses and request == v4l2.VIDIOC_S_FMT and asked != self.kept[:2]:
                raise OSError(errno.EBUSY, "Device or resource busy")
            if self.kept is not None:
                width, height, layout = self.kept
                argument[8:20] = width.to_bytes(4, "little") + height.to_bytes(4, "little") + layout
            return 0
        raise OSError(22, "Invalid argument")


CAPTURE, OUTPUT, NEITHER = 0x05200001, 0x05200002, 0x05200000


def test_a_device_is_written_to_as_i420(tree, monkeypatch):
    FakeDevice(monkeypatch, OUTPUT)
    node = str(tree.dev / "video10")
    device = camera_module.LoopbackCamera(SIZE, node)
    image = draw_pattern(SIZE, 5)
    device.send(image)
    device.close()
    device.close()
    written = np.fromfile(node, np.uint8).reshape(270, 320)
    shown = cv2.cvtColor(written, cv2.COLOR_YUV2RGB_I420)
    assert read_number(shown) == 5
    assert np.median(np.abs(shown.astype(int) - image)) <= 1
    assert device.size == SIZE


@pytest.mark.parametrize("refuses", [False, True])
def test_a_device_says_which_size_it_kept(tree, monkeypatch, refuses):
    FakeDevice(monkeypatch, OUTPUT, kept=(640, 360, b"YU12"), refuses=refuses)
    with contextlib.closing(camera_module.LoopbackCamera(SIZE, str(tree.dev / "video10"))) as device:
        assert device.size == (640, 360)


@pytest.mark.parametrize(
    ("capabilities", "kept", "message"),
    [
        (CAPTURE, None, "another program publishes to it"),
        (OUTPUT, (*SIZE, b"YUYV"), "still shows it in the layout YUYV"),
    ],
)
def test_a_device_that_is_not_free_is_let_go_at_once(tree, monkeypatch, capabilities, kept, message):
    FakeDevice(monkeypatch, capabilities, kept)
    with pytest.raises(OSError, match=message) as raised:
        camera_module.LoopbackCamera(SIZE, str(tree.dev / "video10"))
    assert raised.value.errno == errno.EBUSY
    opened = [str(each.readlink()) for each in Path("/proc/self/fd").iterdir() if each.is_symlink()]
    assert str(tree.dev / "video10") not in opened


@pytest.mark.parametrize("fault", ["short", "error"])
def test_a_write_that_fails_is_told_and_the_device_opened_anew(tree, monkeypatch, fault):
    FakeDevice(monkeypatch, OUTPUT)
    sink = VirtualCameraSink(SIZE, 30, tree=tree)
    sink.write(draw_pattern(SIZE, 0))

    def write(descriptor, data):
        if fault == "error":
            raise OSError(errno.ENODEV, "No such device")
        return len(data) - 1

    with monkeypatch.context() as faulty:
        faulty.setattr(v4l2loopback_output.os, "write", write)
        for number in range(3):
            with pytest.raises(DeviceError, match=r"video10 takes no pictures: .*(No such device|bytes were taken)"):
                sink.write(draw_pattern(SIZE, number))
    sink.write(draw_pattern(SIZE, 4))
    sink.close()


@pytest.mark.parametrize(
    ("capabilities", "state", "revived"),
    [
        (NEITHER, None, True),  # neither capture nor output, no state file: 0.12 after its first writer
        (CAPTURE, None, False),  # capture, and nobody can be seen: a writer may be another user's
        (OUTPUT, None, False),  # output: free already
        (NEITHER, "output", False),  # newer versions have no need
    ],
)
def test_only_a_stuck_device_is_revived(tmp_path, monkeypatch, capabilities, state, revived):
    tree = FakeTree(tmp_path)
    node = tree.add_loopback(10, "Relit Camera", state=state)
    monkeypatch.setattr(v4l2loopback_output.sys, "platform", "linux")
    device = FakeDevice(monkeypatch, capabilities)
    assert v4l2loopback_output.reset_stuck_device(node, tree) is revived
    assert (v4l2.VIDIOC_STREAMON in device.calls) is revived


@pytest.mark.parametrize("is_reader", [True, False])
def test_a_stuck_device_is_revived_beside_readers_only(tmp_path, monkeypatch, is_reader):
    tree = FakeTree(tmp_path)
    node = tree.add_loopback(10, "Relit Camera")
    monkeypatch.setattr(v4l2loopback_output.sys, "platform", "linux")
    monkeypatch.setattr(v4l2loopback_output, "find_device_users", lambda _: [DeviceUser(7, "program")])
    monkeypatch.setattr(v4l2loopback_output, "has_mapped_buffers", lambda user, _: is_reader)
    FakeDevice(monkeypatch, CAPTURE)
    assert v4l2loopback_output.reset_stuck_device(node, tree) is is_reader


def test_what_is_no_video_device_is_left_alone(tree):
    assert v4l2loopback_output.reset_stuck_device(str(tree.dev / "video10"), tree) is False
    assert v4l2loopback_output.reset_stuck_device(str(tree.dev / "video99"), tree) is False


def test_a_file_keeps_the_times_of_publishing(tmp_path, monkeypatch):
    from relit_camera.devices.sinks import video_file_sink as module

    clock = iter([100.0, 100.1, 100.15, 101.0])
    monkeypatch.setattr(module.time, "monotonic", lambda: next(clock))
    path = tmp_path / "out.mp4"
    sink = VideoFileSink(path, SIZE, 30)
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
    with av.open(str(path)) as film:
        assert film.streams.video[0].start_time == 0  # the reader counts from the first picture, players do not


def test_a_file_that_failed_is_lost_and_says_so_to_the_end(tmp_path, monkeypatch):
    path = tmp_path / "out.mp4"
    sink = VideoFileSink(path, SIZE, 30)
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
    (tree.dev / "video-mine").symlink_to("video3")
    assert published_label(settings(tree.dev / "video-mine"), tree) == "Other Cam"
    assert published_label(settings("camera"), tree) == "Relit Camera"
    assert published_label(settings("null"), tree) == "Relit Camera"


def settings(sink):
    return OutputSettings(sink=str(sink), width=320, height=180)


def test_sinks_are_opened_by_name(tmp_path, tree, monkeypatch):
    opener = Opener()
    monkeypatch.setattr(camera_module, "_open_output", opener)
    monkeypatch.setattr(call_app_cameras, "LoopbackCamera", lambda size, node, convert: opener(size, 30, node))
    assert isinstance(open_sink(settings("null")), NullSink)
    assert open_sink(settings("camera"), tree).describe().id == str(tree.dev / "video10")
    (tree.dev / "mine").symlink_to("video3")
    for name in ("video3", "mine"):
        with contextlib.closing(open_sink(settings(tree.dev / name), tree)) as sink:
            assert sink.describe().id == str(tree.dev / "video3")
    file = open_sink(settings(tmp_path / "out.mkv"))
    assert file.describe().kind == "file"
    file.close()
    assert not (tmp_path / "out.mkv").exists()  # nothing was written


def test_unknown_sinks_are_refused(tmp_path):
    with pytest.raises(
        InputError, match=r"unknown sink 'cloud'; use camera, null, pipewire, /dev/videoN, or a file ending in"
    ):
        open_sink(settings("cloud"))
    with pytest.raises(StorageError, match="create the folder"):
        open_sink(settings(tmp_path / "nowhere" / "out.mp4"))
    with pytest.raises(VideoError):
        VideoFileSink(tmp_path / "out.txt", SIZE, 30)
