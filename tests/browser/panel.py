"""The panel as tests use it: what is where on the page. Names that the panel promises are written here once."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from urllib.parse import parse_qs, urlsplit

from playwright.sync_api import Locator, Page, expect

from tests.browser.browser_pages import OpenPage
from tests.browser.cameras import START_S
from tests.small_camera import wait_until

CLICK_MS = 80
"""How long a person's finger holds the button."""
BUILT_IN_PLACES = 6
MOST_ENTRIES = 6
COLOR = re.compile(r"rgba?\((\d+), (\d+), (\d+)")


class Panel:
    """The panel's main page in a browser.

    Attributes:
        page: it.
        preview: the picture that others see.
        rate: how many frames a second there are.
        unlit: says that the webcam's own picture is published.
        thumbnails: the pictures of the places.
        doors: the ways to be seen, over the picture of who has no subject yet.
        lamps_only: the tile that takes the place's light away.
        message: the newest message.
    """

    def __init__(self, page: Page) -> None:
        self.page = page
        self.preview = page.locator("#preview")
        self.rate = page.locator("#figure-fps")
        self.unlit = page.locator("#unlit")
        self.doors = page.locator("#doors")
        self.thumbnails = page.locator("#environments img")
        self.lamps_only = page.locator("#environments").get_by_role("button", name="Lamps only")
        self.message = page.locator("#toasts > *").last

    def wait_for_picture(self) -> None:
        """Wait until the preview shows its first picture."""
        wait_until(lambda: self.preview.evaluate("image => image.naturalWidth > 0"), START_S)

    def middle(self, element: Locator) -> tuple[float, float]:
        """Where the middle of an element is seen."""
        element.scroll_into_view_if_needed()
        box = element.bounding_box()
        assert box is not None
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def thumbnails_shown(self) -> bool:
        """Whether the pictures of all places are loaded."""
        loaded = self.thumbnails.evaluate_all("images => images.map(each => each.complete && each.naturalWidth > 0)")
        return len(loaded) >= BUILT_IN_PLACES and all(loaded)

    def places_shown_on_me(self) -> int:
        """How many places are shown on the face of who is shown."""
        return self.page.locator('#environments img[src*="on-me.jpg"]').count()

    def preview_width(self) -> int:
        """The width in pixels that the preview is asked for with."""
        query = urlsplit(self.preview.get_attribute("src") or "").query
        return int(parse_qs(query).get("width", ["0"])[0])

    @contextmanager
    def before(self) -> Iterator[None]:
        """While the picture as it was filmed is held in the preview."""
        self.page.mouse.move(*self.middle(self.page.locator("#before")))
        self.page.mouse.down()
        expect(self.page.locator("#before-picture")).to_be_visible()
        yield
        self.page.mouse.up()
        expect(self.page.locator("#before-picture")).to_be_hidden()

    def place(self, name: str) -> Locator:
        """The tile of an environment."""
        shown = re.compile(f"^{name.replace('-', '[- ]')}$", re.IGNORECASE)
        return self.page.locator("#environments").get_by_role("button", name=shown)

    def slider(self, name: str) -> Locator:
        return self.page.get_by_role("slider", name=name, exact=True)

    def lamp(self, index: int) -> Locator:
        """The dot of a lamp."""
        return self.page.locator(f'#ball [data-lamp="{index}"]')

    def hide(self) -> None:
        """As when another tab is looked at: the page is told that nobody sees it."""
        self.page.evaluate(
            "() => { Object.defineProperty(document, 'hidden', {value: true, configurable: true});"
            " document.dispatchEvent(new Event('visibilitychange')); }"
        )

    def lamp_color(self, index: int) -> tuple[int, int, int]:
        """The colour that the dot of a lamp has, 0 to 255."""
        disc = self.lamp(index).locator(".disc")
        found = COLOR.match(disc.evaluate("disc => getComputedStyle(disc).backgroundColor"))
        assert found is not None
        return int(found[1]), int(found[2]), int(found[3])

    def preset(self, name: str) -> Locator:
        """The button that shows a preset."""
        return self.page.locator("#presets").get_by_role("button", name=name, exact=True)

    def ask_to_save_preset(self, name: str) -> None:
        """Open the dialog that names a preset, and type a name; it is not sent yet."""
        self.page.locator("#preset-save").click()
        expect(self.page.locator("#ask")).to_be_visible()
        self.page.locator("#ask-text").fill(name)

    def confirm(self) -> None:
        """Send what the dialog has."""
        self.page.locator("#ask-ok").click()

    def choose_subject(self, name: str) -> None:
        """Choose who is shown; "" is nobody."""
        self.face(name or "Nobody").click()

    def face(self, name: str) -> Locator:
        """The tile of a captured face."""
        return self.page.locator("#faces").get_by_role("button", name=name, exact=True)

    def choose_option(self, of: str, entry: str) -> None:
        """Choose an entry of the menu of a face or a preset, by the keyboard."""
        self.page.get_by_role("button", name=f"Options of {of}").press("Enter")
        item = self.page.get_by_role("menuitem", name=entry, exact=True).locator("visible=true")
        for _ in range(MOST_ENTRIES):
            if item.evaluate("each => each === document.activeElement"):
                break
            self.page.keyboard.press("ArrowDown")
        self.page.keyboard.press("Enter")

    def what_has_the_focus(self) -> str:
        """Id or text of the element that has the keyboard; "" where it is nowhere."""
        found: str = self.page.evaluate(
            "() => document.activeElement === document.body ? '' :"
            " document.activeElement.id || document.activeElement.textContent.trim()"
        )
        return found


def open_panel(open_page: OpenPage, url: str, **options: object) -> Panel:
    """The panel, once it is connected to its camera."""
    panel = Panel(open_page(url, **options))
    expect(panel.place("party")).to_be_attached(timeout=20_000)
    expect(panel.page.locator("#state-text")).not_to_contain_text("Connecting")
    return panel
