"""The webcam's own picture is published after a confirmed choice only, and the page says so for as long."""

from __future__ import annotations

import time
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from playwright.sync_api import expect

from relit_camera.app.demo import demo_files
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.live.scene.scene_history import SAME_STEP_S
from tests.browser.browser_pages import OpenPage
from tests.browser.cameras import START_S, Api, FakeServer, camera_on_clip
from tests.browser.panel import COLOR, Panel, open_panel
from tests.small_camera import wait_until

RAW_BELOW = 14.0
"""Mean difference from a frame of the clip, code values: JPEG and scaling make less, another light makes more."""
WATCHED_S = 2.0
SMALL = (160, 90)
WHOLE, FACE = np.s_[:, :], np.s_[25:65, 60:100]
"""Parts of a small picture."""


@cache
def filmed() -> tuple[DisplayImage, ...]:
    """What the webcam sees: every eighth frame of the clip, small."""
    with VideoReader(demo_files.CLIP) as clip:
        return tuple(
            cv2.resize(frame.image, SMALL, interpolation=cv2.INTER_AREA).astype(np.uint8)
            for index, frame in enumerate(clip)
            if index % 8 == 0
        )


def is_raw(camera: Api, part: tuple[slice, slice] = WHOLE) -> bool:
    """Whether the published picture, or a part of it, is one that the webcam took."""
    shown = cv2.resize(camera.published(), SMALL, interpolation=cv2.INTER_AREA).astype(np.float32)
    return min(float(np.abs(shown - frame)[part].mean()) for frame in filmed()) < RAW_BELOW


def never_raw(camera: Api) -> bool:
    """Whether nothing raw is published for some seconds."""
    camera.runs_on(WATCHED_S / 2)
    first = is_raw(camera)
    camera.runs_on(WATCHED_S / 2)
    return not (first or is_raw(camera) or camera.get("status")["unlit"])


def warning_color(panel: Panel) -> tuple[int, int, int]:
    found = COLOR.match(panel.unlit.evaluate("each => getComputedStyle(each).backgroundColor"))
    assert found is not None
    return int(found[1]), int(found[2]), int(found[3])


def test_nothing_raw_is_published_without_a_confirmed_choice(tmp_path: Path, open_page: OpenPage) -> None:
    """Hidden, the choice offered, refused, made, taken back, made again, and the camera started anew."""
    with camera_on_clip(tmp_path) as camera:
        panel = open_panel(open_page, camera.url)
        dialog = panel.page.locator("#unlit-dialog")
        panel.page.locator("#hide").click()
        expect(panel.doors).to_be_visible()
        assert never_raw(camera)
        panel.page.locator("#door-unlit").click()
        expect(dialog).to_be_visible()
        expect(panel.page.locator("#unlit-no")).to_be_focused()
        assert never_raw(camera)
        panel.page.keyboard.press("Enter")
        expect(dialog).to_be_hidden()
        assert never_raw(camera)

        panel.page.locator("#door-unlit").click()
        panel.page.locator("#unlit-yes").click()
        wait_until(lambda: is_raw(camera), START_S)
        expect(panel.unlit).to_be_visible()
        red, green, blue = warning_color(panel)
        assert red > 2 * max(green, blue)
        panel.page.locator("#unlit-stop").click()
        expect(panel.unlit).to_be_hidden()
        wait_until(lambda: not is_raw(camera), START_S)
        assert never_raw(camera)

        panel.page.locator("#door-unlit").click()
        panel.page.locator("#unlit-yes").click()
        wait_until(lambda: is_raw(camera), START_S)
    with camera_on_clip(tmp_path) as camera:
        panel = open_panel(open_page, camera.url)
        expect(panel.doors).to_be_visible()
        assert never_raw(camera)


def test_undo_and_reset_bring_no_raw_picture_back(fake: FakeServer, open_page: OpenPage) -> None:
    fake.show_raw_picture()
    panel = open_panel(open_page, fake.url)
    time.sleep(SAME_STEP_S)  # or both would be one step where the page opens fast
    panel.page.locator("#unlit-stop").click()
    wait_until(lambda: not fake.get("scene")["unlit_allowed"])
    for button in ("#undo", "#reset"):
        panel.page.locator(button).click()
        expect(panel.page.locator("#undo")).to_be_enabled()
        assert fake.get("scene")["unlit_allowed"] is False
