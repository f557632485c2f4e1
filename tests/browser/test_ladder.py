"""What the panel says, as the light changes, of how far the shown face is to be trusted in it."""

from __future__ import annotations

import numpy as np
import pytest
from playwright.sync_api import expect

from relit_camera.light.directions import fibonacci_directions
from relit_camera.subject.rungs import Rung
from relit_camera.subject.subject_file import write_subject
from tests.app.subject_builders import captured
from tests.browser.browser_pages import OpenPage
from tests.browser.cameras import SUBJECT, FakeServer
from tests.browser.panel import open_panel

SPHERE = fibonacci_directions(240).astype(np.float32)
LIGHTS = {
    "instant": SPHERE[:1],
    "desk": SPHERE[SPHERE[:, 2] > np.cos(np.radians(27))],
    "film": SPHERE[SPHERE[:, 2] > np.cos(np.radians(75))],
    "pictures": SPHERE,
}
LAMP = {"elevation_deg": 10, "size_deg": 5, "azimuth_deg": 20}
BEHIND = LAMP | {"azimuth_deg": 160}


def show(fake: FakeServer, rung: Rung) -> None:
    write_subject(fake.camera.scene_controller.subjects.new_path(rung), captured(rung, LIGHTS[rung]))
    fake.patch("scene", subject=rung)


@pytest.mark.parametrize("rung", ["instant", "desk", "film"])
def test_light_from_behind_is_said_to_be_a_guess_while_it_comes_from_there(
    fake: FakeServer, open_page: OpenPage, rung: Rung
) -> None:
    show(fake, rung)
    fake.patch("lighting", environment=None, lamps=[LAMP])
    told = open_panel(open_page, fake.url).page.locator("#ladder-light")
    expect(told).to_be_hidden()
    fake.patch("lighting", lamps=[BEHIND])
    expect(told).to_contain_text("comes from behind: for this face that is a guess")
    softened = told.get_by_text("shown softer than it is")
    expect(softened).to_have_count(1 if rung == "instant" else 0)
    fake.patch("lighting", lamps=[LAMP, BEHIND | {"intensity": 0.5}])
    expect(told).to_be_hidden()


def test_an_environment_that_is_turned_counts(fake: FakeServer, open_page: OpenPage) -> None:
    show(fake, "desk")
    fake.patch("lighting", environment="sunset", yaw_deg=0)
    told = open_panel(open_page, fake.url).page.locator("#ladder-light")
    expect(told).to_be_hidden()
    fake.patch("lighting", yaw_deg=180)
    expect(told).to_be_visible()


def test_nothing_is_said_of_a_face_that_was_measured_from_behind_nor_of_nobody(
    fake: FakeServer, open_page: OpenPage
) -> None:
    show(fake, "desk")
    fake.patch("lighting", environment=None, lamps=[BEHIND])
    told = open_panel(open_page, fake.url).page.locator("#ladder-light")
    expect(told).to_be_visible()
    show(fake, "pictures")
    expect(told).to_be_hidden()
    fake.patch("scene", subject=SUBJECT)
    expect(told).to_be_visible()
    fake.patch("scene", subject=None)
    expect(told).to_be_hidden()
