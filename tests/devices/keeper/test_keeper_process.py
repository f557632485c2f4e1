"""Keepers as real processes: cameras that are killed, restarted, upgraded, doubled, and what a reader would see."""

from __future__ import annotations

import os
import signal
import socket
import stat
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from relit_camera.base.errors import DeviceError
from relit_camera.devices.device_users import KEEPER_MODULE
from relit_camera.devices.keeper.keeper_socket import MessageSocket, mapped, require_private_folder, shared_memory
from relit_camera.devices.keeper.kept_output import OutputOptions
from relit_camera.devices.keeper.sink_keeper import SinkKeeper
from tests.devices.keeper.stand_in_sink import FPS, KEEP_S, OPENER, PLACEHOLDER, VARIABLE, Noted, noted, runs
from tests.lateness import Lateness
from tests.small_camera import WAIT_S, wait_until

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="keepers are Linux's")

LONGEST_GAP_S = 0.2
"""But for what a busy machine makes any process wait."""
ROOT = Path(__file__).resolve().parents[3]


class Stage:
    """Cameras, one after the other, and what their keepers show."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.pictures = folder / "run", folder / "pictures.jsonl"
        self._cameras: list[subprocess.Popen[str]] = []
        self._lateness = Lateness()
        self._lateness.__enter__()

    def camera(self, grey: int, version: str = "", width: int = 64, keep_s: float = KEEP_S) -> subprocess.Popen[str]:
        """Start a camera that shows this grey."""
        module = "tests.devices.keeper.publishing_camera"
        return self.spawn(sys.executable, "-m", module, str(self.folder), str(grey), version, str(width), str(keep_s))

    def spawn(self, *command: str) -> subprocess.Popen[str]:
        """Start a process, which ends with the stage."""
        started = subprocess.Popen(
            command, cwd=ROOT, env={**os.environ, VARIABLE: str(self.pictures), "PYTHONPATH": str(ROOT)},
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        self._cameras.append(started)
        return started

    def shown(self) -> list[Noted]:
        return noted(self.pictures)

    def wait_for(self, value: int, count: int = 20) -> None:
        """Wait until a grey was shown so often."""
        wait_until(lambda: sum(picture.value == value for picture in self.shown()) >= count)

    def goes_on(self, count: int = 20) -> None:
        """Wait for so many more pictures."""
        before = len(self.shown())
        wait_until(lambda: len(self.shown()) >= before + count)

    def gap_s(self) -> float:
        """The longest between two pictures, but for what the machine made any process wait in it."""
        return self._lateness.longest_gap_s(picture.at for picture in self.shown())

    def keepers(self) -> set[int]:
        """The processes that have shown something and still run."""
        return {process for process in {picture.process for picture in self.shown()} if runs(process)}

    def close(self) -> None:
        self._lateness.__exit__()
        for camera in self._cameras:
            camera.kill()
            camera.communicate()
        for keeper in self.keepers():
            with suppress(ProcessLookupError):
                os.kill(keeper, signal.SIGKILL)


@pytest.fixture
def stage(tmp_path: Path) -> Iterator[Stage]:
    made = Stage(tmp_path)
    yield made
    made.close()


@pytest.fixture
def bridged(stage: Stage, note_row: Callable[[str, tuple[str, ...]], None]) -> Callable[..., None]:
    """Called when pictures come again after something has happened: notes the gap, which no reader may have noticed."""

    def note(what: str, most_s: float = LONGEST_GAP_S) -> None:
        gap_s = stage.gap_s()
        note_row("a camera whose keeper goes on", (what, f"{1e3 * gap_s:.0f} ms"))
        assert gap_s < most_s

    return note


def leave(camera: subprocess.Popen[str], how: str) -> None:
    """Tell a camera to leave, and wait until it has."""
    camera.communicate(f"{how}\n", timeout=WAIT_S)
    assert camera.returncode == 0


@pytest.mark.slow
def test_kill_9_and_a_new_start_are_no_gap_for_readers(stage: Stage, bridged: Callable[..., None]) -> None:
    first = stage.camera(10)
    stage.wait_for(10)
    first.kill()
    first.wait()
    stage.goes_on()  # nobody is there
    stage.camera(20)
    stage.wait_for(20)
    values = [picture.value for picture in stage.shown()]
    assert values[-1] == 20
    assert sorted(values, key=(PLACEHOLDER, 10, 20).index) == values
    assert len({picture.process for picture in stage.shown()}) == 1
    bridged("the camera is killed and started again")


@pytest.mark.slow
def test_a_camera_that_leaves_ends_its_keeper(stage: Stage) -> None:
    first = stage.camera(10, keep_s=10 * WAIT_S)
    stage.wait_for(10)
    leave(first, "end")
    wait_until(lambda: stage.keepers() == set())


@pytest.mark.slow
def test_a_camera_that_is_restarted_hands_over(stage: Stage, bridged: Callable[..., None]) -> None:
    first = stage.camera(10)
    stage.wait_for(10)
    leave(first, "hand-over")
    stage.goes_on()
    stage.camera(20)
    stage.wait_for(20)
    assert len({picture.process for picture in stage.shown()}) == 1
    bridged("the camera hands over")


@pytest.mark.slow
def test_a_camera_of_another_version_replaces_the_keeper(stage: Stage, bridged: Callable[..., None]) -> None:
    first = stage.camera(10)
    stage.wait_for(10)
    first.kill()
    first.wait()
    stage.camera(20, version="another")
    stage.wait_for(20)
    old, new = dict.fromkeys(picture.process for picture in stage.shown())
    assert stage.keepers() == {new}
    # The old one goes on until the new one has started.
    last_at = max(picture.at for picture in stage.shown() if picture.process == old)
    assert last_at > psutil.Process(new).create_time() - time.time() + time.monotonic()
    bridged("a camera of another version, whose keeper takes over", 2 * LONGEST_GAP_S)  # the device is opened again


@pytest.mark.slow
def test_a_camera_of_another_size_has_the_device_opened_anew(stage: Stage, bridged: Callable[..., None]) -> None:
    first = stage.camera(10)
    stage.wait_for(10)
    first.kill()
    first.wait()
    stage.goes_on()
    stage.camera(20, width=128)
    stage.wait_for(20)
    assert len({picture.process for picture in stage.shown()}) == 1
    bridged("a camera of another size")


@pytest.mark.slow
def test_a_second_camera_is_refused(stage: Stage) -> None:
    stage.camera(10)
    stage.wait_for(10)
    second = stage.camera(20)
    _, said = second.communicate(timeout=WAIT_S)
    assert second.returncode == 1
    assert said.strip() == (
        "another Relit Camera publishes to stand-in already; "
        "stop that one (relit doctor names its process), or give this one a name of its own: output.label"
    )
    stage.wait_for(10, len(stage.shown()) + 5)


@pytest.mark.slow
def test_a_keeper_that_nobody_comes_for_ends(stage: Stage) -> None:
    first = stage.camera(10, keep_s=2)
    stage.wait_for(10)
    first.kill()
    first.wait()
    seen = len(stage.shown())
    wait_until(lambda: not stage.keepers(), KEEP_S / 2)
    assert len(stage.shown()) > seen + 10  # of some sixty
    assert not any(path.is_socket() for path in stage.folder.iterdir())


@pytest.mark.slow
def test_a_keeper_that_is_killed_is_replaced_at_once(stage: Stage, bridged: Callable[..., None]) -> None:
    stage.camera(10)
    stage.wait_for(10)
    (keeper,) = stage.keepers()
    os.kill(keeper, signal.SIGKILL)
    seen = len(stage.shown())
    stage.wait_for(10, seen + 20)
    assert stage.shown()[-1].process != keeper
    bridged("the keeper is killed", 5.0)  # a start of Python


ODD_KEEPER = """
import os, socket, sys
listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
listener.bind(sys.argv[1])
listener.listen()
print("listens", flush=True)
while True:
    camera = listener.accept()[0]
    while camera.recv(1 << 16) and sys.argv[2]:
        camera.send(sys.argv[2].encode())
    camera.close()
"""
"""Answers everything with the same text; with none, it hangs up."""


def odd_keeper(stage: Stage, answer: str, path: Path | None = None) -> subprocess.Popen[str]:
    """Start it at a path, or where the stage's cameras look for theirs."""
    require_private_folder(stage.folder)
    path = path or SinkKeeper(OutputOptions((64, 32), FPS, "Relit Camera", sink=OPENER), KEEP_S, stage.folder).path
    odd = stage.spawn(sys.executable, "-c", ODD_KEEPER, str(path), answer)
    assert odd.stdout is not None
    assert odd.stdout.readline() == "listens\n"
    return odd


@pytest.mark.slow
def test_a_keeper_whose_answers_cannot_be_read_is_ended_and_replaced(stage: Stage) -> None:
    odd = odd_keeper(stage, '{"info": {"pipewire": [1, ["cut in the mid')
    stage.camera(10)
    stage.wait_for(10)
    assert odd.wait(WAIT_S) == -signal.SIGKILL


@pytest.mark.slow
def test_without_a_keeper_none_is_left_that_holds_the_virtual_camera(stage: Stage) -> None:
    odd = odd_keeper(stage, "")
    camera = stage.camera(10)
    assert camera.stdout is not None
    assert "published without a keeper" in camera.stdout.readline()
    assert odd.wait(WAIT_S) == -signal.SIGKILL


@pytest.mark.slow
def test_another_version_that_hears_no_goodbye_is_ended(stage: Stage) -> None:
    odd = odd_keeper(stage, '{"other_version": "0.0.1 1"}')
    stage.camera(10)
    stage.wait_for(10)
    assert odd.wait(WAIT_S) == -signal.SIGKILL


def test_a_keeper_of_another_camera_is_left_alone(stage: Stage) -> None:
    odd = odd_keeper(stage, '{"busy": "/dev/video10"}')
    _, said = stage.camera(10).communicate(timeout=WAIT_S)
    assert "publishes to /dev/video10 already" in said
    assert odd.poll() is None


def test_where_a_device_is_named_the_cure_is_another_one(stage: Stage) -> None:
    keeper = SinkKeeper(OutputOptions((64, 32), FPS, "Relit Camera", "/dev/video10"), KEEP_S, stage.folder)
    odd_keeper(stage, '{"busy": "/dev/video10"}', keeper.path)
    with pytest.raises(DeviceError, match=r"or give this one a device of its own: output\.sink$"):
        keeper.greet()


@pytest.mark.slow
def test_a_camera_that_is_stopped_for_a_while_is_bridged(stage: Stage, bridged: Callable[..., None]) -> None:
    first = stage.camera(10)
    stage.wait_for(10)
    first.send_signal(signal.SIGSTOP)
    stage.goes_on()
    first.send_signal(signal.SIGCONT)
    stage.goes_on()
    bridged("the camera stands still")


@pytest.mark.slow
def test_its_socket_is_its_user_s_alone_and_it_is_small(stage: Stage) -> None:
    stage.camera(10)
    stage.wait_for(10)
    assert stat.S_IMODE(stage.folder.stat().st_mode) == 0o700
    (path,) = (path for path in stage.folder.iterdir() if path.is_socket())
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(Path(f"{path}.lock").stat().st_mode) == 0o600


def test_without_a_library_it_is_small() -> None:
    # What holds a v4l2loopback device; the stand-in needs numpy.
    code = f"import sys, {KEEPER_MODULE}; print(' '.join(sys.modules))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert {"numpy", "cv2", "pydantic", "onnxruntime", "platformdirs"} & set(loaded) == set()


def test_a_folder_of_others_is_refused(tmp_path: Path) -> None:
    open_to_all = tmp_path / "open"
    open_to_all.mkdir()
    open_to_all.chmod(0o755)
    with pytest.raises(DeviceError, match="is not a folder that you alone may enter; set XDG_RUNTIME_DIR"):
        require_private_folder(open_to_all)
    link = tmp_path / "link"
    link.symlink_to(open_to_all)
    with pytest.raises(DeviceError, match="not a folder"):
        require_private_folder(link)
    require_private_folder(tmp_path / "own")


def test_memory_that_could_be_cut_short_is_refused(tmp_path: Path) -> None:
    with (tmp_path / "file").open("w+b") as file:
        file.truncate(100)
        with pytest.raises((OSError, ValueError), match=r"sealed|Invalid"):
            mapped(file.fileno())
    descriptor = shared_memory(100)
    try:
        with pytest.raises(OSError, match="not permitted"):
            os.ftruncate(descriptor, 50)
        assert len(mapped(descriptor)) == 100
    finally:
        os.close(descriptor)


def test_messages_have_both_ends_and_their_user() -> None:
    one, other = (MessageSocket(end) for end in socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET))
    assert one.peer() == (os.getpid(), os.getuid())
    one.send({"picture": 1})
    assert other.receive() == ({"picture": 1}, None)
    one.socket.send(b"[1]")
    with pytest.raises(ValueError, match="object"):
        other.receive()
    one.close()
    with pytest.raises(EOFError):
        other.receive()
    other.close()
