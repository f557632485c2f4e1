"""Expression stills in the panel: what to do, what is taken, every way that it ends; and with a recorded webcam."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Route, expect

from relit_camera.app.demo import demo_files
from relit_camera.live.status.expression_status import ExpressionReport, ExpressionStage
from relit_camera.subject.rungs import Rung
from relit_camera.subject.subject_file import count_stills, write_subject
from tests.app.subject_builders import captured
from tests.browser.browser_pages import OpenPage
from tests.browser.cameras import SUBJECT, FakeServer, camera_process
from tests.browser.conftest import Timed
from tests.browser.panel import Panel, open_panel
from tests.browser.test_accessibility import in_every_theme
from tests.small_camera import wait_until

REPORT = ExpressionReport(14, ("neutral", "wide mouth", "turned right"), ("shut your eyes for a second",), 3_260_000)
FILMED_MS = 150_000
"""Until a recorded webcam has shown what it can."""


def tell(fake: FakeServer, **changes: object) -> None:
    """Let the capture be so."""
    capture = fake.camera.expression_capture
    capture.current = replace(capture.current, **changes)  # type: ignore[arg-type]


def stage(fake: FakeServer) -> ExpressionStage:
    return fake.camera.expression_capture.current.stage


def open_card(fake: FakeServer, open_page: OpenPage, **options: object) -> tuple[Panel, Locator]:
    """The panel and its dialog for the stills of who is shown, opened by the keyboard."""
    panel = open_panel(open_page, fake.url, **options)
    button = panel.page.locator("#ladder-stills")
    expect(button).to_be_visible()  # `press` does not wait for that, and a hidden button takes no key
    button.press("Enter")
    dialog = panel.page.locator("#stills-dialog")
    expect(dialog).to_be_visible()
    return panel, dialog


@pytest.fixture
def fake(fake: FakeServer) -> FakeServer:
    """A camera whose models are there."""
    fake.camera.setup.pull = replace(fake.camera.setup.pull, missing=())
    return fake


@pytest.mark.parametrize("rung", ["instant", "desk", "film", "pictures", None])
def test_each_rung_leads_to_them(fake: FakeServer, open_page: OpenPage, rung: Rung | None) -> None:
    write_subject(fake.camera.scene_controller.subjects.new_path("bea"), captured(rung))
    fake.patch("scene", subject="bea")
    panel = open_panel(open_page, fake.url)
    expect(panel.page.locator("#ladder-stills")).to_have_text("Next: your own mouth, eyes and cheeks, half a minute")


def test_neither_the_demo_person_nor_a_file_of_the_command_line_gets_them(
    fake: FakeServer, open_page: OpenPage, tmp_path: Path
) -> None:
    name = fake.http.post("demo-subject").raise_for_status().json()["name"]
    write_subject(tmp_path / "cleo.relit", captured("film"))
    fake.camera.scene_controller.load_configured_subject(str(tmp_path / "cleo.relit"))
    panel = open_panel(open_page, fake.url)
    for shown in ("cleo", name):
        fake.patch("scene", subject=shown)
        expect(panel.page.locator("#ladder-line")).to_contain_text(shown)
        expect(panel.page.locator("#ladder-stills")).to_be_hidden()
    fake.patch("scene", subject=SUBJECT)
    expect(panel.page.locator("#ladder-stills")).to_be_visible()


def test_it_says_what_to_do_and_ticks_off_what_was_seen_by_the_keyboard(fake: FakeServer, open_page: OpenPage) -> None:
    panel, dialog = open_card(fake, open_page)
    expect(panel.page.locator("#stills-start")).to_be_focused()
    panel.page.keyboard.press("Enter")
    wait_until(lambda: stage(fake) is ExpressionStage.FILMING)
    assert fake.camera.expression_capture.current.subject == SUBJECT
    prompt, items = dialog.locator("#stills-prompt"), dialog.locator("#stills-items li")
    expect(prompt).to_have_text("I cannot see your face: look into the camera.")
    tell(fake, face=True, prompt="wide mouth", say="say 'cheese'", covered=("neutral",), progress=0.25)
    expect(prompt).to_have_text("Say 'cheese'.")
    expect(prompt).to_have_attribute("role", "status")
    expect(items).to_have_text(["At rest: taken", "Smile: now", "Eyes shut: not yet", "Right: not yet"])
    tell(fake, prompt="", say="")
    expect(prompt).to_have_text("One moment…")
    tell(fake, stage=ExpressionStage.BUILDING)
    expect(dialog).to_have_attribute("data-step", "building")
    tell(fake, stage=ExpressionStage.DONE, report=REPORT)
    expect(dialog).to_have_attribute("data-step", "done")
    expect(dialog.locator("#stills-words")).to_contain_text("14 pictures were taken for “ada”.")
    expect(dialog.locator("#stills-words")).to_contain_text("shut your eyes for a second")
    expect(items).to_have_text(["At rest: taken", "Smile: taken", "Eyes shut: not taken", "Right: taken"])
    expect(dialog.locator("#stills-keep")).to_be_focused()
    panel.page.keyboard.press("Enter")
    expect(dialog).to_have_count(0)
    expect(panel.page.locator("#ladder-stills")).to_be_focused()


def test_escape_cancels_it(fake: FakeServer, open_page: OpenPage) -> None:
    panel, dialog = open_card(fake, open_page)
    panel.page.keyboard.press("Enter")
    wait_until(lambda: stage(fake) is ExpressionStage.FILMING)
    panel.page.keyboard.press("Escape")
    expect(dialog).to_have_count(0)
    wait_until(lambda: stage(fake) is ExpressionStage.CANCELED)
    expect(panel.page.locator("#ladder-stills")).to_be_focused()


def test_a_page_that_is_closed_cancels_it(fake: FakeServer, open_page: OpenPage) -> None:
    panel, _dialog = open_card(fake, open_page)
    panel.page.keyboard.press("Enter")
    wait_until(lambda: stage(fake) is ExpressionStage.FILMING)  # the page says so before the camera has been asked
    panel.page.goto("about:blank")
    wait_until(lambda: stage(fake) is ExpressionStage.CANCELED)


def test_a_page_that_is_closed_while_it_waits_for_an_answer_cancels_it(fake: FakeServer, open_page: OpenPage) -> None:
    panel, _dialog = open_card(fake, open_page)

    def withhold_answer(route: Route) -> None:
        if route.request.method == "POST":
            route.fetch()
        else:
            route.continue_()

    panel.page.route("**/captures/expressions", withhold_answer)
    panel.page.keyboard.press("Enter")
    while stage(fake) is not ExpressionStage.FILMING:
        panel.page.wait_for_timeout(20)  # the request passes through this thread
    panel.page.goto("about:blank")
    wait_until(lambda: stage(fake) is ExpressionStage.CANCELED)


def test_one_that_runs_already_is_joined(fake: FakeServer, open_page: OpenPage) -> None:
    fake.camera.expression_capture.start(SUBJECT)
    tell(fake, stage=ExpressionStage.BUILDING)
    panel, dialog = open_card(fake, open_page)
    expect(dialog).to_have_attribute("data-step", "building")
    panel.page.goto("about:blank")  # what has all it needs goes on without a page
    time.sleep(0.5)  # in which a page that is closed cancels what is still being filmed
    assert stage(fake) is ExpressionStage.BUILDING


def test_what_failed_is_told_and_can_be_tried_again(fake: FakeServer, open_page: OpenPage) -> None:
    panel, dialog = open_card(fake, open_page)
    panel.page.keyboard.press("Enter")
    wait_until(lambda: stage(fake) is ExpressionStage.FILMING)
    tell(fake, stage=ExpressionStage.FAILED, what="it is too dark in the webcam's picture", cure="switch a light on")
    problem = dialog.locator("#stills-problem")
    expect(problem).to_have_text("It is too dark in the webcam's picture.Switch a light on.")
    expect(dialog.locator("#stills-start")).to_have_text("Try again")
    dialog.locator("#stills-start").click()
    wait_until(lambda: stage(fake) is ExpressionStage.FILMING)
    expect(problem).to_be_hidden()


def test_a_video_is_sent_instead(fake: FakeServer, open_page: OpenPage) -> None:
    _, dialog = open_card(fake, open_page)
    field = dialog.locator("#stills-file")
    field.set_input_files({"name": "notes.txt", "mimeType": "text/plain", "buffer": b"words"})
    expect(dialog.locator("#stills-problem")).to_contain_text("another kind")
    field.set_input_files({"name": "talk.mp4", "mimeType": "video/mp4", "buffer": b"a video"})
    expect(dialog).to_have_attribute("data-step", "building")
    assert fake.camera.expression_capture.video.read_bytes() == b"a video"
    tell(fake, stage=ExpressionStage.DONE, report=REPORT)
    expect(dialog).to_have_attribute("data-step", "done")


def test_in_mode_live_it_says_where_they_show(fake: FakeServer, open_page: OpenPage) -> None:
    fake.patch("scene", mode="live")
    panel, dialog = open_card(fake, open_page)
    panel.page.keyboard.press("Enter")
    wait_until(lambda: stage(fake) is ExpressionStage.FILMING)
    tell(fake, stage=ExpressionStage.DONE, report=REPORT)
    expect(dialog.locator("#stills-words")).to_contain_text("They show with “Portrait: your captured picture, moved”")
    dialog.locator("#stills-moved").click()
    fake.wait_for("scene", mode="portrait")


def test_everybody_can_use_it_at_every_width_in_every_theme(fake: FakeServer, open_page: OpenPage) -> None:
    panel, dialog = open_card(fake, open_page)
    found = in_every_theme(panel.page, "ready", (390, 1440))
    panel.page.locator("#stills-start").click()
    wait_until(lambda: stage(fake) is ExpressionStage.FILMING)
    tell(fake, face=True, prompt="wide mouth", say="say 'cheese'", covered=("neutral",), progress=0.25)
    expect(dialog.locator("#stills-prompt")).to_have_text("Say 'cheese'.")
    found += in_every_theme(panel.page, "filming", (390, 1440))
    tell(fake, stage=ExpressionStage.DONE, report=REPORT)
    expect(dialog).to_have_attribute("data-step", "done")
    found += in_every_theme(panel.page, "done", (390, 1440))
    assert found == []


@pytest.mark.slow
def test_one_s_own_stills_from_a_recorded_webcam(
    tmp_path: Path, models: Path, open_page: OpenPage, timed: Timed
) -> None:
    """With the bundled clip as webcam, and the person in it, whose file is a user's own here."""
    with camera_process(tmp_path, "run", "--source", demo_files.CLIP, models=models) as camera:
        file = ("me.relit", demo_files.SUBJECT.read_bytes())
        camera.http.post("subjects", data={"name": "me"}, files={"file": file}).raise_for_status()
        camera.patch("scene", subject="me", mode="portrait")
        panel = open_panel(open_page, camera.url)
        dialog = panel.page.locator("#stills-dialog")
        with timed("open the card"):
            panel.page.locator("#ladder-stills").click()
            expect(dialog).to_have_attribute("data-step", "ready")
        with timed("do what it says, as far as the clip does it"):
            panel.page.locator("#stills-start").click()
            expect(dialog.locator("#stills-items li[data-state=good]").first).to_be_attached(timeout=FILMED_MS)
            expect(dialog).to_have_attribute("data-step", "building", timeout=FILMED_MS)
        with timed("the stills are made and shown"):
            expect(dialog).to_have_attribute("data-step", "done", timeout=FILMED_MS)
        report = camera.get("captures/expressions")["report"]
        assert report["stills"] >= 4, report
        assert {"neutral", "lips apart"} <= set(report["covered"])
        stored = next(tmp_path.rglob("me.relit"))
        assert count_stills(stored) == report["stills"]
        assert camera.get("scene")["mode"] == "portrait"
        panel.page.locator("#stills-keep").click()
        expect(panel.page.locator("#ladder-trust")).to_contain_text(f"{report['stills']} pictures of your own mouth")
