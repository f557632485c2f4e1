"""Firefox and Chromium, without a kernel module: through the desktop's camera portal."""

from __future__ import annotations

import shutil
from collections.abc import Iterator

import pytest

from relit_camera.doctor.readers.permission_store import camera_permissions
from tests.browser.browser_pages import chromium_program
from tests.pipewire.conftest import PatternCamera
from tests.pipewire.portal import Call, PortalSession, call_in_chromium, call_in_firefox
from tests.pipewire.session import cache_folder, wait_for
from tests.pipewire.test_pipewire_camera import LABEL, LARGE, WITHIN, Notes, worst_of

FIREFOXES = ("firefox-esr", "firefox")


@pytest.fixture(scope="module")
def shown(portal: PortalSession) -> Iterator[PatternCamera]:
    """The camera in it, in the size that it has by default."""
    with PatternCamera(portal, "--width", LARGE[0], "--height", LARGE[1]) as camera:
        wait_for(portal.cameras, "the camera in pw-dump")
        yield camera


def firefox_program() -> str:
    """Firefox, unpacked or installed."""
    unpacked = cache_folder() / "own" / "root" / "usr/lib/firefox-esr/firefox-esr"
    installed = (path for name in FIREFOXES if (path := shutil.which(name)))
    found = str(unpacked) if unpacked.exists() else next(installed, "")
    if not found:
        pytest.skip("no Firefox: sh tests/pipewire/install.sh")
    return found


def test_the_doctor_reads_what_was_answered_and_its_cure_forgets_it(portal: PortalSession) -> None:
    app, stored = "com.example.Call", portal.folder / "data/flatpak/db/devices"

    def answers() -> dict[str, str]:
        return camera_permissions(stored.read_bytes()) if stored.is_file() else {}

    assert portal.answer_for(app, "no")
    wait_for(lambda: answers().get(app) == "no", "the store's file")
    assert answers()[""] == "yes"
    assert portal.forget(app)
    wait_for(lambda: app not in answers(), "the store's file")
    assert answers()[""] == "yes"


def check(call: Call, shown: PatternCamera, name: str) -> int:
    """The page found our camera and no other, with the right colours; gives how far off these are.

    The camera saw a reader of that name.
    """
    assert any(name in reader.lower() for told in shown.told for reader in told["names"]), shown.told
    assert (call.label, call.labels) == (LABEL, (LABEL,))
    assert call.image.shape == (LARGE[1], LARGE[0], 3)
    worst = worst_of(call.image)
    assert worst <= WITHIN
    shown.wait_for("the call to end", readers=0)
    return worst


def test_firefox_shows_the_camera(portal: PortalSession, shown: PatternCamera, suite: str, note_row: Notes) -> None:
    worst = check(call_in_firefox(portal, firefox_program()), shown, "firefox")
    note_row("readers of the camera in PipeWire", (suite, "Firefox, 1280x720", str(worst)))


def test_chromium_shows_the_camera(portal: PortalSession, shown: PatternCamera, suite: str, note_row: Notes) -> None:
    worst = check(call_in_chromium(portal, chromium_program()), shown, "chrom")
    note_row("readers of the camera in PipeWire", (suite, "Chromium, 1280x720", str(worst)))
