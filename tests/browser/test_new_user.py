"""What a new user does, from the first visit to being lit: every click, and how long each step takes."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from relit_camera.app.captures.desk.controls_note import ControlsNote
from relit_camera.app.captures.desk.desk_filming import DeskFilming, FilmingTimings
from relit_camera.app.demo import demo_files
from relit_camera.base.errors import ConflictError
from relit_camera.base.images.image_files import encode_display
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.capture.desk.desk_session import SessionTimings
from relit_camera.live.frame_recorder import FrameRecorder
from relit_camera.live.status.capture_status import CaptureStage, CaptureStatus
from relit_camera.live.status.film_status import DroppedFrames, FilmReport, FilmStage, FilmStep
from relit_camera.live.status.setup_status import ModelPullStatus, ModelStage
from relit_camera.subject.subject_file import write_subject
from tests.app.desk_builders import check_and_build
from tests.app.subject_builders import captured
from tests.browser.browser_pages import OpenPage
from tests.browser.cameras import START_S, Api, FakeServer, camera_process, fake_server
from tests.browser.conftest import Timed
from tests.browser.panel import Panel, open_panel
from tests.browser.test_privacy import FACE, is_raw
from tests.devices.test_webcam_controls import FakeWebcam
from tests.small_camera import wait_until

MOST_S = 120.0
"""From the first visit to one's own relit face."""
STEP_MS = 60_000
CHANGED = 8.0
"""Mean difference of two published pictures, code values, by which the light is seen to be another."""
DESK_TIMINGS = FilmingTimings(
    session=SessionTimings(
        frames_a_step=2, settling_s=0.05, min_step_s=0.1, page_timeout_s=10, show_timeout_s=20, step_timeout_s=20
    ),
    automatic_s=0.1,
    delay_frames=2,
    frame_timeout_s=5.0,
    building_timeout_s=120.0,
)


@pytest.fixture
def nobody(tmp_path: Path) -> Iterator[FakeServer]:
    """A camera without devices that shows nobody yet."""
    with fake_server(tmp_path / "data", subject=None) as server:
        yield server


def wait_for_change(camera: Api, before: DisplayImage) -> None:
    """Wait until what is published is lit otherwise than before."""
    was = before.astype(np.float32)
    wait_until(lambda: float(np.abs(camera.published() - was).mean()) > CHANGED, START_S)


def test_the_demonstration(tmp_path: Path, open_page: OpenPage, timed: Timed) -> None:
    with ExitStack() as running:
        with timed("start the camera"):
            camera = running.enter_context(camera_process(tmp_path, "demo", "--headless"))
        with timed("open the page, see the first picture"):
            panel = open_panel(open_page, camera.url)
            panel.wait_for_picture()
            expect(panel.page.locator("#caption")).not_to_be_empty(timeout=STEP_MS)
        with timed("choose a place while the tour goes on"):
            panel.place("party").click()
            camera.wait_for("lighting", environment="party")
            expect(panel.place("party")).to_have_attribute("aria-pressed", "true")
            expect(panel.page.locator("#caption")).to_be_empty()
        before = camera.published()
        with timed("choose a look"):
            panel.page.locator("#looks").get_by_role("button", name="Neon").click()
            wait_until(lambda: len(camera.get("lighting")["lamps"]) > 0)
        with timed("undo"):
            panel.page.locator("#undo").click()
            wait_until(lambda: len(camera.get("lighting")["lamps"]) == 0)
        with timed("choose another place"):
            panel.place("overcast").click()
            wait_for_change(camera, before)


def test_whoever_comes_is_relit_at_once_and_makes_that_their_subject(
    tmp_path: Path, models: Path, open_page: OpenPage, timed: Timed
) -> None:
    """With the bundled clip as webcam, and nothing said of who is to be shown."""
    with camera_process(
        tmp_path, "run", "--source", demo_files.CLIP, models=models, settings="look: {lighting: {environment: party}}"
    ) as camera:
        with timed("open the page, be relit"):
            panel = open_panel(open_page, camera.url)
            camera.wait_for("status", state="live", subject="anyone", unlit=False)
            assert not is_raw(camera, FACE)
        page, dialog = panel.page, panel.page.locator("#face-dialog")
        expect(panel.doors).to_be_hidden()
        expect(panel.face("Anyone")).to_have_attribute("aria-pressed", "true")
        expect(page.locator("#ladder-line")).to_have_text("You are lit as an average head would be.")
        with timed("Make this my subject"):
            page.locator("#ladder").get_by_role("button", name="Make this my subject").click()
            expect(page.locator("#framing li[data-of=distance]")).not_to_have_attribute(
                "data-state", "unknown", timeout=STEP_MS
            )
            page.locator("#face-start").click()
            expect(dialog).to_have_attribute("data-step", "done", timeout=STEP_MS)
            page.locator("#face-keep").click()
        (stored,) = camera.get("subjects")
        assert stored["is_current"]
        expect(page.locator("#ladder-line")).to_contain_text("light of a room")
        expect(panel.face(stored["name"])).to_have_attribute("aria-pressed", "true")


def test_one_s_own_face_from_a_recorded_webcam(tmp_path: Path, models: Path, open_page: OpenPage, timed: Timed) -> None:
    """Instant, with the bundled clip as webcam: not more than two minutes after set-up."""
    hidden_at_first = camera_process(
        tmp_path, "run", "--source", demo_files.CLIP, models=models, settings="subject: null"
    )
    with hidden_at_first as camera, timed("all of it"):
        with timed("open the page, see the doors"):
            panel = open_panel(open_page, camera.url)
            expect(panel.doors).to_be_visible()
        hidden = camera.published().astype(np.float32)
        page, dialog = panel.page, panel.page.locator("#face-dialog")
        with timed("My face now"):
            page.locator("#door-face").click()
            expect(dialog).to_have_attribute("data-step", "framing", timeout=STEP_MS)
        with timed("the framing help sees the face"):
            seen = page.locator("#framing li[data-of=distance]")
            expect(seen).not_to_have_attribute("data-state", "unknown", timeout=STEP_MS)
        assert np.abs(camera.published() - hidden).mean() < 1, "the webcam's picture was published"
        with timed("Capture me"):
            page.locator("#face-start").click()
            expect(dialog).to_have_attribute("data-step", "done", timeout=STEP_MS)
        with timed("Keep it"):
            page.locator("#face-keep").click()
            expect(dialog).to_be_hidden()
            expect(panel.doors).to_be_hidden()
            expect(page.locator("#ladder-line")).to_contain_text("light of a room")
        before = camera.published()
        with timed("a place"):
            panel.place("sunset").click()
            wait_for_change(camera, before)
        assert camera.get("status")["unlit"] is False


def test_the_demo_person_by_the_second_door(nobody: FakeServer, open_page: OpenPage, timed: Timed) -> None:
    panel = open_panel(open_page, nobody.url)
    with timed("The demo person"):
        panel.page.locator("#door-demo").click()
        expect(panel.doors).to_be_hidden()
    assert nobody.get("subject")["name"] == "demo person"
    expect(panel.page.locator("#ladder-line")).to_contain_text("they do not exist")


def test_a_file_by_the_third_door(nobody: FakeServer, open_page: OpenPage, tmp_path: Path, timed: Timed) -> None:
    write_subject(tmp_path / "cleo.relit", captured("film"))
    panel = open_panel(open_page, nobody.url)
    with timed("Open a file"):
        with panel.page.expect_file_chooser() as chosen:
            panel.page.locator("#door-file").click()
        chosen.value.set_files(tmp_path / "cleo.relit")
        expect(panel.doors).to_be_hidden()
    assert nobody.get("subject")["name"] == "cleo"


def test_a_file_that_is_none_is_told_at_the_door(nobody: FakeServer, open_page: OpenPage, tmp_path: Path) -> None:
    (tmp_path / "cleo.relit").write_bytes(b"no subject at all")
    panel = open_panel(open_page, nobody.url)
    panel.page.locator("#door-file-input").set_input_files(tmp_path / "cleo.relit")
    expect(panel.page.locator("#doors-problem")).to_be_visible()
    expect(panel.doors).to_be_visible()
    assert nobody.get("subjects") == []


def test_a_capture_that_runs_already_is_told_and_joined(nobody: FakeServer, open_page: OpenPage) -> None:
    capture = nobody.camera.instant_capture
    capture.current = CaptureStatus(CaptureStage.FILMING, "me")
    capture.error = ConflictError("a capture runs already", "wait for its end, or cancel it")
    nobody.camera.setup.pull = ModelPullStatus(ModelStage.DONE)
    page = open_panel(open_page, nobody.url).page
    expect(page.locator("#doors-state")).to_contain_text("hold still")
    page.locator("#door-face").click()
    with page.expect_response(
        lambda answer: answer.request.method == "GET" and answer.url.endswith("captures/instant")
    ):
        page.locator("#face-start").click()
    expect(page.locator("#face-dialog")).to_have_attribute("data-step", "filming")
    capture.current = CaptureStatus(CaptureStage.DONE, "me")
    expect(page.locator("#face-dialog")).to_have_attribute("data-step", "done")


class Desk:
    """A stand-in webcam before the browser's screen: its picture is as bright as the page."""

    def __init__(self, server: FakeServer) -> None:
        self.webcam, self.recorder = FakeWebcam(), FrameRecorder()
        self.screen = 0.0
        server.camera.desk_capture = DeskFilming(  # type: ignore[assignment]
            self.recorder,
            server.camera.scene_controller,
            server.camera.events,
            check_and_build,
            lambda: nullcontext(self.webcam),
            ControlsNote(server.data, lambda: "stand-in"),
            lambda: 1 / 30,
            timings=DESK_TIMINGS,
        )

    @contextmanager
    def filming(self) -> Iterator[None]:
        """While the webcam gives frames."""
        stop = threading.Event()
        thread = threading.Thread(target=self._film, args=(stop,))
        thread.start()
        try:
            yield
        finally:
            stop.set()
            thread.join()

    def _film(self, stop: threading.Event) -> None:
        index = 0
        while not stop.wait(1 / 60):
            captured_at = time.monotonic()
            level = min(255.0, 10 + self.screen * self.webcam.brightness())
            picture = np.full((64, 64, 3), int(level), np.uint8)
            self.recorder.offer(Frame(picture, index, captured_at, index / 30))
            index += 1

    def look_at(self, page: Page) -> bool:
        """See how bright the page's patterns are; whether there are any."""
        code = page.evaluate(
            "() => document.getElementById('patterns').hidden ? null :"
            " [...document.getElementById('grid').children].map(each => parseInt(each.style.backgroundColor.slice(4)))"
        )
        self.screen = float(np.mean(code)) / 255 if code else 0.0
        return code is not None


def test_the_desk_with_a_stand_in_webcam(nobody: FakeServer, open_page: OpenPage, timed: Timed) -> None:
    desk = Desk(nobody)
    page = open_page(f"{nobody.url}desk")
    with desk.filming():
        with timed("read the warning"):
            page.locator("#understood").check()
            page.locator("#accept").click()
        with timed("the screen's size"):
            page.locator("#card-width").fill("300")
            expect(page.locator("#screen-size")).to_contain_text("cm")
            page.locator("#size-next").click()
        with timed("the webcam's place"):
            page.locator("#name").fill("at my desk")
            page.locator("#place-next").click()
        with timed("the patterns, full screen"):
            page.locator("#start").click()
            expect(page.locator("#patterns")).to_be_visible()
            wait_until(lambda: not desk.look_at(page), 100)
        with timed("computing"):
            expect(page.locator("#step-result")).to_be_visible(timeout=STEP_MS)
    expect(page.locator("#result-title")).to_have_text("That is you, measured")
    expect(page.locator("#result")).to_contain_text("at my desk")
    assert nobody.get("subject")["name"] == "at my desk"
    page.locator("#desk-done").click()
    expect(Panel(page).doors).to_be_hidden()
    expect(page.locator("#ladder-line")).to_contain_text("light of a screen")


def test_escape_ends_the_desk_s_patterns(nobody: FakeServer, open_page: OpenPage) -> None:
    desk = Desk(nobody)
    page = open_page(f"{nobody.url}desk")
    with desk.filming():
        page.locator("#understood").check()
        for button in ("#accept", "#size-next", "#place-next", "#start"):
            page.locator(button).click()
        expect(page.locator("#patterns")).to_be_visible()
        # Also where less motion is asked for, as here: edges of light are never sudden.
        expect(page.locator("#grid div").first).to_have_css("transition-duration", "0.12s")
        desk.look_at(page)
        page.keyboard.press("Escape")
        expect(page.locator("#patterns")).to_be_hidden()
        expect(page.locator("#result-title")).to_have_text("Stopped")
    assert nobody.get("subjects") == []


def test_a_film_from_its_upload_to_the_subject(
    nobody: FakeServer, open_page: OpenPage, tmp_path: Path, timed: Timed
) -> None:
    """The page's part: the worker is played by the test, with the events that it would send."""
    film = tmp_path / "film.mp4"
    film.write_bytes(demo_files.CLIP.read_bytes())
    page, worker = open_page(f"{nobody.url}film"), nobody.camera.film_capture
    with timed("read the warning, have a film"):
        page.locator("#have-film").click()
    with timed("upload"):
        page.locator("#film-file").set_input_files(film)
        page.locator("#film-name").fill("bea")
        page.locator("#film-upload").click()
        expect(page.locator("#step-work")).to_be_visible()
    assert worker.film.read_bytes() == film.read_bytes()
    expect(page.locator("#film-stages li")).to_have_count(2)
    with timed("cancel and go on"):
        page.locator("#film-cancel").click()
        expect(page.locator("#work-title")).to_have_text("Stopped")
        page.locator("#film-resume").click()
        expect(page.locator("#work-title")).to_have_text("Reading the film")
    with timed("stages by events"):
        worker.current = replace(worker.current, progress=0.5, stages=(FilmStep("Looking for flashes", "done", 4.0),))
        nobody.tell_film()
        expect(page.locator("#film-stages li").first).to_have_attribute("data-state", "done")
    write_subject(nobody.camera.scene_controller.subjects.new_path("bea"), captured("film"))
    worker.pictures = {"studio": encode_display(np.full((60, 60, 3), 90, np.uint8))}
    report = FilmReport(
        verdict="usable",
        because="the light came from few directions behind you",
        directions=72,
        covered_fraction=0.61,
        expected_db=31.0,
        frames=900,
        used=640,
        dropped=(DroppedFrames(12, "you had moved"),),
        warnings=("the room was bright: draw the curtain",),
        pictures=("/api/v1/captures/film/pictures/studio.jpg",),
    )
    with timed("report"):
        worker.current = replace(worker.current, stage=FilmStage.DONE, subject="bea", report=report, progress=1.0)
        nobody.tell_film()
        expect(page.locator("#film-verdict")).to_have_attribute("data-verdict", "usable")
    expect(page.locator("#film-because")).to_contain_text("few directions")
    expect(page.locator("#film-facts")).to_contain_text("61 %")
    expect(page.locator("#film-dropped")).to_contain_text("12: you had moved")
    wait_until(lambda: page.locator("#film-pictures img").evaluate("image => image.naturalWidth > 0"))
    with timed("Use it"):
        page.locator("#film-use").click()
        expect(page).to_have_url(re.compile(r"/$"))
    wait_until(lambda: nobody.get("subject")["name"] == "bea")
    expect(page.locator("#ladder-line")).to_contain_text("mirror ball")
