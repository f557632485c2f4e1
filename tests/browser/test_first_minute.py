"""What lost a user in the first minute: a test for each defect that the panel had."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from playwright.sync_api import Locator, expect

from relit_camera.app.demo import tour
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.devices.sources.playback_source import PlaybackSource
from relit_camera.devices.sources.source import SourceInfo
from relit_camera.live.status.camera_status import CameraState
from relit_camera.subject.subject_file import write_subject
from tests.app.subject_builders import captured
from tests.browser.browser_pages import OpenPage
from tests.browser.cameras import FakeServer, ProcessCamera, camera_on_clip
from tests.browser.panel import CLICK_MS, open_panel
from tests.lateness import spinning
from tests.small_camera import FPS, SIZE, grey, running_camera, wait_until

PLACES = ("party", "sunset", "window", "overcast", "night-street")
CLICKS = 20
HEARD_WITHIN_S = 2.0
DEVELOPERS = re.compile(r"/api/|\bGET\b|openapi|nothing at")


def pixels(element: Locator) -> DisplayImage:
    """What the page shows of an element: uint8 RGB (height, width, 3)."""
    picture = cv2.imdecode(np.frombuffer(element.screenshot(), np.uint8), cv2.IMREAD_COLOR_RGB)
    assert picture is not None
    return picture.astype(np.uint8)


def comes_about(condition: Callable[[], bool], timeout_s: float) -> bool:
    """Whether a condition comes about in time."""
    try:
        wait_until(condition, timeout_s)
    except AssertionError:
        return False
    return True


@contextmanager
def turning_light(fake: FakeServer, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The demonstration's tour where it turns the light, 20 changes a second, until somebody takes over."""
    at = tour.tour_at
    turning_s = next(time_s for time_s in range(60) if "led round" in at(time_s)[0].caption) + 1.5
    monkeypatch.setattr(tour, "tour_at", lambda time_s: at(turning_s + time_s % 5))
    scenes = fake.camera.scene_controller
    runner = tour.DemoRunner(scenes, lambda: True, lambda _: None)
    moving = scenes.scene.revision + 5
    runner.start()
    try:
        wait_until(lambda: scenes.scene.revision >= moving)
        yield
    finally:
        runner.stop()
        monkeypatch.undo()


def test_every_click_counts_while_the_tour_turns_the_light(
    fake: FakeServer, open_page: OpenPage, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number, name in enumerate(PLACES):
        fake.patch("lighting", environment=name, saturation=0.5 + number / 10)
        fake.http.put(f"presets/{name}").raise_for_status()
    panel = open_panel(open_page, fake.url)
    expect(panel.preset("party")).to_be_visible()
    targets = [find(name) for find in (panel.place, panel.preset) for name in PLACES]
    heard = 0
    for number in range(CLICKS):
        name = PLACES[number % len(PLACES)]
        with turning_light(fake, monkeypatch):
            panel.page.mouse.click(*panel.middle(targets[number % len(targets)]), delay=CLICK_MS)
            heard += comes_about(lambda: fake.get("lighting")["environment"] == name, HEARD_WITHIN_S)  # noqa: B023
    assert heard == CLICKS


def test_enter_saves_a_preset(fake: FakeServer, open_page: OpenPage) -> None:
    panel = open_panel(open_page, fake.url)
    panel.ask_to_save_preset("evening")
    panel.page.keyboard.press("Enter")
    expect(panel.preset("evening")).to_be_visible()
    expect(panel.page.locator("dialog[open]")).to_have_count(0)
    assert [item["name"] for item in fake.get("presets")] == ["evening"]


def test_nothing_is_called_private_while_the_raw_picture_is_published(fake: FakeServer, open_page: OpenPage) -> None:
    fake.patch("scene", mode="portrait")
    fake.show_raw_picture()
    panel = open_panel(open_page, fake.url)
    expect(panel.unlit).to_be_visible()
    expect(panel.page.get_by_text(re.compile("nothing of your room"))).to_have_count(0)


def test_a_subject_from_a_file_can_be_chosen_again_after_nobody(
    fake: FakeServer, open_page: OpenPage, tmp_path: Path
) -> None:
    write_subject(tmp_path / "bea.relit", captured("film"))
    fake.camera.scene_controller.load_configured_subject(str(tmp_path / "bea.relit"))
    panel = open_panel(open_page, fake.url)
    panel.choose_subject("")
    wait_until(lambda: fake.get("subject")["name"] is None)
    panel.page.reload()
    panel.choose_subject("bea")
    wait_until(lambda: fake.get("subject")["name"] == "bea")


def test_repeated_pictures_are_not_counted_as_frames(tmp_path: Path, open_page: OpenPage) -> None:
    slow = FPS / 5

    def play() -> Iterator[tuple[DisplayImage, float]]:
        for index in range(10_000):
            yield grey(100 + index % 20), index / slow

    source = PlaybackSource(SourceInfo("still", "memory", SIZE, slow), play())
    with running_camera(tmp_path, source=source, subject=captured("film")) as camera:
        url = str(camera.http.base_url).removesuffix("api/v1/")
        panel = open_panel(open_page, url)
        expect(panel.rate).to_have_text(re.compile(rf"^{slow:.0f} pictures"))
        assert camera.http.get("status").json()["fps"]["published"] > 2 * slow


def test_lamps_only_is_never_a_black_silhouette(fake: FakeServer, open_page: OpenPage) -> None:
    panel = open_panel(open_page, fake.url)
    panel.lamps_only.click()
    wait_until(lambda: fake.get("lighting")["environment"] is None)
    assert sum(lamp["intensity"] for lamp in fake.get("lighting")["lamps"]) > 0


def test_as_filmed_is_seen_in_the_preview_alone(demo: ProcessCamera, open_page: OpenPage) -> None:
    demo.patch("lighting", environment="party", split=0, transition_s=0)
    demo.wait_for("status", state="live")  # until then the person at rest is published, which is darker
    panel = open_panel(open_page, demo.url)
    panel.wait_for_picture()
    wait_until(lambda: panel.thumbnails_shown())
    with panel.before():
        demo.runs_on(5.0)
        meanwhile = demo.published().mean((0, 1))
    demo.runs_on(1.0)
    np.testing.assert_allclose(meanwhile, demo.published().mean((0, 1)), atol=10)


def test_thumbnails_are_there_at_once(tmp_path: Path, open_page: OpenPage) -> None:
    with camera_on_clip(tmp_path) as camera, spinning() as spun_s:
        panel = open_panel(open_page, camera.url)
        before_s = spun_s()
        wait_until(lambda: panel.thumbnails_shown())
        assert spun_s() - before_s < 2


def test_sliders_can_be_seen_in_forced_colours(fake: FakeServer, open_page: OpenPage) -> None:
    fake.show_checks()  # else the list of what is missing comes in above the slider while its picture is taken
    panel = open_panel(open_page, fake.url, forced_colors="active", color_scheme="dark")
    slider = panel.slider("Exposure")
    slider.scroll_into_view_if_needed()
    shown = pixels(slider).astype(int)
    ground = np.median(shown.reshape(-1, 3), axis=0)
    differs = np.abs(shown - ground).max(axis=2) > 100
    height, width = differs.shape
    assert differs[:, : width // 4].any(axis=0).mean() > 0.8, "the track cannot be seen"
    assert differs.any(axis=1).sum() > 0.4 * height, "the thumb cannot be seen"


def test_a_lamp_of_a_colour_is_shown_in_that_colour(fake: FakeServer, open_page: OpenPage) -> None:
    lamp = {"azimuth_deg": 40, "elevation_deg": 20, "size_deg": 20, "color": [1, 0.02, 0.02], "intensity": 1}
    fake.patch("lighting", lamps=[lamp])
    panel = open_panel(open_page, fake.url)
    dot = panel.lamp(0)
    expect(dot).to_be_visible()
    expect(panel.page.get_by_text("6500 K")).to_have_count(0)
    red, green, blue = panel.lamp_color(0)
    assert red > 150
    assert max(green, blue) < 90


def test_the_preview_grows_with_the_window(fake: FakeServer, open_page: OpenPage) -> None:
    panel = open_panel(open_page, fake.url, viewport={"width": 600, "height": 700})
    panel.wait_for_picture()
    assert panel.preview_width() < 900
    panel.page.set_viewport_size({"width": 1800, "height": 1300})
    wait_until(lambda: panel.preview_width() >= panel.preview.evaluate("image => image.clientWidth"), HEARD_WITHIN_S)


def test_messages_are_for_users_not_developers(fake: FakeServer, open_page: OpenPage) -> None:
    panel = open_panel(open_page, fake.url)
    panel.ask_to_save_preset("day/night")
    panel.confirm()
    refused = panel.page.locator("#ask-text:invalid")
    expect(refused).to_be_focused()
    assert "letters" in (refused.get_attribute("title") or "").lower()
    panel.page.keyboard.press("Escape")
    assert fake.get("presets") == []
    # And what the camera itself refuses, such as a preset that somebody else has just deleted.
    panel.page.evaluate("() => import('/panel/api.js').then(api => api.attempt('GET', 'presets/nowhere'))")
    expect(panel.message).to_be_visible()
    assert DEVELOPERS.search(panel.message.inner_text()) is None


def test_the_look_is_kept_over_a_restart(tmp_path: Path, open_page: OpenPage) -> None:
    with camera_on_clip(tmp_path) as camera:
        panel = open_panel(open_page, camera.url)
        panel.place("night-street").click()
        camera.wait_for("lighting", environment="night-street")
    with camera_on_clip(tmp_path) as camera:
        panel = open_panel(open_page, camera.url)
        expect(panel.place("night-street")).to_have_attribute("aria-pressed", "true")


def test_who_hides_is_hidden_after_a_restart_until_they_ask_to_be_relit(tmp_path: Path, open_page: OpenPage) -> None:
    with camera_on_clip(tmp_path) as camera:
        panel = open_panel(open_page, camera.url)
        expect(panel.doors).to_be_hidden()
        camera.wait_for("status", state="live", subject="anyone")
        panel.page.locator("#hide").click()
        expect(panel.doors).to_be_visible()
        expect(panel.page.locator("#hide")).to_be_hidden()
        camera.wait_for("status", state="no-subject", subject=None)
    with camera_on_clip(tmp_path) as camera:
        panel = open_panel(open_page, camera.url)
        expect(panel.doors).to_be_visible()
        camera.wait_for("status", state="no-subject", subject=None)
        panel.page.get_by_role("button", name="Relight my live picture").click()
        expect(panel.doors).to_be_hidden()
        camera.wait_for("status", state="live", subject="anyone")


def test_each_state_of_the_camera_is_told_in_words(fake: FakeServer, open_page: OpenPage) -> None:
    """The program's own name of a state, `No-subject.`, was shown."""
    panel = open_panel(open_page, fake.url)
    for state in CameraState:
        fake.camera.base = replace(fake.camera.base, state=state)
        expect(panel.page.locator("#state")).to_have_attribute("data-state", state.value)
        raw = re.compile(f"^{state.value}\\.$", re.IGNORECASE)  # a name without words is shown as a sentence
        expect(panel.page.locator("#state-text")).not_to_have_text(raw)
