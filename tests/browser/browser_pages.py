"""Pages of one Chromium: opened for a test, and kept as picture and trace where the test fails."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, ConsoleMessage, Page, expect, sync_playwright

FAILURES = Path(__file__).resolve().parents[2] / "test-failures" / "browser"
EXECUTABLE_VARIABLE = "CHROMIUM"
"""Names the browser's program where it is none of `PROGRAMS`."""
NEEDED_VARIABLE = "BROWSER_NEEDED"
"""Set, as in CI, where a missing browser fails the tests instead of skipping them."""
PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
TIMEOUT_MS = 15_000
"""How long a state of the page is waited for; a machine with much else to do needs seconds."""
UNUSED = (
    # For each context's window Chromium loads two pages of its own, unseen: half a second of a processor each time.
    *("WebUIOmniboxPopup", "WebUIOmniboxAimPopup"),
    # Of two lists Chromium takes the last: what Playwright 1.65 switches off for its own needs is named again.
    *("AvoidUnnecessaryBeforeUnloadCheckSync", "DestroyProfileOnBrowserClose", "HttpsUpgrades", "LensOverlay"),
    *("HttpsFirstBalancedModeAutoEnable", "MediaRouter", "PaintHolding", "ThirdPartyStoragePartitioning"),
    *("AvoidCorsURLLoaderRestartOnRedirect", "OptimizationHints", "NetworkTimeServiceQuerying", "AimEnabled"),
    "PreconnectToSearch",
)
"""Features of Chromium that are switched off."""
BLOCKED = re.compile(r"Content Security Policy|Refused to")

WIDTHS = (390, 768, 1440, 1920)
THEMES: dict[str, dict[str, Any]] = {
    "dark": {"color_scheme": "dark", "forced_colors": "none"},
    "light": {"color_scheme": "light", "forced_colors": "none"},
    "forced colours": {"color_scheme": "dark", "forced_colors": "active"},
}
"""Media features by the theme's name, as options of a browser's context and for `Page.emulate_media`."""

OpenPage = Callable[..., Page]
"""Opens a page: address, then options of Playwright's `new_context`."""


def chromium_program() -> str:
    """The browser's program. Without one the test is skipped, or fails where `NEEDED_VARIABLE` is set."""
    named = os.environ.get(EXECUTABLE_VARIABLE)
    found = named or next((path for name in PROGRAMS if (path := shutil.which(name))), None)
    if found is None:
        why = f"no Chromium: sh tests/browser/install.sh, or name one with {EXECUTABLE_VARIABLE}"
        if os.environ.get(NEEDED_VARIABLE):
            pytest.fail(why)
        pytest.skip(why)
    return found


@contextmanager
def chromium() -> Iterator[Browser]:
    """A headless Chromium, ended with the block."""
    program = chromium_program()
    root = hasattr(os, "geteuid") and os.geteuid() == 0
    expect.set_options(timeout=TIMEOUT_MS)  # else five seconds, in which a busy machine at times loads no dialog
    with sync_playwright() as playwright:
        words = [f"--disable-features={','.join(UNUSED)}", *(["--no-sandbox"] if root else [])]
        browser = playwright.chromium.launch(executable_path=program, args=words, chromium_sandbox=not root)
        yield browser
        browser.close()


@dataclass
class Pages:
    """The pages of one test.

    Attributes:
        browser: in which they are opened, each in a context (cookies, cache, storage) of its own.
        errors: exceptions of the pages' scripts, and what the pages' policy has blocked.
    """

    browser: Browser
    errors: list[str] = field(default_factory=list)
    _contexts: list[BrowserContext] = field(default_factory=list)

    def open(self, url: str, **options: Any) -> Page:
        """Open a page in a new context; its stylesheets and scripts are loaded on return."""
        size = {"width": 1280, "height": 900}
        context = self.browser.new_context(**{"viewport": size, "reduced_motion": "reduce"} | options)
        context.set_default_timeout(TIMEOUT_MS)
        # Without pictures of the page: an endless preview would fill the trace.
        context.tracing.start(snapshots=True, screenshots=False)
        context.on("weberror", lambda error: self.errors.append(str(error.error)))
        context.on("console", self._note_console)
        self._contexts.append(context)
        page = context.new_page()
        page.goto(url, wait_until="domcontentloaded")
        return page

    def _note_console(self, message: ConsoleMessage) -> None:
        if message.type == "error" and BLOCKED.search(message.text):
            self.errors.append(message.text)

    def keep(self, name: str) -> None:
        """Keep a picture and a trace of every page (`playwright show-trace FILE`) in `FAILURES`/name."""
        folder = FAILURES / re.sub(r"[^A-Za-z0-9_.-]+", "-", name).strip("-")
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        for number, context in enumerate(self._contexts):
            for page in context.pages:
                page.screenshot(path=folder / f"page-{number}.png", timeout=TIMEOUT_MS)
            context.tracing.stop(path=folder / f"trace-{number}.zip")

    def close(self) -> None:
        """Close them all."""
        while self._contexts:
            self._contexts.pop().close()
