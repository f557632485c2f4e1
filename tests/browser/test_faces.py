"""The section of faces: who is shown, unlit and back, another name, deleted; by the keyboard."""

from __future__ import annotations

import re
from dataclasses import replace

from playwright.sync_api import Route, expect

from relit_camera.subject.subject_file import write_subject
from tests.app.subject_builders import captured
from tests.browser.browser_pages import OpenPage
from tests.browser.cameras import SUBJECT, FakeServer
from tests.browser.panel import Panel, open_panel
from tests.small_camera import wait_until


def store(fake: FakeServer, name: str) -> None:
    write_subject(fake.camera.scene_controller.subjects.new_path(name), captured("film"))


def names(fake: FakeServer) -> list[str]:
    return sorted(item["name"] for item in fake.get("subjects"))


def show_unlit(fake: FakeServer, panel: Panel) -> None:
    """Confirm to be shown unlit, by the switch."""
    panel.page.locator("#unlit-allow").press("Enter")
    panel.page.locator("#unlit-yes").click()
    fake.wait_for("scene", unlit_allowed=True, subject=None)
    fake.camera.base = replace(fake.camera.base, unlit=True)
    expect(panel.unlit).to_be_visible()


def test_one_switch_shows_unlit_and_leads_back_to_the_same_face(fake: FakeServer, open_page: OpenPage) -> None:
    panel = open_panel(open_page, fake.url)
    switch = panel.page.locator("#unlit-allow")
    for _ in range(2):
        show_unlit(fake, panel)
        expect(switch).to_have_attribute("aria-pressed", "true")
        expect(panel.doors).to_be_hidden()
        panel.page.reload()
        expect(switch).to_have_attribute("aria-pressed", "true")
        switch.press("Enter")
        fake.camera.base = replace(fake.camera.base, unlit=False)
        fake.wait_for("scene", unlit_allowed=False, subject=SUBJECT)
        expect(switch).to_have_attribute("aria-pressed", "false")
        expect(switch).to_have_text("Show me unlit")
        expect(panel.face(SUBJECT)).to_have_attribute("aria-pressed", "true")
        expect(panel.doors).to_be_hidden()


def test_hiding_the_unlit_picture_at_once_leads_back_too_and_keeps_the_keyboard(
    fake: FakeServer, open_page: OpenPage
) -> None:
    panel = open_panel(open_page, fake.url)
    show_unlit(fake, panel)
    panel.page.locator("#unlit-stop").press("Enter")
    fake.wait_for("scene", unlit_allowed=False, subject=SUBJECT)
    fake.camera.base = replace(fake.camera.base, unlit=False)
    expect(panel.unlit).to_be_hidden()
    wait_until(lambda: panel.what_has_the_focus() != "")


def test_others_move_a_portrait_once_that_is_confirmed_and_until_it_is_stopped(
    fake: FakeServer, open_page: OpenPage
) -> None:
    panel = open_panel(open_page, fake.url)
    part, button = panel.page.locator("#avatar"), panel.page.locator("#avatar-allow")
    expect(part).to_be_hidden()
    fake.show_to_another()
    expect(button).to_be_visible()
    button.press("Enter")
    expect(panel.page.locator("#ask-words")).to_contain_text("consent")
    panel.page.locator("#ask-cancel").click()
    assert fake.get("scene")["avatar_allowed"] is False
    button.press("Enter")
    panel.page.locator("#ask-ok").click()
    fake.wait_for("scene", avatar_allowed=True)
    fake.camera.degraded = []
    for mode in ("portrait", "live"):
        fake.patch("scene", mode=mode)
        expect(part).to_contain_text(f"Anybody may move the portrait of “{SUBJECT}”")
    button.press("Enter")
    fake.wait_for("scene", avatar_allowed=False)
    expect(part).to_be_hidden()


def test_who_is_lit_as_a_mean_head_is_not_asked_about_a_portrait(fake: FakeServer, open_page: OpenPage) -> None:
    panel = open_panel(open_page, fake.url)
    fake.show_to_another()
    expect(panel.page.locator("#avatar")).to_be_visible()
    fake.patch("scene", mode="live")
    expect(panel.page.locator("#avatar")).to_be_hidden()


def test_a_permission_asked_for_one_face_is_not_given_to_another(fake: FakeServer, open_page: OpenPage) -> None:
    store(fake, "other")
    panel = open_panel(open_page, fake.url)
    fake.show_to_another()
    panel.page.locator("#avatar-allow").click()
    fake.patch("scene", subject="other")
    expect(panel.face("other")).to_have_attribute("aria-pressed", "true")
    panel.page.locator("#ask-ok").click()
    expect(panel.page.locator("#ask")).to_be_hidden()
    fake.patch("scene", mode="live")
    expect(panel.page.locator("#avatar")).to_be_hidden()
    assert fake.get("scene")["avatar_allowed"] is False


def test_a_face_that_is_gone_does_not_keep_the_unlit_picture(fake: FakeServer, open_page: OpenPage) -> None:
    panel = open_panel(open_page, fake.url)
    show_unlit(fake, panel)
    fake.http.delete(f"subjects/{SUBJECT}").raise_for_status()
    panel.page.locator("#unlit-stop").click()
    fake.wait_for("scene", unlit_allowed=False, subject=None)
    expect(panel.doors).to_be_visible()


def test_the_unlit_picture_is_stopped_though_another_change_hangs_and_the_first_request_fails(
    fake: FakeServer, open_page: OpenPage
) -> None:
    panel = open_panel(open_page, fake.url)
    show_unlit(fake, panel)
    held: list[Route] = []
    failed: list[Route] = []

    def answer(route: Route) -> None:
        if "frozen" in (route.request.post_data or ""):
            held.append(route)
        elif not failed:
            failed.append(route)
            route.abort()
        else:
            route.continue_()

    panel.page.route("**/api/v1/scene", answer)
    panel.page.locator("#freeze").click()
    panel.page.locator("#unlit-stop").click()
    panel.page.wait_for_timeout(1500)  # the requests pass through this thread
    assert fake.get("scene")["unlit_allowed"] is False
    assert (len(held), len(failed)) == (1, 1)
    assert fake.get("scene")["frozen"] is False
    held[0].continue_()
    panel.page.wait_for_timeout(1500)
    now = fake.get("scene")
    assert (now["frozen"], now["unlit_allowed"], now["subject"]) == (True, False, SUBJECT)


def test_who_chose_nobody_is_nobody_after_being_unlit(fake: FakeServer, open_page: OpenPage) -> None:
    panel = open_panel(open_page, fake.url)
    show_unlit(fake, panel)
    panel.face("Nobody").click()
    fake.wait_for("scene", unlit_allowed=False, subject=None)
    fake.camera.base = replace(fake.camera.base, unlit=False)
    panel.page.locator("#door-unlit").click()
    panel.page.locator("#unlit-yes").click()
    fake.wait_for("scene", unlit_allowed=True)
    panel.page.locator("#unlit-allow").click()
    fake.wait_for("scene", unlit_allowed=False, subject=None)
    expect(panel.doors).to_be_visible()


def test_whoever_comes_is_chosen_hidden_and_asked_for_a_picture_before_they_are_moved(
    fake: FakeServer, open_page: OpenPage
) -> None:
    panel = open_panel(open_page, fake.url)
    told, ladder = panel.page.locator("#doors-now"), panel.page.locator("#ladder")
    fake.patch("scene", mode="portrait")
    panel.face("Anyone").click()
    fake.wait_for("scene", subject="anyone", mode="live")
    expect(panel.face("Anyone")).to_have_attribute("aria-pressed", "true")
    expect(panel.doors).to_be_hidden()
    expect(ladder).to_contain_text("You are lit as an average head would be.")
    expect(ladder.get_by_role("link", name=re.compile("film yourself"))).to_have_attribute("href", "/film")
    assert panel.places_shown_on_me() == 0
    ladder.get_by_role("button", name="Another face…").click()
    expect(told).to_have_text("Others see you, lit as an average head would be.")
    panel.page.keyboard.press("Escape")
    expect(panel.doors).to_be_hidden()
    panel.page.locator("#mode").get_by_role("button", name=re.compile("Portrait")).click()
    expect(panel.doors).to_be_visible()
    expect(told).to_contain_text("Portrait moves a picture of you, and there is none yet.")
    expect(ladder).not_to_contain_text("You are lit")
    panel.page.locator("#door-anyone").click()
    fake.wait_for("scene", subject="anyone", mode="live")
    expect(panel.doors).to_be_hidden()
    panel.face("Nobody").click()
    fake.wait_for("scene", subject=None)
    expect(panel.doors).to_be_visible()


def test_a_face_gets_another_name_by_the_keyboard(fake: FakeServer, open_page: OpenPage) -> None:
    store(fake, "bea")
    panel = open_panel(open_page, fake.url)
    panel.choose_option(SUBJECT, "Rename")
    expect(panel.page.locator("#ask-text")).to_be_focused()
    panel.page.locator("#ask-text").fill("cleo")
    panel.page.keyboard.press("Enter")
    expect(panel.face("cleo")).to_have_attribute("aria-pressed", "true")
    expect(panel.face("cleo")).to_be_focused()
    assert names(fake) == ["bea", "cleo"]
    assert fake.get("scene")["subject"] == "cleo"


def test_a_name_that_another_face_has_is_refused(fake: FakeServer, open_page: OpenPage) -> None:
    store(fake, "bea")
    panel = open_panel(open_page, fake.url)
    panel.choose_option("bea", "Rename")
    panel.page.locator("#ask-text").fill(SUBJECT)
    panel.page.keyboard.press("Enter")
    expect(panel.message).to_be_visible()
    assert names(fake) == [SUBJECT, "bea"]


def test_a_face_is_deleted_only_when_that_was_confirmed(fake: FakeServer, open_page: OpenPage) -> None:
    store(fake, "bea")
    panel = open_panel(open_page, fake.url)
    panel.choose_option("bea", "Delete")
    panel.page.keyboard.press("Escape")
    expect(panel.page.get_by_role("button", name="Options of bea")).to_be_focused()
    assert names(fake) == [SUBJECT, "bea"]
    panel.choose_option("bea", "Delete")
    expect(panel.page.locator("#ask-ok")).to_be_visible()  # `press` does not wait for that
    panel.page.locator("#ask-ok").press("Enter")
    expect(panel.face("bea")).to_be_hidden()
    wait_until(lambda: panel.what_has_the_focus() != "")
    assert names(fake) == [SUBJECT]
    assert fake.get("scene")["subject"] == SUBJECT


def test_the_face_that_is_shown_is_deleted_too(fake: FakeServer, open_page: OpenPage) -> None:
    panel = open_panel(open_page, fake.url)
    panel.choose_option(SUBJECT, "Delete")
    expect(panel.page.locator("#ask-words")).to_contain_text("Others see a placeholder")
    panel.confirm()
    wait_until(lambda: names(fake) == [])
    assert fake.get("scene")["subject"] is None
    expect(panel.doors).to_be_visible()
