"""The pages that capture: what stops them, and what they do when the page is hidden or an answer does not come."""

from __future__ import annotations

from dataclasses import replace

import pytest
from playwright.sync_api import Page, Route, expect

from relit_camera.live.status.desk_status import DeskStage
from relit_camera.live.status.film_status import FilmStage
from tests.browser.browser_pages import OpenPage
from tests.browser.cameras import FakeServer
from tests.browser.panel import Panel
from tests.small_camera import wait_until

SCREEN = {"width": 1280, "height": 900}
ZOOM = 1.25
CARD_PIXELS = 320
"""How wide the frame is that fits the bank card, in pixels of the screen."""
CARD_CM = 8.56
DESK = "**/api/v1/captures/desk"


@pytest.fixture
def desk(fake: FakeServer, open_page: OpenPage) -> Page:
    """The page of the desk capture, at its last step before the patterns."""
    page = open_page(f"{fake.url}desk")
    page.locator("#understood").check()
    for button in ("#accept", "#size-next", "#place-next"):
        page.locator(button).click()
    expect(page.locator("#start")).to_be_enabled()
    return page


def test_escape_while_the_desk_s_patterns_begin_stops_them(fake: FakeServer, desk: Page) -> None:
    asked: list[Route] = []
    desk.route(DESK, lambda route: route.continue_() if route.request.method == "DELETE" else asked.append(route))
    with desk.expect_request(DESK):
        desk.locator("#start").click()
    desk.keyboard.press("Escape")
    asked[0].continue_()
    expect(desk.locator("#result-title")).to_have_text("Stopped")
    assert fake.camera.desk_capture.status().stage is DeskStage.CANCELED


def test_another_size_of_the_window_stops_the_desk_s_patterns(fake: FakeServer, desk: Page) -> None:
    desk.locator("#start").click()
    expect(desk.locator("#patterns")).to_be_visible()
    desk.set_viewport_size({"width": 900, "height": 700})
    expect(desk.locator("#desk-problem")).to_contain_text("size changed")
    assert fake.camera.desk_capture.status().stage is DeskStage.CANCELED


@pytest.mark.parametrize("zoomed", ["before", "after"])
def test_the_size_of_the_screen_is_true_whatever_the_page_s_zoom(
    fake: FakeServer, open_page: OpenPage, zoomed: str
) -> None:
    """A zoom of 125 % makes CSS pixels larger; the screen stays as it is, and so does the card that was held to it."""
    page = open_page(f"{fake.url}desk", viewport=SCREEN, screen=SCREEN)
    devtools = page.context.new_cdp_session(page)

    def zoom() -> None:
        size = {each: round(SCREEN[each] / ZOOM) for each in ("width", "height")}
        screen = {"screenWidth": SCREEN["width"], "screenHeight": SCREEN["height"]}
        metrics = size | screen | {"deviceScaleFactor": ZOOM, "mobile": False}
        devtools.send("Emulation.setDeviceMetricsOverride", metrics)

    card = CARD_PIXELS
    if zoomed == "before":
        zoom()
        card = round(CARD_PIXELS / ZOOM)
    page.locator("#understood").check()
    page.locator("#accept").click()
    page.locator("#card-width").evaluate(
        "(slider, width) => { slider.value = width; slider.dispatchEvent(new Event('input')); }", card
    )
    page.locator("#size-next").click()
    if zoomed == "after":
        zoom()
    page.locator("#place-next").click()
    with page.expect_request(lambda request: request.method == "POST" and request.url.endswith("desk")) as asked:
        page.locator("#start").click()
    body = asked.value.post_data_json
    assert body is not None
    assert body["screen_width_cm"] == pytest.approx(CARD_CM * SCREEN["width"] / CARD_PIXELS, rel=0.005)
    assert body["screen_height_cm"] == pytest.approx(CARD_CM * SCREEN["height"] / CARD_PIXELS, rel=0.005)


def test_without_the_whole_screen_the_desk_s_patterns_do_not_begin(fake: FakeServer, desk: Page) -> None:
    desk.evaluate("() => { document.documentElement.requestFullscreen = () => Promise.reject(new Error('no')); }")
    desk.locator("#start").click()
    expect(desk.locator("#desk-problem")).to_contain_text("whole screen")
    assert fake.camera.desk_capture.status().stage is DeskStage.IDLE


def test_a_missed_answer_does_not_end_the_desk_s_computing(fake: FakeServer, open_page: OpenPage) -> None:
    capture = fake.camera.desk_capture
    capture.current = replace(capture.current, stage=DeskStage.BUILDING, subject="desk")
    page = open_page(f"{fake.url}desk")
    expect(page.locator("#step-building")).to_be_visible()
    with page.expect_event("requestfailed"):
        page.route(DESK, lambda route: route.abort())
    page.unroute(DESK)
    capture.current = replace(capture.current, stage=DeskStage.DONE)
    expect(page.locator("#result-title")).to_have_text("That is you, measured")


def test_a_hidden_page_lets_the_webcam_rest(fake: FakeServer, desk: Page) -> None:
    setup, picture = fake.camera.setup, desk.locator("#face-picture")
    wait_until(lambda: setup.framing_wanted)
    Panel(desk).hide()
    wait_until(lambda: not setup.framing_wanted)
    assert picture.get_attribute("src") is None
    desk.evaluate("() => { delete document.hidden; document.dispatchEvent(new Event('visibilitychange')); }")
    wait_until(lambda: setup.framing_wanted)
    assert "before=true" in (picture.get_attribute("src") or "")


def test_the_box_is_round_the_face_where_the_picture_has_bars(fake: FakeServer, desk: Page) -> None:
    """The picture is 16:9; in a low window it has bars on both sides."""
    desk.set_viewport_size({"width": 1280, "height": 500})
    box = desk.locator(".face-box")
    fake.camera.events.publish("framing", **fake.get("framing"))
    expect(box).to_be_visible()
    face, picture = box.bounding_box(), desk.locator("#face-picture").bounding_box()
    assert face is not None
    assert picture is not None
    left, _, width, _ = fake.get("framing")["box"]
    wide = picture["height"] * 16 / 9
    assert face["width"] == pytest.approx(width * wide, abs=3)
    middle = picture["x"] + picture["width"] / 2
    assert face["x"] + face["width"] / 2 - middle == pytest.approx((0.5 - left - width / 2) * wide, abs=3)


def test_an_old_film_does_not_take_the_page_away(fake: FakeServer, open_page: OpenPage) -> None:
    worker = fake.camera.film_capture
    worker.current = replace(worker.current, stage=FilmStage.FAILED, what="no flashes were found", can_resume=True)
    page = open_page(f"{fake.url}film")
    expect(page.locator("#film-last")).to_be_visible()
    page.locator("#have-film").click()
    fake.tell_film()
    page.evaluate("() => document.dispatchEvent(new Event('visibilitychange'))")  # opens the events anew
    page.wait_for_timeout(300)
    expect(page.locator("#step-upload")).to_be_visible()
    page.go_back()
    page.locator("#film-last-open").click()
    expect(page.locator("#film-problem")).to_contain_text("No flashes were found")


def test_a_wrong_field_of_the_film_is_shown(fake: FakeServer, open_page: OpenPage) -> None:
    page = open_page(f"{fake.url}film")
    page.locator("#have-film").click()
    page.locator("#film-file").set_input_files({"name": "film.mp4", "mimeType": "video/mp4", "buffer": b"film"})
    page.locator("#focal").evaluate("field => { field.value = '5'; }")
    page.locator("#film-upload").click()
    expect(page.locator("#focal")).to_be_focused()
    expect(page.locator("#focal")).to_be_visible()
