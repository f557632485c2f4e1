"""The small pictures of the panel: looks, places, and the strip that holds them."""

from __future__ import annotations

import time

import pytest
from playwright.sync_api import Page, Route, expect

from tests.browser.browser_pages import OpenPage
from tests.browser.cameras import FakeServer
from tests.browser.panel import BUILT_IN_PLACES, open_panel
from tests.small_camera import WAIT_S, wait_until

SIDES = """canvas => {
  const {width, height} = canvas;
  const {data} = canvas.getContext("2d").getImageData(0, 0, width, height);
  const row = Math.round(height * 0.4) * width;
  const at = (x) => [...data.slice(4 * (row + Math.round(x)), 4 * (row + Math.round(x)) + 3)];
  return [at(width / 2 - height * 0.15), at(width / 2 + height * 0.15)];
}"""
"""Colours of the two halves of the head in a look's picture, the picture's left first."""


def sides(page: Page, look: str) -> list[list[int]]:
    tile = page.locator("#looks").get_by_role("button", name=look, exact=True)
    found: list[list[int]] = tile.locator("canvas").evaluate(SIDES)
    return found


def test_a_look_s_picture_is_lit_from_where_its_lamps_are_in_their_colours(
    fake: FakeServer, open_page: OpenPage
) -> None:
    page = open_panel(open_page, fake.url).page
    # The ground is drawn first, the head once the picture of what is behind it has come.
    wait_until(lambda: all(left != right for left, right in (sides(page, look) for look in ("Neon", "Rembrandt"))))
    left, right = sides(page, "Neon")
    assert left[0] > 2 * left[1], "magenta from azimuth -75, the picture's left"
    assert right[2] > 2 * right[0], "cyan from azimuth 75"
    dark, bright = sides(page, "Rembrandt")[::-1]
    assert sum(bright) > 3 * sum(dark), "the key light of Rembrandt is at azimuth -55"
    assert bright[0] > bright[2], "and warm"


def test_pictures_of_looks_are_mirrored_as_the_preview_is(fake: FakeServer, open_page: OpenPage) -> None:
    page = open_panel(open_page, fake.url).page
    picture = page.locator("#looks canvas").first
    expect(picture).to_have_css("transform", "matrix(-1, 0, 0, 1, 0, 0)")
    page.locator("#mirror").click()
    expect(picture).to_have_css("transform", "none")


@pytest.mark.parametrize("width", [390, 768])
def test_the_strip_of_places_reaches_the_edge_and_shows_that_it_goes_on(
    fake: FakeServer, open_page: OpenPage, width: int
) -> None:
    page = open_panel(open_page, fake.url, viewport={"width": width, "height": 900}).page
    strip = page.locator("#environments").bounding_box()
    assert strip is not None
    assert strip["x"] == 0
    assert strip["width"] == width
    boxes = [tile.bounding_box() for tile in page.locator("#environments .tile").all()]
    cut = [box for box in boxes if box is not None and box["x"] < width < box["x"] + box["width"]]
    assert len(cut) == 1
    assert 0.25 < (width - cut[0]["x"]) / cut[0]["width"] < 0.75


def test_a_place_is_never_grey_while_its_picture_on_oneself_is_made(fake: FakeServer, open_page: OpenPage) -> None:
    held: list[Route] = []

    def hold(route: Route) -> None:
        held.append(route)

    page = open_page("about:blank", reduced_motion="no-preference")
    page.route("**/on-me.jpg*", hold)
    page.goto(fake.url)
    pictures = page.locator("#environments img")
    expect(pictures).to_have_count(BUILT_IN_PLACES)
    loaded = "images => images.every(each => each.complete && each.naturalWidth > 0)"
    began = time.monotonic()
    while not pictures.evaluate_all(loaded):
        page.wait_for_timeout(50)
        assert time.monotonic() < began + WAIT_S
    page.evaluate(
        """() => { window.grey = 0;
          new MutationObserver(() => {
            for (const face of document.querySelectorAll("#environments .face")) {
              const shown = [...face.querySelectorAll("img")].some((each) => each.complete && each.naturalWidth > 0);
              if (!shown) window.grey += 1;
            }
          }).observe(document.querySelector("#environments"), {subtree: true, childList: true, attributes: true});
        }"""
    )
    held[0].continue_()
    expect(page.locator('#environments img[src*="on-me.jpg"]')).to_have_count(1)
    expect(pictures).to_have_count(BUILT_IN_PLACES)  # what was beneath is gone once it is covered
    assert page.evaluate("() => window.grey") == 0


def test_what_is_seen_is_loaded_first(fake: FakeServer, open_page: OpenPage) -> None:
    page = open_panel(open_page, fake.url).page
    order = page.evaluate(
        """async () => {
          const {loadPicture} = await import("/panel/pictures.js");
          const order = [];
          const images = ["below 1", "below 2", "seen"].map((name) => {
            const image = new Image(10, 10);
            Object.assign(image.style, {position: "absolute", left: "0", top: name === "seen" ? "0" : "5000px"});
            document.body.append(image);
            return [name, image];
          });
          const url = "/api/v1/environments/party/thumbnail.jpg?";
          await Promise.all(images.map(([name, image]) =>
            loadPicture(image, url + name, "made").then(() => order.push(name))));
          return order;
        }"""
    )
    assert order.index("seen") < order.index("below 2")
