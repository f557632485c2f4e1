"""Files that are added in the panel: what it says meanwhile, names that are taken, and files that it does not send."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import FilePayload, expect

from relit_camera.api.middleware.body_limits import MAX_UPLOAD_BYTES, STREAMED_FORMS
from relit_camera.app.captures.film.film_folder import SUFFIXES
from tests.api.api_client import hdr
from tests.browser.browser_pages import TIMEOUT_MS, OpenPage
from tests.browser.cameras import FakeServer
from tests.browser.panel import open_panel
from tests.small_camera import wait_until

PANORAMA: FilePayload = {"name": "party.hdr", "mimeType": "image/vnd.radiance", "buffer": hdr()}
"""Named as a built-in place is."""
HOLD = """() => {
  const send = XMLHttpRequest.prototype.send;
  XMLHttpRequest.prototype.send = function (form) { window.release = () => send.call(this, form); };
}"""
"""Lets an upload begin only when the test releases it."""


def test_a_panorama_is_uploaded_visibly_and_numbered(fake: FakeServer, open_page: OpenPage) -> None:
    panel = open_panel(open_page, fake.url)
    page = panel.page
    page.evaluate(HOLD)
    label = page.locator("label", has=page.locator("#environment-file"))
    page.locator("#environment-file").focus()
    page.locator("#environment-file").set_input_files(PANORAMA)
    expect(label).to_contain_text("Uploading…")
    expect(page.locator("#environment-file")).to_be_disabled()
    expect(page.locator("#environment-file")).to_be_focused()
    page.evaluate("() => window.release()")
    expect(panel.place("party 2")).to_have_attribute("aria-pressed", "true", timeout=TIMEOUT_MS)
    expect(label).to_have_text("Add panorama")
    expect(page.locator("#environment-file")).to_be_enabled()
    page.locator("#environment-file").set_input_files(PANORAMA)
    expect(label).to_contain_text("Uploading…")
    page.evaluate("() => window.release()")
    expect(panel.place("party 3")).to_have_attribute("aria-pressed", "true", timeout=TIMEOUT_MS)


def test_a_name_that_was_taken_meanwhile_is_numbered_too(fake: FakeServer, open_page: OpenPage) -> None:
    page = open_panel(open_page, fake.url).page
    page.route("**/api/v1/events", lambda route: route.abort())  # nothing tells the page of what others store
    page.reload()
    expect(page.locator("#environments img")).to_have_count(6)
    fake.http.post("environments", data={"name": "Studio"}, files={"file": ("Studio.hdr", hdr())}).raise_for_status()
    page.locator("#environment-file").set_input_files({**PANORAMA, "name": "Studio.hdr"})
    wait_until(lambda: "Studio 2" in [item["name"] for item in fake.get("environments")])


@pytest.mark.parametrize(
    ("path", "field"), [("film", "#film-file"), ("", "#environment-file"), ("", "#door-file-input")]
)
def test_a_file_of_the_wrong_kind_is_told_before_it_is_sent(
    fake: FakeServer, open_page: OpenPage, path: str, field: str
) -> None:
    fake.patch("scene", subject=None)
    page = open_page(fake.url + path) if path else open_panel(open_page, fake.url).page
    sent: list[str] = []
    page.on("request", lambda request: sent.append(request.url) if request.method == "POST" else None)
    page.locator(field).set_input_files({"name": "notes.txt", "mimeType": "text/plain", "buffer": b"words"})
    if path:
        page.locator("#have-film").click()
        page.locator("#film-upload").click()
    expect(page.locator(".problem:visible, .toast")).to_contain_text("another kind")
    assert sent == []


def test_a_film_that_is_too_large_is_told_before_it_is_sent(
    fake: FakeServer, open_page: OpenPage, tmp_path: Path
) -> None:
    film = tmp_path / "film.mp4"
    with film.open("wb") as file:
        file.truncate(STREAMED_FORMS["/api/v1/captures/film"] + 1)  # a hole: it takes no room
    page = open_page(f"{fake.url}film")
    sent: list[str] = []
    page.on("request", lambda request: sent.append(request.url) if request.method == "POST" else None)
    page.locator("#have-film").click()
    page.locator("#film-file").set_input_files(film)
    expect(page.locator("#upload-problem")).to_contain_text("4.0 GiB")
    page.locator("#film-upload").click()
    expect(page.locator("#upload-problem")).to_be_visible()
    assert sent == []


def test_the_panel_knows_the_camera_s_limits(fake: FakeServer, open_page: OpenPage) -> None:
    page = open_panel(open_page, fake.url).page
    limits = page.evaluate("() => import('/panel/library/limits.js').then(({ LIMITS }) => LIMITS)")
    for path, limit in limits.items():
        assert limit["bytes"] == STREAMED_FORMS.get(f"/api/v1/{path}", MAX_UPLOAD_BYTES), path
    assert limits["captures/film"]["endings"] == list(SUFFIXES)
    assert page.locator("#door-file-input").get_attribute("accept") == ",".join(limits["subjects"]["endings"])
    assert page.locator("#environment-file").get_attribute("accept") == ",".join(limits["environments"]["endings"])
    film = open_page(f"{fake.url}film").locator("#film-file")
    assert film.get_attribute("accept") == ",".join(SUFFIXES)
