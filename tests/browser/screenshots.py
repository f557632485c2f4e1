"""Pictures of the panel with the bundled person: `python -m tests.browser.screenshots FOLDER` makes them all.

One of each width and theme as the page is opened, and one of each of the other pages and dialogs; and one sheet of the
panel at every width in every theme. Those that docs/panel.md shows are made with `--docs`, small enough for the
repository.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from playwright.sync_api import expect

from tests.browser.browser_pages import THEMES, WIDTHS, Pages, chromium
from tests.browser.cameras import START_S, Api, camera_process, fake_server
from tests.browser.panel import Panel, open_panel
from tests.small_camera import wait_until

MOST_BYTES = 150_000
MOST_SHEET_BYTES = 400_000
SHEET_SCALE = 0.4
SHEET_GREY = 128
GAP = 40
"""Between the pictures of the sheet, in pixels of the pages."""
HEIGHTS = {390: 844, 768: 1024, 1440: 900, 1920: 1080}
DOCS = ("1440 dark", "390 light", "768 forced colours", "doors 1440 light")
"""What the documentation shows."""
PLACES_ON_ME = 3
"""Pictures of places on one's own face that are waited for: those that every width shows."""
LAMPS = (
    {"azimuth_deg": 55, "elevation_deg": 20, "size_deg": 30, "color": [1, 0.35, 0.1], "intensity": 0.8},
    {"azimuth_deg": -70, "elevation_deg": 15, "size_deg": 30, "color": [0.1, 0.35, 1], "intensity": 0.8},
)


def write_sheet(pictures: dict[str, bytes], path: Path) -> None:
    """Write one picture of the panel at every width (columns) in every theme (rows), all to one scale.

    Args:
        pictures: PNG by "WIDTH THEME".
        path: to write, .jpg.
    """
    heights = max(HEIGHTS.values())
    left, rows = 0, len(THEMES)
    width = GAP * (len(WIDTHS) + 1) + sum(WIDTHS)
    sheet = np.full((GAP + rows * (heights + GAP), width, 3), SHEET_GREY, np.uint8)
    for column in WIDTHS:
        left += GAP
        for row, theme in enumerate(THEMES):
            picture = cv2.imdecode(np.frombuffer(pictures[f"{column} {theme}"], np.uint8), cv2.IMREAD_COLOR)
            assert picture is not None
            top = GAP + row * (heights + GAP)
            sheet[top : top + picture.shape[0], left : left + column] = picture
        left += column
    small = cv2.resize(sheet, None, fx=SHEET_SCALE, fy=SHEET_SCALE, interpolation=cv2.INTER_AREA)
    for quality in (80, 70, 60, 50):
        cv2.imwrite(str(path), small, [cv2.IMWRITE_JPEG_QUALITY, quality])
        if path.stat().st_size <= MOST_SHEET_BYTES:
            break


def save(panel: Panel, folder: Path, name: str) -> None:
    """Write a picture of the page as JPEG, with less quality until it is small enough."""
    path = folder / f"panel-{name.replace(' ', '-')}.jpg"
    for quality in (85, 75, 65, 50):
        panel.page.screenshot(path=path, type="jpeg", quality=quality)
        if path.stat().st_size <= MOST_BYTES:
            break


def photograph(camera: Api, pages: Pages, folder: Path, wanted: Callable[[str], bool]) -> None:
    """Pictures of the panel at every width, in every theme, and one sheet of them all."""
    taken: dict[str, bytes] = {}
    camera.patch("scene", lighting={"environment": "night-street", "lamps": LAMPS}, background={"kind": "environment"})
    for theme, options in THEMES.items():
        for width in WIDTHS:
            name = f"{width} {theme}"
            size = {"width": width, "height": HEIGHTS[width]}
            panel = open_panel(pages.open, camera.url, viewport=size, **options)
            panel.wait_for_picture()
            expect(panel.lamp(1)).to_be_attached()
            wait_until(lambda: panel.thumbnails_shown() and panel.places_shown_on_me() >= PLACES_ON_ME, START_S)  # noqa: B023
            taken[name] = panel.page.screenshot()
            if wanted(name):
                save(panel, folder, name)
            pages.close()
    write_sheet(taken, folder / "panel-widths.jpg")


def photograph_first_visit(url: str, pages: Pages, folder: Path, wanted: Callable[[str], bool]) -> None:
    """Pictures of the doors and of the pages of desk and film."""
    for theme, options in THEMES.items():
        for width in (390, 1440):
            size: dict[str, Any] = {"viewport": {"width": width, "height": HEIGHTS[width]}, **options}
            name = f"doors {width} {theme}"
            if wanted(name):
                panel = open_panel(pages.open, url, **size)
                expect(panel.doors).to_be_visible()
                save(panel, folder, name)
            for page in ("desk", "film"):
                name = f"{page} {width} {theme}"
                if wanted(name):
                    save(Panel(pages.open(url + page, **size)), folder, name)
            pages.close()


def main() -> None:
    """Make the pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--docs", action="store_true", help="only those that the documentation shows")
    arguments = parser.parse_args()
    folder: Path = arguments.folder
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as data, chromium() as browser:
        pages = Pages(browser)

        def wanted(name: str) -> bool:
            return not arguments.docs or name in DOCS

        with camera_process(Path(data), "demo", "--headless") as camera:
            camera.wait_for("status", state="live")
            photograph(camera, pages, folder, wanted)
        with fake_server(Path(data) / "nobody", subject=None) as server:
            server.show_checks()
            photograph_first_visit(server.url, pages, folder, wanted)


if __name__ == "__main__":
    main()
