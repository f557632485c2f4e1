"""The stage of light: the ball over the picture, looks, places, undo, presets and devices, by pointer and by name."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from playwright.sync_api import Locator, expect

from relit_camera.base.images.color import LUMINANCE, rgb_from_kelvin
from relit_camera.live.status.setup_status import SpeedAdvice
from tests.api.api_client import hdr
from tests.browser.browser_pages import OpenPage
from tests.browser.cameras import START_S, FakeServer
from tests.browser.panel import Panel, open_panel
from tests.small_camera import wait_until

LOOKS = ("Key light", "Window", "Rembrandt", "Golden hour", "Neon", "Match my background")
LAMP = {"azimuth_deg": 45, "elevation_deg": 30, "kelvin": 4000}
RADIUS_PIXELS = 60
"""So far things are dragged."""


def look(panel: Panel, name: str) -> Locator:
    return panel.page.locator("#looks").get_by_role("button", name=name, exact=True)


def drag(panel: Panel, start: tuple[float, float], right: float, down: float) -> None:
    mouse = panel.page.mouse
    mouse.move(*start)
    mouse.down()
    mouse.move(start[0] + right, start[1] + down, steps=5)
    mouse.up()


def lamps(fake: FakeServer) -> list[dict[str, float]]:
    found: list[dict[str, float]] = fake.get("lighting")["lamps"]
    return found


def summary(fake: FakeServer) -> tuple[str, int, str]:
    """Place, number of lamps and kind of background of the scene: each look has others."""
    scene = fake.get("scene")
    return scene["lighting"]["environment"], len(scene["lighting"]["lamps"]), scene["background"]["kind"]


def shown_by_preset(fake: FakeServer, name: str) -> str:
    """The environment of a preset."""
    environment: str = fake.http.post(f"presets/{name}/apply").raise_for_status().json()["lighting"]["environment"]
    fake.patch("lighting", environment="sunset")
    return environment


def test_a_lamp_goes_where_it_is_dragged(fake: FakeServer, open_page: OpenPage) -> None:
    fake.patch("lighting", lamps=[LAMP])
    panel = open_panel(open_page, fake.url)
    dot = panel.lamp(0)
    expect(dot).to_have_attribute("aria-valuetext", "Lamp 1, 45 degrees left, 30 up")
    before = panel.middle(dot)
    drag(panel, before, -RADIUS_PIXELS, -RADIUS_PIXELS)
    expect(dot).not_to_have_attribute("aria-valuetext", re.compile("45 degrees left, 30 up"))
    # The preview is a mirror: left on the page is the picture's right.
    wait_until(lambda: lamps(fake)[0]["azimuth_deg"] > 46 and lamps(fake)[0]["elevation_deg"] > 31, START_S)
    assert panel.middle(dot) == pytest.approx((before[0] - RADIUS_PIXELS, before[1] - RADIUS_PIXELS), abs=4)


def test_the_empty_picture_turns_the_place(fake: FakeServer, open_page: OpenPage) -> None:
    panel = open_panel(open_page, fake.url)
    box = panel.page.locator("#ball").bounding_box()
    assert box is not None
    drag(panel, (box["x"] + 0.5 * box["width"], box["y"] + 0.9 * box["height"]), box["width"] / 4, 0)
    expect(panel.page.locator("#turn")).to_have_attribute("aria-valuetext", "turned 45 degrees to the right")
    fake.wait_for("lighting", yaw_deg=-45)


@pytest.mark.parametrize("leave", ["Escape", "a click elsewhere"])
def test_a_lamp_s_name_is_kept_however_its_card_is_left(fake: FakeServer, open_page: OpenPage, leave: str) -> None:
    fake.patch("lighting", lamps=[LAMP])
    panel = open_panel(open_page, fake.url)
    panel.lamp(0).click()
    name = panel.page.get_by_role("dialog", name="Lamp 1").get_by_role("textbox", name="Name")
    name.click()
    name.press_sequentially("Desk lamp")
    if leave == "Escape":
        name.press("Escape")
    else:
        panel.page.mouse.click(*panel.middle(panel.page.locator("h1")))
    wait_until(lambda: lamps(fake)[0].get("name") == "Desk lamp")


def test_the_keyboard_stays_near_what_is_removed(fake: FakeServer, open_page: OpenPage) -> None:
    for name in ("dawn", "dusk"):
        fake.http.put(f"presets/{name}").raise_for_status()
    panel = open_panel(open_page, fake.url)
    page, focused = panel.page, panel.page.locator(":focus")
    page.locator("#lamp-add").click()
    wait_until(lambda: len(lamps(fake)) == 1)
    panel.lamp(0).focus()
    page.keyboard.press("Control+z")
    expect(page.locator("#lamp-add")).to_be_focused()
    for left in ("dusk", "Presets"):
        page.locator("#presets .close").first.press("Enter")
        page.get_by_role("menuitem", name="Delete").press("Enter")
        page.locator("#ask-ok").click()
        expect(focused).to_have_text(left)


def test_a_place_of_the_command_line_is_not_asked_for_as_a_picture(fake: FakeServer, open_page: OpenPage) -> None:
    path = fake.data / "mine.hdr"
    path.write_bytes(hdr())
    fake.patch("lighting", environment=fake.camera.scene_controller.register_temporary_environment(str(path)))
    panel = open_panel(open_page, fake.url)
    panel.page.locator("#background-kind").get_by_role("button", name="Picture").click()
    wait_until(lambda: fake.get("background")["kind"] == "image")


def test_a_double_click_adds_a_lamp_there_and_its_card_changes_it(fake: FakeServer, open_page: OpenPage) -> None:
    panel = open_panel(open_page, fake.url)
    box = panel.page.locator("#ball").bounding_box()
    assert box is not None
    panel.page.mouse.dblclick(box["x"] + 0.1 * box["width"], box["y"] + 0.5 * box["height"])
    expect(panel.lamp(0)).to_have_attribute("aria-valuetext", re.compile("Lamp 1, 7[0-4] degrees left, level"))
    panel.lamp(0).click()
    card = panel.page.get_by_role("dialog", name="Lamp 1")
    card.get_by_role("textbox", name="Name").fill("Desk lamp")
    card.get_by_role("button", name="Mute").click()
    expect(panel.lamp(0)).to_have_attribute("aria-valuetext", re.compile("^Desk lamp, .*muted$"))
    panel.page.get_by_role("dialog", name="Desk lamp").get_by_role("button", name="Double").click()
    expect(panel.lamp(1)).to_be_attached()
    panel.page.keyboard.press("Escape")
    expect(panel.page.locator("#lamp-card")).to_be_hidden()
    expect(panel.lamp(1)).to_be_focused()
    panel.page.keyboard.press("Delete")
    expect(panel.lamp(1)).not_to_be_attached()
    wait_until(lambda: [(lamp["name"], lamp["muted"]) for lamp in lamps(fake)] == [("Desk lamp", True)], START_S)


@pytest.mark.parametrize("kelvin", [1800, 3000, 4500, 6500, 12000])
def test_warmth_has_the_colour_that_the_camera_gives_it(fake: FakeServer, open_page: OpenPage, kelvin: int) -> None:
    page = open_panel(open_page, fake.url).page
    found = page.evaluate(
        "kelvin => import('/panel/light/colors.js').then(colors => colors.linearOfKelvin(kelvin))", kelvin
    )
    np.testing.assert_allclose(found, rgb_from_kelvin(kelvin), atol=2e-3)
    assert float(np.dot(found, LUMINANCE)) == pytest.approx(1, abs=1e-3)


def test_points_of_the_ball_are_directions_and_back(fake: FakeServer, open_page: OpenPage) -> None:
    page = open_panel(open_page, fake.url).page
    worst = page.evaluate(
        """() => import('/panel/light/directions.js').then(({ pointOf, directionOf, wrap }) => {
          let worst = 0;
          for (const mirrored of [false, true])
            for (let azimuth = -170; azimuth <= 170; azimuth += 17)
              for (let elevation = -80; elevation <= 80; elevation += 16) {
                const { x, y } = pointOf(azimuth, elevation, mirrored);
                const back = directionOf(x, y, mirrored);
                const across = Math.abs(wrap(back.azimuth_deg - azimuth)) * Math.cos(elevation * Math.PI / 180);
                worst = Math.max(worst, across, Math.abs(back.elevation_deg - elevation));
              }
          return worst;
        })"""
    )
    assert worst <= 1  # it is rounded to whole degrees


def test_each_look_is_one_click(fake: FakeServer, open_page: OpenPage) -> None:
    panel = open_panel(open_page, fake.url)
    seen = [summary(fake)]
    for name in LOOKS:
        look(panel, name).click()
        expect(look(panel, name)).to_have_attribute("aria-pressed", "true")
        expect(panel.page.locator("#looks [aria-pressed=true]")).to_have_count(1)
        wait_until(lambda: summary(fake) not in seen, START_S)
        seen.append(summary(fake))
    expect(panel.message).not_to_be_attached()


def test_a_place_is_also_behind_one_unless_the_background_is_kept(fake: FakeServer, open_page: OpenPage) -> None:
    panel = open_panel(open_page, fake.url)
    keep = panel.page.get_by_role("button", name="Keep my background")
    panel.place("party").click()
    fake.wait_for("background", kind="environment")
    panel.page.locator("#background-kind").get_by_role("button", name="Colour").click()
    fake.wait_for("background", kind="color")
    expect(keep).to_have_attribute("aria-pressed", "true")
    panel.place("sunset").click()
    fake.wait_for("lighting", environment="sunset")
    assert fake.get("background")["kind"] == "color"
    keep.click()
    panel.place("window").click()
    fake.wait_for("background", kind="environment")


def test_a_look_s_lamps_go_with_it_and_one_s_own_stay(fake: FakeServer, open_page: OpenPage) -> None:
    panel = open_panel(open_page, fake.url)
    look(panel, "Neon").click()
    expect(panel.lamp(1)).to_be_attached()
    panel.place("studio").click()
    expect(panel.lamp(0)).not_to_be_attached()
    panel.page.get_by_role("button", name="Add lamp").click()
    panel.page.keyboard.press("Escape")
    panel.place("party").click()
    fake.wait_for("lighting", environment="party")
    assert len(lamps(fake)) == 1


def test_undo_redo_and_reset(fake: FakeServer, open_page: OpenPage) -> None:
    panel = open_panel(open_page, fake.url)
    panel.place("party").click()
    fake.wait_for("lighting", environment="party")
    panel.page.wait_for_timeout(1100)  # changes of the same fields within a second are one step
    panel.place("sunset").click()
    fake.wait_for("lighting", environment="sunset")
    panel.page.get_by_role("button", name="Undo").click()
    expect(panel.place("party")).to_have_attribute("aria-pressed", "true")
    panel.page.keyboard.press("Control+Shift+z")
    expect(panel.place("sunset")).to_have_attribute("aria-pressed", "true")
    panel.page.keyboard.press("Control+z")
    expect(panel.place("party")).to_have_attribute("aria-pressed", "true")
    panel.page.get_by_role("button", name="Reset everything").click()
    expect(panel.place("studio")).to_have_attribute("aria-pressed", "true")


def test_a_preset_is_renamed_and_shown_at_start_by_the_keyboard(fake: FakeServer, open_page: OpenPage) -> None:
    panel = open_panel(open_page, fake.url)
    panel.ask_to_save_preset("evening")
    panel.confirm()
    expect(panel.preset("evening")).to_be_visible()
    panel.page.get_by_role("button", name="Options of evening").press("Enter")
    expect(panel.page.get_by_role("menuitem", name="Rename")).to_be_focused()
    panel.page.keyboard.press("ArrowDown")
    panel.page.keyboard.press("Enter")
    expect(panel.page.locator("#presets")).to_contain_text("at start")
    panel.page.get_by_role("button", name="Options of evening").click()
    panel.page.get_by_role("menuitem", name="Rename").click()
    panel.page.locator("#ask-text").fill("night")
    panel.page.keyboard.press("Enter")
    expect(panel.preset("night")).to_be_visible()
    assert fake.get("presets") == [{"name": "night", "at_start": True}]


def test_a_preset_is_replaced_only_when_that_was_confirmed(fake: FakeServer, open_page: OpenPage) -> None:
    panel = open_panel(open_page, fake.url)
    panel.place("party").click()
    fake.wait_for("lighting", environment="party")
    panel.ask_to_save_preset("evening")
    panel.confirm()
    expect(panel.preset("evening")).to_be_visible()
    panel.place("sunset").click()
    fake.wait_for("lighting", environment="sunset")
    for confirmed, kept in ((False, "party"), (True, "sunset")):
        panel.choose_option("evening", "Replace with this look")
        expect(panel.page.locator("#ask-title")).to_have_text("Replace “evening”?")
        panel.page.locator("#ask-ok" if confirmed else "#ask-cancel").click()
        expect(panel.page.locator("#ask")).to_be_hidden()
        wait_until(lambda: shown_by_preset(fake, "evening") == kept)  # noqa: B023


def test_too_slow_is_cured_by_one_click(fake: FakeServer, open_page: OpenPage) -> None:
    panel = open_panel(open_page, fake.url)
    fake.camera.base = replace(fake.camera.base, advice=SpeedAdvice("too slow", "try 640x360", 640, 360))
    panel.page.get_by_role("button", name="Use 640 × 360").click()
    fake.wait_for("source", width=640, height=360)
