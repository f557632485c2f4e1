"""The real command in PipeWire: `relit run` with a file and a subject, as programs of the session see it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.browser.browser_pages import chromium_program
from tests.lateness import Lateness
from tests.pipewire.portal import Call, PortalSession, call_in_chromium, call_in_firefox
from tests.pipewire.reader import Reader
from tests.pipewire.relit_run import SIZE, RelitRun
from tests.pipewire.session import Session, wait_for
from tests.pipewire.test_browsers import firefox_program
from tests.pipewire.test_kept_camera import LONGEST_GAP_S, serial
from tests.pipewire.test_pipewire_camera import LABEL, Notes, found

WITHIN_MEAN = 2.0
"""How far a picture may be from the snapshot, of 255, on average: one is a JPEG, the other in I420."""
OTHER_LIGHT = "overcast"
"""Than `RelitRun`'s: its pictures are told apart from those."""


@contextmanager
def running(session: Session, *options: str) -> Iterator[RelitRun]:
    """`relit run` that can be found in the session."""
    try:
        with RelitRun(session, "--sink", "pipewire", *options) as relit:
            wait_for(lambda: found(session), "the camera in pw-dump")
            yield relit
    finally:
        session.end_keepers()
        wait_for(lambda: found(session) is None, "the camera to go")


def mean_difference(image: NDArray[np.uint8], snapshot: NDArray[np.uint8]) -> float:
    """How far a picture is from another, of 255, on average."""
    assert image.shape == snapshot.shape
    return float(np.mean(cv2.absdiff(image, snapshot)))


def check_picture(image: NDArray[np.uint8], relit: RelitRun) -> float:
    """A picture of the frozen camera is the one that is published, and shows the person; gives how far off it is.

    An inverted picture, or one that is moved by a few pixels, would be further off than is allowed.
    """
    published = relit.snapshot()
    assert float(published.std()) > 30
    off = mean_difference(image, published)
    assert off <= WITHIN_MEAN
    assert mean_difference(np.roll(image, 8, axis=1), published) > WITHIN_MEAN
    return off


def state_is(relit: RelitRun, state: str) -> None:
    """Wait for a state of the camera."""
    wait_for(lambda: relit.get("status")["state"] == state, f"the camera to be {state}")


def test_gstreamer_sees_what_is_published_through_kill_9_and_a_new_start(
    session: Session, suite: str, note_row: Notes
) -> None:
    with running(session, "--on-demand") as relit, Lateness() as lateness:
        properties = wait_for(lambda: found(session), "the camera in pw-dump")
        assert (properties["node.description"], properties["media.role"]) == (LABEL, "Camera")
        state_is(relit, "released")
        call = Reader(session, SIZE, kept=1)
        try:
            state_is(relit, "live")  # that somebody reads has reached it through its keeper
            assert any("gst" in name for name in relit.get("status")["readers"]["names"])
            call.wait_for_pictures()
            node, of_the_first = serial(session), relit.snapshot()
            relit.process.kill()
            relit.process.wait()
            with running(session, "--on-demand", "--environment", OTHER_LIGHT) as again:
                state_is(again, "live")
                again.put("freeze", {"frozen": True})
                state_is(again, "frozen")
                call.wait_for_pictures()
                off = check_picture(call.seen[-1].image, again)
                assert mean_difference(call.seen[-1].image, of_the_first) > 2 * WITHIN_MEAN
                assert serial(session) == node
                assert [each["node.name"] for each in session.cameras()] == [LABEL]
                status = again.get("status")
                assert status["readers"]["count"] >= 1
                assert "keeper-failed" not in [each["code"] for each in status["degraded"]]
                assert call.goes_on
                gap_s = lateness.longest_gap_s(list(call.times))
                assert gap_s <= LONGEST_GAP_S
                call.process.kill()
                again.put("freeze", {"frozen": False})
                state_is(again, "released")
        finally:
            call.close()
    note_row("relit run in PipeWire", (suite, "GStreamer", f"{off:.1f}"))
    note_row("a camera in PipeWire that is killed and started again", (suite, "relit run", f"{1e3 * gap_s:.0f} ms"))


@pytest.fixture(scope="module")
def frozen(portal: PortalSession) -> Iterator[RelitRun]:
    """`relit run` in a session with the portal, which publishes one picture all the time."""
    with running(portal) as relit:
        state_is(relit, "live")
        relit.put("freeze", {"frozen": True})
        state_is(relit, "frozen")
        yield relit


@pytest.mark.parametrize("browser", ["Firefox", "Chromium"])
def test_a_browser_shows_what_is_published(
    portal: PortalSession, frozen: RelitRun, tmp_path: Path, suite: str, browser: str, note_row: Notes
) -> None:
    program = firefox_program() if browser == "Firefox" else chromium_program()
    call_in: Callable[[Session, str], Call] = call_in_firefox if browser == "Firefox" else call_in_chromium
    call = call_in(portal, program)
    cv2.imwrite(str(tmp_path / "call.png"), call.image[..., ::-1])
    assert (call.label, call.labels) == (LABEL, (LABEL,))
    off = check_picture(call.image, frozen)
    note_row("relit run in PipeWire", (suite, browser, f"{off:.1f}"))
