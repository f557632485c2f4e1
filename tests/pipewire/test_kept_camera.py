"""A camera in PipeWire that is killed, upgraded and restarted, as a reader sees it: its keeper holds the node."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator

import pytest

from relit_camera.devices.keeper.keeper_process import PROTOCOL, VERSION
from tests.lateness import Lateness
from tests.pipewire.conftest import PatternCamera
from tests.pipewire.reader import Reader
from tests.pipewire.session import WAIT_S, Session, wait_for
from tests.pipewire.test_pipewire_camera import LABEL, WITHIN, Notes, found

LONGEST_GAP_S = 1.0
"""But for what a busy machine makes any process wait. It is two hundred milliseconds where the machine has time."""
KEPT = "--keep-s", "60"
OTHER_VERSION = f"0.0.0 {PROTOCOL}"
StartCamera = Callable[..., PatternCamera]


@pytest.fixture
def reader(session: Session) -> Iterator[Callable[[], Reader]]:
    """Starts a call, which ends with the test."""
    started: list[Reader] = []

    def start() -> Reader:
        wait_for(lambda: found(session), "the camera in pw-dump")
        started.append(Reader(session))
        started[-1].wait_for_pictures()
        return started[-1]

    yield start
    for each in started:
        each.close()


@pytest.fixture
def lateness() -> Iterator[Lateness]:
    """What the machine makes any process wait during the test."""
    with Lateness() as measured:
        yield measured


@pytest.fixture(autouse=True)
def none_left(session: Session) -> Iterator[None]:
    """Whatever a test does, it leaves no keeper to the next one."""
    yield
    session.end_keepers()
    wait_for(lambda: found(session) is None, "the camera to go")


def check(reader: Reader, lateness: Lateness) -> float:
    """The call went on, with pictures all the time, all of them right; gives the longest gap, in seconds."""
    assert reader.goes_on
    seen = {each.planes: each for each in list(reader.seen)}.values()  # what is repeated is looked at once
    assert all(each.worst <= WITHIN for each in seen), max(each.worst for each in seen)
    gap_s = lateness.longest_gap_s(list(reader.times))
    assert gap_s <= LONGEST_GAP_S
    return gap_s


def serial(session: Session) -> object:
    """What only this node has, of all that were there in the session."""
    properties = wait_for(lambda: found(session), "the camera in pw-dump")
    return properties["object.serial"]


def test_kill_9_the_placeholder_and_a_new_start_end_no_call(
    session: Session,
    camera: StartCamera,
    reader: Callable[[], Reader],
    lateness: Lateness,
    suite: str,
    note_row: Notes,
) -> None:
    first = camera(*KEPT)
    call, node = reader(), serial(session)
    told = first.wait_for("one reads", readers=1, wanted=True)
    assert any("gst" in name for name in told["names"]), told
    first.process.kill()
    first.process.wait()
    call.wait_for_pictures()  # without a camera
    last = call.seen[-1].number
    assert last is not None
    wait_for(lambda: call.seen[-1].number is None, "the placeholder")
    call.wait_for_pictures()
    second = camera(*KEPT)
    second.wait_for("the same reader", readers=1, wanted=True, sink="camera PipeWire")
    call.wait_for_another(than=last)
    call.wait_for_pictures()
    assert serial(session) == node
    gap_s = check(call, lateness)
    note_row("a camera in PipeWire that is killed and started again", (suite, "pattern", f"{1e3 * gap_s:.0f} ms"))


def test_an_upgrade_and_other_settings_end_no_call(
    session: Session, camera: StartCamera, reader: Callable[[], Reader], lateness: Lateness
) -> None:
    shown = camera(*KEPT)
    call, node = reader(), serial(session)
    for other in (("--version", OTHER_VERSION), ("--width", "640", "--height", "360"), ("--fps", "25")):
        shown.process.kill()
        shown.process.wait()
        call.wait_for_pictures()
        last = call.seen[-1].number
        shown = camera(*KEPT, *other)
        shown.wait_for(f"the same reader, with {other}", readers=1, error=None)
        call.wait_for_another(than=last)
        call.wait_for_pictures()
        assert serial(session) == node
        assert call.goes_on
    assert lateness.longest_gap_s(list(call.times)) <= LONGEST_GAP_S


def test_where_nobody_reads_an_upgrade_brings_its_own_keeper(session: Session, camera: StartCamera) -> None:
    first = camera(*KEPT, "--version", OTHER_VERSION)
    first.wait_for("published", sink="camera PipeWire", readers=0)
    (old,) = session.keepers()
    first.process.kill()
    first.process.wait()
    camera(*KEPT).wait_for("published", sink="camera PipeWire", error=None)
    wait_for(
        lambda: [each.pid for each in session.keepers()] != [old.pid] and len(session.keepers()) == 1, "its keeper"
    )
    (new,) = session.keepers()
    assert VERSION in new.cmdline()


def test_a_camera_that_stops_takes_its_node_away(session: Session, camera: StartCamera) -> None:
    shown = camera("--keep-s", f"{10 * WAIT_S}")
    wait_for(lambda: found(session), "the camera in pw-dump")
    shown.process.send_signal(signal.SIGTERM)
    assert shown.process.wait(WAIT_S) == 0
    wait_for(lambda: not session.keepers(), "its keeper to end")
    wait_for(lambda: found(session) is None, "the camera to go")


def test_who_comes_and_goes_without_a_camera_is_known_to_the_next_one(
    session: Session, camera: StartCamera, reader: Callable[[], Reader]
) -> None:
    first = camera(*KEPT)
    first.wait_for("nobody reads", readers=0, wanted=False)
    first.process.kill()
    first.process.wait()
    call = reader()  # the last picture, and then the placeholder, from the keeper alone
    second = camera(*KEPT)
    second.wait_for("one reads", readers=1, wanted=True)
    call.close()
    second.wait_for("nobody reads", readers=0, wanted=False)


def test_a_camera_that_hangs_is_bridged(
    session: Session, camera: StartCamera, reader: Callable[[], Reader], lateness: Lateness
) -> None:
    shown = camera(*KEPT)
    call = reader()
    shown.process.send_signal(signal.SIGSTOP)
    call.wait_for_pictures(40)
    shown.process.send_signal(signal.SIGCONT)
    call.wait_for_pictures()
    check(call, lateness)


def test_a_keeper_that_is_killed_is_replaced(session: Session, camera: StartCamera) -> None:
    shown = camera(*KEPT)
    wait_for(lambda: found(session), "the camera in pw-dump")
    node = serial(session)
    (keeper,) = session.keepers()
    os.kill(keeper.pid, signal.SIGKILL)
    # Until another one is there the camera may be published without.
    wait_for(lambda: [each.pid for each in session.keepers()] not in ([], [keeper.pid]), "another keeper")
    wait_for(lambda: (found(session) or {}).get("object.serial", node) != node, "another node")
    shown.wait_for("published", error=None)
    assert shown.process.poll() is None
    assert len(session.keepers()) == 1


def test_a_second_camera_is_refused_while_the_first_is_there(session: Session, camera: StartCamera) -> None:
    camera(*KEPT).wait_for("published", sink="camera PipeWire", error=None)
    second = camera(*KEPT)
    told = wait_for(lambda: second.last.get("error"), "its error")
    assert "another Relit Camera publishes to PipeWire already" in str(told)
    assert len([each for each in session.cameras() if each["node.name"] == LABEL]) == 1


def test_the_session_restarts_and_the_keeper_comes_back_to_it(session: Session, camera: StartCamera) -> None:
    shown = camera(*KEPT)
    shown.wait_for("published", readers=0)
    session.stop()
    told = wait_for(lambda: shown.last if shown.last["error"] else None, "the end of the session")
    assert "PipeWire session" in told["error"]
    assert told["sink"] == "camera"
    session.start()
    shown.wait_for("published again", error=None, sink="camera PipeWire")
    wait_for(lambda: found(session), "the camera in pw-dump")


def test_what_the_keeper_costs(session: Session, camera: StartCamera, suite: str, note_row: Notes) -> None:
    shown = camera(*KEPT, "--width", "1280", "--height", "720")
    shown.wait_for("published", readers=0)
    (keeper,) = session.keepers()
    memory = keeper.memory_full_info()
    assert memory.uss < 60 << 20
    note_row(
        "the keeper of a camera in PipeWire",
        (suite, f"{memory.rss / 2**20:.0f} MB resident, {memory.uss / 2**20:.0f} MB of its own"),
    )
