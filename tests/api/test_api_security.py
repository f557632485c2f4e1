"""Who may ask."""

from __future__ import annotations

import posixpath
import re

import pytest

from relit_camera.api.app import PANEL_FOLDER
from relit_camera.api.middleware.same_origin import AllowedHosts, ServerEndpoint
from tests.api.api_client import BASE_URL, Client, check_problem
from tests.api.fake_camera import FakeCamera

PAGES = [
    f"/panel/{path.relative_to(PANEL_FOLDER).as_posix()}" for path in sorted(PANEL_FOLDER.rglob("*")) if path.is_file()
]


@pytest.mark.parametrize("host", ["127.0.0.1:8470", "localhost:8470", "LOCALHOST:8470", "[::1]:8470"])
def test_names_of_this_machine_are_served(client: Client, host: str) -> None:
    assert client.get("/api/v1/mode", headers={"host": host}).status_code == 200


@pytest.mark.parametrize(
    "host",
    [
        "evil.example",
        "evil.example:8470",
        "127.0.0.1",
        "127.0.0.1:8471",
        "127.0.0.1.evil.example:8470",
        "evil@127.0.0.1:8470",
        "localhost:8470/x",
        "localhost:port",
        "192.168.1.5:8470",
        "[::1",
        "",
    ],
)
@pytest.mark.parametrize("path", ["/", "/api/v1/mode", "/api/v1/snapshot.jpg", "/healthz"])
def test_other_hosts_are_refused(client: Client, host: str, path: str) -> None:
    """DNS rebinding: a foreign name that resolves to this machine."""
    problem = check_problem(client.get(path, headers={"host": host}), 421)
    assert "127.0.0.1:8470" in problem["cure"]


def test_port_80_need_not_be_named() -> None:
    names = AllowedHosts()
    assert names.allows_host("localhost", ServerEndpoint("127.0.0.1", 80))
    assert not names.allows_host("localhost", ServerEndpoint("127.0.0.1", 8470))
    assert not names.allows_host("localhost:80", ServerEndpoint("", None))


@pytest.mark.parametrize("origin", [BASE_URL, "http://localhost:8470", "http://[::1]:8470"])
def test_our_panel_may_change_things(client: Client, origin: str) -> None:
    headers = {"origin": origin, "sec-fetch-site": "same-origin"}
    assert client.put("/api/v1/mode", {"mode": "portrait"}, headers=headers).status_code == 200


@pytest.mark.parametrize(
    "origin",
    [
        "null",
        "http://evil.example",
        "https://127.0.0.1:8470",
        "http://127.0.0.1:3000",
        "http://127.0.0.1",
        "127.0.0.1:8470",
    ],
)
@pytest.mark.parametrize(("method", "path"), [("PUT", "mode"), ("POST", "neutral-pose"), ("DELETE", "presets/x")])
def test_other_origins_may_not(client: Client, camera: FakeCamera, origin: str, method: str, path: str) -> None:
    before = camera.scene_controller.scene
    options = {"json": {"mode": "portrait"}} if method == "PUT" else {}
    check_problem(client.request(method, f"/api/v1/{path}", headers={"origin": origin}, **options), 403)
    assert camera.scene_controller.scene is before
    assert camera.neutral_resets == 0


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
@pytest.mark.parametrize(
    ("method", "path"), [("GET", "snapshot.jpg"), ("GET", "preview.mjpg"), ("POST", "neutral-pose")]
)
def test_other_pages_may_not_show_the_preview(client: Client, site: str, method: str, path: str) -> None:
    headers = {"sec-fetch-site": site, "sec-fetch-mode": "no-cors", "sec-fetch-dest": "image"}
    check_problem(client.request(method, f"/api/v1/{path}", headers=headers), 403)


def test_a_link_to_the_panel_may_be_followed(client: Client) -> None:
    headers = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate", "sec-fetch-dest": "document"}
    assert client.get("/", headers=headers).status_code == 200
    check_problem(client.get("/", headers={**headers, "sec-fetch-dest": "iframe"}), 403)
    check_problem(client.post("/api/v1/neutral-pose", headers=headers), 403)


@pytest.mark.parametrize("path", ["/", "/panel/panel.js", "/api/v1/mode", "/nothing", "/healthz"])
def test_every_answer_carries_the_headers(client: Client, path: str) -> None:
    headers = client.get(path).headers
    policy = headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["cross-origin-resource-policy"] == "same-origin"
    assert not any(name.startswith("access-control-") for name in headers)


def test_refusals_carry_the_headers_too(client: Client) -> None:
    assert client.get("/", headers={"host": "evil.example"}).headers["x-content-type-options"] == "nosniff"


def test_the_panel_is_served_with_its_parts(client: Client) -> None:
    page = client.get("/")
    assert page.headers["content-type"] == "text/html; charset=utf-8"
    named = re.findall(r'(?:src|href)="([^"]+)"', page.text)
    assert {"/panel/panel.css", "/panel/panel.js", "/panel/icon.svg"} <= set(named)
    types = {".js": "javascript", ".css": "text/css", ".svg": "image/svg+xml", ".html": "text/html"}
    for path in PAGES:
        answer = client.get(path)
        assert answer.status_code == 200
        assert types["." + path.rsplit(".", 1)[1]] in answer.headers["content-type"]


@pytest.mark.parametrize("path", PAGES)
def test_the_panel_asks_nobody_else_and_fits_its_policy(client: Client, path: str) -> None:
    text = client.get(path).text.replace("http://www.w3.org/2000/svg", "")
    assert not re.search(r"(?:https?:)?//[a-z0-9.-]+\.[a-z]{2,}", text)
    if path.endswith(".html"):
        assert not re.search(r"<script(?![^>]*\ssrc=)|<style|\sstyle=|\son[a-z]+=", text)
    for module in re.findall(
        r'^(?:import|export)[^;"]*(?:from|import) "(\.[^"]+)"|import\("(\.[^"]+)"\)', text, re.MULTILINE
    ):
        assert posixpath.normpath(posixpath.join(posixpath.dirname(path), "".join(module))) in PAGES
