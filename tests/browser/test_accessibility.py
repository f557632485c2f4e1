"""The panel for everybody: axe-core finds nothing wrong, in every theme, at every width, in every dialog."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from axe_playwright_python.base import AXE_SCRIPT
from playwright.sync_api import Page, expect

from tests.browser.browser_pages import THEMES, WIDTHS, OpenPage
from tests.browser.cameras import FakeServer
from tests.browser.panel import Panel, open_panel

LAMPS = (
    {"azimuth_deg": 40, "elevation_deg": 20, "size_deg": 20, "color": [1, 0.1, 0.05], "intensity": 1},
    {"azimuth_deg": -60, "elevation_deg": 40, "size_deg": 30, "kelvin": 3200, "intensity": 0.5},
)


def findings(page: Page, where: str) -> list[str]:
    """What axe-core finds: rule, impact, and the elements."""
    if not page.evaluate("() => 'axe' in window"):
        page.evaluate(AXE_SCRIPT)
    found = page.evaluate("() => axe.run(document, {resultTypes: ['violations']})")
    return [
        f"{where}: {each['id']} ({each['impact']}): {[node['target'] for node in each['nodes']][:4]}"
        for each in found["violations"]
    ]


def is_wider_than_window(page: Page) -> bool:
    """Whether one has to scroll sideways."""
    return bool(page.evaluate("() => document.documentElement.scrollWidth > document.documentElement.clientWidth"))


def in_every_theme(page: Page, where: str, widths: tuple[int, ...] = WIDTHS) -> list[str]:
    """Findings at each width in each theme, overflow among them."""
    found = []
    for theme, media in THEMES.items():
        page.emulate_media(**media)
        for width in widths:
            page.set_viewport_size({"width": width, "height": 900})
            found += findings(page, f"{where}, {theme}, {width} px")
            if is_wider_than_window(page):
                found.append(f"{where}, {theme}, {width} px: wider than the window")
    return found


def test_the_panel(fake: FakeServer, open_page: OpenPage) -> None:
    fake.patch("lighting", lamps=LAMPS)
    fake.http.put("presets/evening").raise_for_status()
    panel = open_panel(open_page, fake.url)
    expect(panel.lamp(1)).to_be_visible()
    assert in_every_theme(panel.page, "panel") == []


def ask_to_save(panel: Panel) -> None:
    panel.ask_to_save_preset("evening")


def open_preset_menu(panel: Panel) -> None:
    panel.page.get_by_role("button", name="Options of evening").click()
    expect(panel.page.get_by_role("menuitem", name="Rename")).to_be_visible()


def open_lamp_card(panel: Panel) -> None:
    panel.lamp(0).focus()
    panel.page.keyboard.press("Enter")
    expect(panel.page.locator("#lamp-card")).to_be_visible()


def open_doors(panel: Panel) -> None:
    panel.page.locator("#ladder-people").click()
    expect(panel.doors).to_be_visible()


def open_unlit_dialog(panel: Panel) -> None:
    open_doors(panel)
    panel.page.locator("#door-unlit").click()
    expect(panel.page.locator("#unlit-dialog")).to_be_visible()


def open_face_dialog(panel: Panel) -> None:
    open_doors(panel)
    panel.page.locator("#door-face").click()
    expect(panel.page.locator("#face-dialog")).to_be_visible()


def open_stills_dialog(panel: Panel) -> None:
    panel.page.locator("#ladder-stills").click()
    expect(panel.page.locator("#stills-dialog")).to_be_visible()


def open_avatar_dialog(panel: Panel) -> None:
    panel.page.locator("#avatar-allow").click()
    expect(panel.page.locator("#ask")).to_be_visible()


def open_checklist(panel: Panel) -> None:
    expect(panel.page.locator("#checklist")).to_be_visible()
    panel.page.locator("#checklist summary").first.click()


OPENED: dict[str, Callable[[Panel], None]] = {
    "save a preset": ask_to_save,
    "a preset's menu": open_preset_menu,
    "a lamp's card": open_lamp_card,
    "doors": open_doors,
    "unlit": open_unlit_dialog,
    "my face": open_face_dialog,
    "expression stills": open_stills_dialog,
    "checklist": open_checklist,
    "somebody else's portrait": open_avatar_dialog,
}
"""How dialogs, menus and parts that are not always there are opened."""


@pytest.mark.parametrize("name", OPENED)
def test_what_opens_over_the_panel(fake: FakeServer, open_page: OpenPage, name: str) -> None:
    fake.patch("lighting", lamps=LAMPS)
    fake.http.put("presets/evening").raise_for_status()
    fake.show_to_another()
    panel = open_panel(open_page, fake.url)
    expect(panel.lamp(1)).to_be_visible()
    OPENED[name](panel)
    assert in_every_theme(panel.page, name, (390,)) == []  # it is laid out alike in wider windows


@pytest.mark.parametrize("path", ["desk", "film", "panel/login.html"])
def test_other_pages(fake: FakeServer, open_page: OpenPage, path: str) -> None:
    """Each step of them."""
    page = open_page(fake.url + path)
    expect(page.locator("h1").first).to_be_visible()
    found = in_every_theme(page, path, (390, 1440))
    for step in page.locator("[id^=step-]:is(section)").all():
        name = step.get_attribute("id")
        page.evaluate(
            "(name) => { for (const each of document.querySelectorAll('section[id^=step-]'))"
            " each.hidden = each.id !== name; }",
            name,
        )
        found += in_every_theme(page, f"{path} {name}", (390, 1440))
    assert found == []
