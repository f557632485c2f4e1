"""What is missing is told in the page with its cure, and the page recovers by itself once it is there."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Locator, expect

from relit_camera.app.demo import demo_files
from relit_camera.live.status.setup_status import Check, CheckState, ModelPullStatus, ModelStage
from tests.browser.browser_pages import OpenPage
from tests.browser.cameras import FakeServer, StagedCamera, staged_camera
from tests.browser.conftest import Timed
from tests.browser.panel import Panel, open_panel

SOON_MS = 60_000
"""The checks run in a process of their own, again every few seconds."""


@pytest.fixture
def staged(tmp_path: Path) -> Iterator[StagedCamera]:
    """A camera that shows the bundled person, on a machine without webcam, kernel module and models."""
    (tmp_path / "models").mkdir()
    with staged_camera(tmp_path, tmp_path / "models", f"subject: {demo_files.SUBJECT}") as camera:
        yield camera


def check(panel: Panel, name: str) -> Locator:
    """A point of the checklist."""
    return panel.page.locator(f'#checks li[data-check="{name}"]')


@pytest.mark.slow
def test_webcam_module_and_models_are_missing_until_they_are_there(
    staged: StagedCamera, models: Path, tmp_path: Path, open_page: OpenPage, timed: Timed
) -> None:
    """The page stays open all the time, and is never loaded again."""
    with timed("open the page, see what is missing"):
        panel = open_panel(open_page, staged.url)
        for name in ("webcam", "kernel-module", "models"):
            expect(check(panel, name)).to_have_attribute("data-state", "failed", timeout=SOON_MS)
    expect(check(panel, "kernel-module")).to_contain_text("v4l2loopback-dkms")
    copy = check(panel, "kernel-module").get_by_role("button", name=re.compile("Copy the command: sudo apt install"))
    panel.page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    copy.click()
    assert "v4l2loopback-dkms" in panel.page.evaluate("() => navigator.clipboard.readText()")

    machine = staged.machine
    with timed("load the module"):
        machine.add_kernel("6.1.0-56-amd64", with_module=True)
        machine.load_module("0.12.7")
        machine.load_at_boot()
        machine.tree.add_loopback(10, "Relit Camera")
        expect(check(panel, "kernel-module")).not_to_have_attribute("data-state", "failed", timeout=SOON_MS)
    with timed("plug in the webcam"):
        machine.tree.add_webcam(0, "A webcam", by_id="usb-a-webcam")
        expect(check(panel, "webcam")).not_to_have_attribute("data-state", "failed", timeout=SOON_MS)
    with timed("store the models"):
        shutil.copytree(models, tmp_path / "models", dirs_exist_ok=True)
        expect(panel.page.locator("#checklist")).to_be_hidden(timeout=SOON_MS)
    with timed("the face is found"):
        expect(panel.page.locator("#figure-tracker")).to_have_text("Face found", timeout=SOON_MS)


def test_a_webcam_that_is_unplugged_is_told_and_comes_back(
    staged: StagedCamera, models: Path, tmp_path: Path, open_page: OpenPage, timed: Timed
) -> None:
    shutil.copytree(models, tmp_path / "models", dirs_exist_ok=True)
    staged.machine.tree.add_webcam(0, "A webcam", by_id="usb-a-webcam")
    panel = open_panel(open_page, staged.url)
    expect(panel.page.locator("#figure-tracker")).to_have_text("Face found", timeout=SOON_MS)
    with timed("pull it out"):
        staged.machine.tree.remove(0)
        expect(panel.page.locator("#state-text")).to_have_text("Waiting for the webcam", timeout=SOON_MS)
        expect(check(panel, "webcam")).to_have_attribute("data-state", "failed", timeout=SOON_MS)
    with timed("plug it in again"):
        staged.machine.tree.add_webcam(2, "A webcam", by_id="usb-a-webcam")
        expect(panel.page.locator("#state-text")).not_to_have_text("Waiting for the webcam", timeout=SOON_MS)
        expect(check(panel, "webcam")).not_to_have_attribute("data-state", "failed", timeout=SOON_MS)


def test_the_models_are_got_from_the_page(fake: FakeServer, open_page: OpenPage) -> None:
    setup = fake.camera.setup
    fake.show_checks(Check("models", "Models", CheckState.FAILED, "some are missing", "run: relit models pull"))
    panel = open_panel(open_page, fake.url)
    panel.page.locator("#models-get").click()
    expect(panel.page.locator("#models-progress")).to_be_visible()
    assert setup.pull.stage is ModelStage.PULLING
    panel.page.route("**/api/v1/models", lambda route: route.abort())
    expect(panel.page.locator("#models-problem")).to_contain_text("does not answer")
    panel.page.unroute("**/api/v1/models")
    setup.pull = ModelPullStatus(ModelStage.FAILED, ("face_landmarks",), what="the line is down", cure="try again")
    expect(panel.page.locator("#models-problem")).to_contain_text("The line is down")
    panel.page.locator("#models-get").click()
    expect(panel.page.locator("#models-progress")).to_be_visible()
    setup.pull = ModelPullStatus(ModelStage.DONE, progress=1.0)
    fake.show_checks(Check("models", "Models", CheckState.OK, "all are there"))
    expect(panel.page.locator("#checklist")).to_be_hidden()


def test_who_is_unlit_can_hide_before_the_controls_are_there(fake: FakeServer, open_page: OpenPage) -> None:
    """The controls come only after a while, at the second try."""
    fake.show_raw_picture()
    page = open_page("about:blank")
    page.route("**/panel/library/places.js", lambda route: route.abort())
    page.goto(fake.url, wait_until="domcontentloaded")
    expect(page.locator(".toast")).to_contain_text("The controls could not be loaded")
    page.locator("#unlit-stop").click()
    fake.wait_for("scene", unlit_allowed=False)
    page.unroute("**/panel/library/places.js")
    expect(Panel(page).place("party")).to_be_attached()


def test_a_camera_that_ends_is_told_and_the_page_finds_the_next(fake: FakeServer, open_page: OpenPage) -> None:
    panel = open_panel(open_page, fake.url)
    panel.wait_for_picture()
    fake.stop_server()
    expect(panel.page.locator("#state-text")).to_have_text("Not connected")
    expect(panel.page.locator("#veil")).to_contain_text("Start it again: relit run")
    expect(panel.rate).to_be_empty()
    fake.start_server()
    expect(panel.page.locator("#state-text")).to_have_text("Live")
    panel.place("party").click()
    fake.wait_for("lighting", environment="party")
