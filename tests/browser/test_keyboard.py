"""The panel without a mouse: everything is reached, in the order of the page, and one sees where one is."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from playwright.sync_api import Page, Route, expect

from relit_camera.live.status.setup_status import SpeedAdvice
from tests.browser.browser_pages import OpenPage
from tests.browser.cameras import FakeServer
from tests.browser.panel import open_panel
from tests.small_camera import wait_until

MOST_STOPS = 200
FOCUSED = """() => {
  const element = document.activeElement;
  if (!element || element === document.body) return null;
  const shown = [element, element.parentElement, element.nextElementSibling].filter(Boolean);
  const outlined = shown.some((each) => {
    const style = getComputedStyle(each);
    return style.outlineStyle !== "none" && parseFloat(style.outlineWidth) >= 1;
  });
  element.dataset.reached = "yes";
  const all = [...document.querySelectorAll("*")];
  const box = element.getBoundingClientRect();
  const inside = box.bottom > 0 && box.top < innerHeight && box.right > 0 && box.left < innerWidth;
  const name = element.id || element.className || element.tagName;
  return {what: name + ": " + (element.ariaLabel || element.textContent.trim()),
          place: all.indexOf(element), outlined, inside, tabindex: element.tabIndex};
}"""
"""Tells what has the focus, marks it, and whether an outline shows it and it is within the window."""
MISSED = """() => {
  const controls = "a[href], button, input, select, textarea, summary, [tabindex], [contenteditable]";
  return [...document.querySelectorAll(controls)]
    .filter((each) => each.checkVisibility({visibilityProperty: true}) && !each.disabled && !each.dataset.reached)
    .filter((each) => each.type !== "radio" || !document.querySelector(`[name="${each.name}"][data-reached]`))
    .filter((each) => each.tabIndex >= 0 || each.matches("a, button, input, select, textarea, summary"))
    .filter((each) => !each.closest("[inert], dialog:not([open])"))
    .filter((each) => !(each.tabIndex < 0 && each.closest("[role=radiogroup], [role=menu], [role=tablist]")))
    .map((each) => (each.id || each.className || each.tagName) + ": " + each.textContent.trim());
}"""
"""Controls that can be seen and were never reached."""


def walk(page: Page) -> list[dict[str, Any]]:
    """Press Tab until it leaves the page; what had the focus, in order."""
    stops: list[dict[str, Any]] = []
    for _ in range(MOST_STOPS):
        page.keyboard.press("Tab")
        stop = page.evaluate(FOCUSED)
        if stop is None or (stops and stop["place"] == stops[0]["place"]):
            return stops
        stops.append(stop)
    raise AssertionError(f"Tab never leaves the page: {[stop['what'] for stop in stops[-5:]]}")


@pytest.mark.parametrize("width", [390, 1440])
@pytest.mark.parametrize("path", ["", "desk"])
def test_tab_reaches_everything_in_order_and_shows_where_one_is(
    fake: FakeServer, open_page: OpenPage, path: str, width: int
) -> None:
    lamp = {"azimuth_deg": 40, "elevation_deg": 20, "size_deg": 20, "kelvin": 4000, "intensity": 1}
    fake.patch("lighting", lamps=[lamp])
    fake.http.put("presets/evening").raise_for_status()
    options = {"viewport": {"width": width, "height": 900}}
    page = open_panel(open_page, fake.url, **options).page if path == "" else open_page(fake.url + path, **options)
    if path == "":
        expect(page.locator("#presets").get_by_role("button", name="evening", exact=True)).to_be_visible()
    closed = page.locator("details:not([open]) > summary:visible")
    while closed.count():
        closed.first.click()
    page.evaluate("() => scrollTo({top: 0, behavior: 'instant'})")  # a summary further down was clicked
    page.mouse.click(1, 1)
    page.evaluate("() => document.activeElement.blur()")
    stops = walk(page)
    assert len(stops) >= 3
    assert page.evaluate(MISSED) == []
    assert [stop["what"] for stop in stops if not stop["outlined"]] == []
    assert [stop["what"] for stop in stops if not stop["inside"]] == []
    assert [stop["what"] for stop in stops if stop["tabindex"] > 0] == []
    places = [stop["place"] for stop in stops]
    assert places == sorted(places)


def test_arrow_keys_move_a_lamp_as_it_is_seen(fake: FakeServer, open_page: OpenPage) -> None:
    """The preview is mirrored as a mirror is: to the right on the page is to the left in the picture."""
    lamp = {"azimuth_deg": 40, "elevation_deg": 20, "size_deg": 20, "kelvin": 4000, "intensity": 1}
    fake.patch("lighting", lamps=[lamp])
    panel = open_panel(open_page, fake.url)

    def place() -> tuple[float, float]:
        (lamp,) = fake.get("lighting")["lamps"]
        return lamp["azimuth_deg"], lamp["elevation_deg"]

    panel.lamp(0).focus()
    panel.page.keyboard.press("ArrowRight")
    wait_until(lambda: place()[0] < 40)
    panel.page.keyboard.press("ArrowUp")
    wait_until(lambda: place()[1] > 20)
    for _ in range(3):
        panel.page.keyboard.press("ArrowLeft")
    panel.page.keyboard.press("ArrowDown")
    wait_until(lambda: place()[0] > 40 and place()[1] == 20)


def test_a_dialog_keeps_the_keyboard_and_gives_it_back(fake: FakeServer, open_page: OpenPage) -> None:
    page = open_panel(open_page, fake.url).page
    page.locator("#preset-save").focus()
    page.keyboard.press("Enter")
    expect(page.locator("#ask-text")).to_be_focused()
    for _ in range(6):
        page.keyboard.press("Tab")
        assert page.evaluate(
            "() => document.activeElement === document.body || document.activeElement.closest('dialog') !== null"
        )
    page.keyboard.press("Escape")
    expect(page.locator("#ask")).to_be_hidden()
    expect(page.locator("#preset-save")).to_be_focused()
    assert fake.get("presets") == []


def test_the_keyboard_is_never_nowhere(fake: FakeServer, open_page: OpenPage) -> None:
    """What has the focus goes away by its own action: its place has the focus then."""
    panel = open_panel(open_page, fake.url)
    panel.place("party").click()
    expect(panel.page.locator("#undo")).to_be_enabled()
    panel.page.locator("#undo").press("Enter")
    expect(panel.page.locator("#undo")).to_be_disabled()
    expect(panel.page.locator("#undo")).to_be_focused()
    fake.camera.base = replace(fake.camera.base, advice=SpeedAdvice("too slow", "try 640x360", 640, 360))
    panel.page.get_by_role("button", name="Use 640 × 360").press("Enter")
    fake.wait_for("source", width=640, height=360)
    fake.camera.base = replace(fake.camera.base, advice=None)
    expect(panel.page.locator("#advice")).to_be_hidden()
    wait_until(lambda: panel.what_has_the_focus() != "")
    panel.page.locator("#rate").select_option("15")
    panel.page.locator("#rate").focus()
    fake.wait_for("source", fps=15)
    expect(panel.page.locator("#rate")).to_be_focused()


def test_a_webcam_that_is_plugged_in_is_there_for_the_keyboard(fake: FakeServer, open_page: OpenPage) -> None:
    panel = open_panel(open_page, fake.url)
    options = panel.page.locator("#webcam option")
    expect(options.first).to_be_attached()
    before = options.count()
    panel.page.route("**/api/v1/devices", add_webcam)
    panel.page.locator("#webcam").focus()
    expect(options).to_have_count(before + 1)


def add_webcam(route: Route) -> None:
    """Answer with one webcam more than there is."""
    answer = route.fetch()
    found = answer.json()
    found["webcams"].append({"device": "/dev/video7", "name": "New", "sizes": [], "in_use_by": [], "is_current": False})
    route.fulfill(response=answer, json=found)


def test_a_hidden_file_field_lies_in_its_button(fake: FakeServer, open_page: OpenPage) -> None:
    """Else the page would be scrolled to somewhere else when it gets the focus."""
    page = open_panel(open_page, fake.url, viewport={"width": 390, "height": 844}).page
    places = page.locator("input.unseen").evaluate_all("inputs => inputs.map(each => each.offsetParent?.tagName ?? '')")
    assert "LABEL" in places
    assert set(places) <= {"LABEL", ""}  # nothing where the button is hidden
