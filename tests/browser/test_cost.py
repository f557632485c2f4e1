"""What the panel costs: requests and bytes before the first picture, and the browser's processor time."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import pytest
from playwright.sync_api import Browser

from tests.browser.browser_pages import OpenPage
from tests.browser.cameras import FakeServer, ProcessCamera
from tests.browser.panel import open_panel

MOST_REQUESTS = 25
MOST_BYTES = 250_000
WATCHED_S = 5.0

NoteRow = Callable[[str, tuple[str, ...]], None]


def test_the_first_picture_comes_after_few_requests(
    demo: ProcessCamera, open_page: OpenPage, browser: Browser, note_row: NoteRow
) -> None:
    """Counted from an empty cache until the page shows the preview's first picture, which is counted too.

    By the browser's own clock: what the page asks for once the picture is there is none of it.
    """
    page = open_page("about:blank")
    page.add_init_script(
        "document.addEventListener('load', (event) => {"
        " if (event.target.id === 'preview') window.firstPictureAt ??= performance.timeOrigin + performance.now();"
        "}, true)"
    )
    received: dict[str, float] = {}
    asked_at: dict[str, float] = {}
    urls: dict[str, str] = {}

    def note_request(event: dict[str, Any]) -> None:
        urls[event["requestId"]] = event["request"]["url"]
        asked_at[event["requestId"]] = event["wallTime"]

    def note_bytes(event: dict[str, Any]) -> None:
        received[event["requestId"]] = received.get(event["requestId"], 0) + event["encodedDataLength"]

    session = page.context.new_cdp_session(page)
    session.on("Network.requestWillBeSent", note_request)
    session.on("Network.responseReceived", lambda event: note_bytes({**event, **event["response"]}))
    session.on("Network.dataReceived", note_bytes)
    session.send("Network.enable")
    began = time.time()
    page.goto(demo.url, wait_until="commit")
    shown_at = page.evaluate(
        "() => new Promise((done, fail) => {"
        " setTimeout(() => fail(new Error('no picture came')), 20000);"
        " const look = () => window.firstPictureAt ? done(window.firstPictureAt / 1000) : setTimeout(look, 10);"
        " look(); })"
    )
    took_s = shown_at - began
    seen = {key: received.get(key, 0) for key, at in asked_at.items() if at <= shown_at}
    requests, total = len(seen), round(sum(seen.values()))
    note_row("what the panel costs", ("requests before the first picture", str(requests), str(MOST_REQUESTS)))
    note_row("what the panel costs", ("kB before the first picture", f"{total / 1000:.0f}", f"{MOST_BYTES / 1000:.0f}"))
    note_row("what the panel costs", ("seconds until the first picture", f"{took_s:.1f}", ""))
    assert requests <= MOST_REQUESTS, sorted(urls[key] for key in seen)
    assert total <= MOST_BYTES, {urls[key]: size for key, size in seen.items()}


def processor_s(browser: Browser) -> dict[str, float]:
    """The processor time of the browser's processes by kind, seconds."""
    session = browser.new_browser_cdp_session()
    found: dict[str, float] = {}
    for process in session.send("SystemInfo.getProcessInfo")["processInfo"]:
        found[process["type"]] = found.get(process["type"], 0) + process["cpuTime"]
    session.detach()
    return found


@pytest.mark.parametrize("state", ["open", "hidden"])
def test_the_browser_s_processor_time(
    fake: FakeServer, open_page: OpenPage, browser: Browser, note_row: NoteRow, state: str
) -> None:
    """Of all of the browser's processes while one panel shows its preview, or does not, without a graphics card."""
    panel = open_panel(open_page, fake.url)
    panel.wait_for_picture()
    if state == "hidden":
        panel.hide()
    began, before = time.monotonic(), processor_s(browser)
    panel.page.wait_for_timeout(1000 * WATCHED_S)
    lasted_s = time.monotonic() - began
    spent_s = {kind: each - before.get(kind, 0) for kind, each in processor_s(browser).items()}
    for kind in ("renderer", "GPU", "browser"):
        share = f"{100 * spent_s.get(kind, 0) / lasted_s:.0f} % of a core"
        note_row("what the panel costs", (f"page {state}: {kind}", share, ""))
    assert sum(spent_s.values()) < 1.5 * lasted_s
