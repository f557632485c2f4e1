"""The token: with one set nothing but the login page is to be had without it, from whatever machine."""

from __future__ import annotations

import asyncio
import logging
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from fastapi import FastAPI
from pydantic import SecretStr

from relit_camera.api.app import PANEL_FOLDER, create_app
from relit_camera.api.middleware import token_authentication
from relit_camera.api.middleware.token_authentication import MAX_WAITING, SESSION_COOKIE
from relit_camera.api.server.http_server import ApiServer, start_api_server
from relit_camera.api.server.listener import open_listener
from relit_camera.base.config.settings import RelitSettings, ServerSettings
from relit_camera.base.errors import ConfigError
from tests.api.api_client import Client, check_problem
from tests.api.fake_camera import FakeCamera

TOKEN = "correct-horse-battery-staple"
BEARER = {"authorization": f"Bearer {TOKEN}"}
HOST = "192.168.7.5"
NAMES = ("camera.lan", "camera.example:8443", "proxied.example")
SERVER = ServerSettings(host=HOST, token=SecretStr(TOKEN), names=NAMES)


@pytest.fixture(autouse=True)
def short_delays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(token_authentication, "WRONG_TOKEN_DELAY_S", 0.01)


@pytest.fixture
def guarded(camera: FakeCamera, settings: RelitSettings) -> Client:
    """A client of a server that other machines can reach."""
    return Client(create_app(camera, settings.model_copy(update={"server": SERVER})))


def login(client: Client, token: str = TOKEN, **headers: str) -> httpx.Response:
    return client.post("/login", data={"token": token}, headers=headers)


def session(client: Client) -> dict[str, str]:
    """The cookie that a browser keeps."""
    found = login(client).headers["set-cookie"].partition(";")[0]
    return {"cookie": f"other=1; {found}"}


def paths() -> list[tuple[str, str]]:
    """Every operation, the panel's parts, and what is not there."""
    described = httpx.Response(200, text=(PANEL_FOLDER.parents[3] / "docs/openapi.json").read_text()).json()
    operations = [
        (method.upper(), path.replace("{name}", "studio"))
        for path, methods in described["paths"].items()
        for method in methods
        if path != "/healthz"
    ]
    files = [
        ("GET", f"/panel/{file.relative_to(PANEL_FOLDER).as_posix()}")
        for file in PANEL_FOLDER.rglob("*")
        if file.is_file() and file.name not in ("panel.css", "icon.svg")
    ]
    return [*operations, *files, ("GET", "/api/v1/openapi.json"), ("GET", "/nothing"), ("HEAD", "/api/v1/status")]


@pytest.mark.parametrize(("method", "path"), paths())
def test_nothing_is_to_be_had_without_it(guarded: Client, camera: FakeCamera, method: str, path: str) -> None:
    before = camera.scene_controller.scene
    answer = guarded.request(method, path)
    assert answer.status_code == 401
    assert answer.headers["www-authenticate"] == "Bearer"
    if method != "HEAD":
        assert "Bearer" in check_problem(answer, 401)["cure"]
    assert camera.scene_controller.scene is before
    assert camera.neutral_resets == 0


@pytest.mark.parametrize("path", ["/healthz", "/login", "/panel/panel.css", "/panel/icon.svg"])
def test_what_the_login_page_needs_is_open(guarded: Client, path: str) -> None:
    assert guarded.get(path).status_code == 200


@pytest.mark.parametrize(
    "path", ["/panel/../api/v1/mode", "//api/v1/mode", "/healthz/../api/v1/mode", "/LOGIN", "/login/"]
)
def test_no_spelling_of_a_path_leads_past_it(guarded: Client, path: str) -> None:
    assert guarded.get(path).status_code == 401


@pytest.mark.parametrize("path", ["/api/v1/mode", "/api/v1/status", "/metrics", "/readyz", "/", "/panel/panel.js"])
def test_a_program_sends_it(guarded: Client, path: str) -> None:
    assert guarded.get(path, headers=BEARER).status_code == 200
    assert guarded.get(path, headers={"authorization": f"bearer  {TOKEN}"}).status_code == 200


@pytest.mark.parametrize(
    "given",
    [
        "",
        "Bearer",
        "Bearer ",
        f"Bearer {TOKEN[:-1]}",
        f"Bearer {TOKEN}x",
        f"Basic {TOKEN}",
        TOKEN,
        f"Bearer {TOKEN.upper()}",
    ],
)
def test_another_is_refused(guarded: Client, given: str) -> None:
    check_problem(guarded.get("/api/v1/mode", headers={"authorization": given}), 401)


@pytest.mark.parametrize("given", [b"Bearer \xff\xfe\xc3\xa9", b"Bearer " + b"x" * 5000, b"\xe9 \xe9"])
def test_odd_bytes_are_refused_and_no_fault(guarded: Client, given: bytes) -> None:
    check_problem(guarded.get("/api/v1/mode", headers=[(b"authorization", given)]), 401)
    check_problem(guarded.get("/api/v1/mode", headers=[(b"cookie", b"relit_session=" + given)]), 401)


def test_it_is_not_taken_from_an_address(guarded: Client) -> None:
    """Addresses are logged, kept in histories and sent on."""
    check_problem(guarded.get(f"/api/v1/mode?token={TOKEN}"), 401)
    assert guarded.post(f"/login?token={TOKEN}").status_code == 401


@pytest.mark.parametrize("path", ["/desk", "/film"])
def test_the_captures_pages_lead_to_the_login_page(guarded: Client, path: str) -> None:
    answer = guarded.get(path)
    assert (answer.status_code, answer.headers["location"]) == (303, "/login")


def test_a_browser_is_led_to_the_login_page(guarded: Client) -> None:
    answer = guarded.get("/")
    assert (answer.status_code, answer.headers["location"]) == (303, "/login")
    page = guarded.get("/login")
    assert page.headers["content-type"] == "text/html; charset=utf-8"
    assert 'type="password"' in page.text
    assert "form-action 'self'" in page.headers["content-security-policy"]


def test_a_browser_shows_it_once(guarded: Client) -> None:
    answer = login(guarded)
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    cookie = answer.headers["set-cookie"]
    assert cookie.startswith(f"{SESSION_COOKIE}=")
    assert {"httponly", "samesite=strict", "path=/"} <= {part.strip().lower() for part in cookie.split(";")}
    assert "secure" not in cookie.lower()
    assert TOKEN not in cookie
    for path in ("/", "/api/v1/mode", "/panel/panel.js"):
        assert guarded.get(path, headers=session(guarded)).status_code == 200


def test_behind_tls_the_cookie_stays_behind_tls(guarded: Client) -> None:
    there = {"host": "proxied.example", "origin": "https://proxied.example"}
    assert "; secure" in login(guarded, **there).headers["set-cookie"].lower()


@pytest.mark.parametrize("token", ["", "wrong", TOKEN + "x", "é" * 20, "🙂" * 5, "x" * 100_000])
def test_a_wrong_one_opens_nothing(guarded: Client, token: str) -> None:
    answer = login(guarded, token)
    assert answer.status_code == 401
    assert "set-cookie" not in answer.headers
    assert "not the camera" in answer.text
    assert not token or token not in answer.text


def test_a_session_ends_with_its_camera(guarded: Client, camera: FakeCamera, settings: RelitSettings) -> None:
    kept = session(guarded)
    next_run = Client(create_app(camera, settings.model_copy(update={"server": SERVER})))
    check_problem(next_run.get("/api/v1/mode", headers=kept), 401)


def test_only_get_and_post_reach_the_login_page(guarded: Client) -> None:
    assert check_problem(guarded.delete("/login"), 405)
    assert guarded.request("HEAD", "/login").status_code == 200


async def statuses(app: FastAPI, tokens: list[str]) -> list[int]:
    """Answers to requests with these tokens, sent together."""
    async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url=f"http://{HOST}:8471") as client:
        asked = [client.get("/api/v1/mode", headers={"authorization": f"Bearer {token}"}) for token in tokens]
        return [answer.status_code for answer in await asyncio.gather(*asked)]


def test_wrong_ones_are_answered_slowly_and_few_may_wait(
    camera: FakeCamera, settings: RelitSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(token_authentication, "WRONG_TOKEN_DELAY_S", 0.05)
    server = SERVER.model_copy(update={"names": (*NAMES, f"{HOST}:8471")})
    app = create_app(camera, settings.model_copy(update={"server": server}))
    began = time.monotonic()
    answered = asyncio.run(statuses(app, ["wrong"] * (MAX_WAITING + 4)))
    assert time.monotonic() - began >= 0.05 * MAX_WAITING
    assert sorted(answered) == [401] * MAX_WAITING + [429] * 4


def test_the_right_one_waits_for_nobody(
    camera: FakeCamera, settings: RelitSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(token_authentication, "WRONG_TOKEN_DELAY_S", 3600.0)
    server = SERVER.model_copy(update={"names": (*NAMES, f"{HOST}:8471")})
    app = create_app(camera, settings.model_copy(update={"server": server}))

    async def both() -> list[int]:
        wrong = asyncio.create_task(statuses(app, ["wrong"] * (MAX_WAITING + 1)))
        await asyncio.sleep(0.1)
        right = await statuses(app, [TOKEN])
        assert not wrong.done()
        wrong.cancel()
        return right

    assert asyncio.run(both()) == [200]


def test_without_a_token_there_is_no_login_page(client: Client) -> None:
    check_problem(client.get("/login"), 404)


# Names: rebinding and cross-site requests, with the token known to the victim's browser


@pytest.mark.parametrize(
    "host",
    [f"{HOST}:8470", "camera.lan:8470", "CAMERA.lan:8470", "camera.lan", "camera.example:8443", "127.0.0.1:8470"],
)
def test_names_of_ours_are_served(guarded: Client, host: str) -> None:
    assert guarded.get("/api/v1/mode", headers={**BEARER, "host": host}).status_code == 200


@pytest.mark.parametrize(
    "host",
    [
        "evil.example",
        "evil.example:8470",
        "camera.lan.evil.example:8470",
        "camera.lan:8471",
        "camera.example:8470",
        "camera.example",
        "192.168.7.6:8470",
        HOST,
        f"{HOST}:80",
        f"evil@{HOST}:8470",
        "0.0.0.0:8470",
        "",
    ],
)
@pytest.mark.parametrize("path", ["/", "/login", "/healthz", "/api/v1/snapshot.jpg"])
def test_other_names_are_refused_whoever_asks(guarded: Client, host: str, path: str) -> None:
    """DNS rebinding: a foreign name that resolves to our address."""
    for knowing in ({}, BEARER, session(guarded)):
        check_problem(guarded.get(path, headers={**knowing, "host": host}), 421)


@pytest.mark.parametrize(
    "origin",
    [f"http://{HOST}:8470", "http://camera.lan:8470", "https://proxied.example", "https://camera.example:8443"],
)
def test_our_panel_may_change_things(guarded: Client, origin: str) -> None:
    headers = {**session(guarded), "origin": origin, "sec-fetch-site": "same-origin"}
    assert guarded.put("/api/v1/mode", {"mode": "portrait"}, headers=headers).status_code == 200


@pytest.mark.parametrize(
    "origin",
    [
        "null",
        "http://evil.example",
        f"https://{HOST}:8470",
        f"http://{HOST}:3000",
        f"http://{HOST}",
        "http://camera.lan:81",
    ],
)
def test_other_pages_may_not_change_things(guarded: Client, camera: FakeCamera, origin: str) -> None:
    before = camera.scene_controller.scene
    headers = {**session(guarded), "origin": origin}
    check_problem(guarded.put("/api/v1/mode", {"mode": "portrait"}, headers=headers), 403)
    check_problem(login(guarded, origin=origin), 403)
    assert camera.scene_controller.scene is before


@pytest.mark.parametrize("path", ["/api/v1/preview.mjpg", "/api/v1/snapshot.jpg", "/api/v1/events", "/api/v1/status"])
def test_other_pages_may_not_show_the_preview(guarded: Client, path: str) -> None:
    headers = {
        **session(guarded),
        "sec-fetch-site": "cross-site",
        "sec-fetch-mode": "no-cors",
        "sec-fetch-dest": "image",
    }
    check_problem(guarded.get(path, headers=headers), 403)


# A real server on all addresses of this machine


@pytest.fixture
def everywhere(camera: FakeCamera, settings: RelitSettings, tmp_path: Path) -> Iterator[ApiServer]:
    path = tmp_path / "token"
    path.write_text(TOKEN)
    path.chmod(0o600)
    open_to_all = ServerSettings(host="0.0.0.0", port=0, token_file=path)
    with start_api_server(
        create_app(camera, settings.model_copy(update={"server": open_to_all})), open_to_all
    ) as server:
        yield server


def test_the_address_that_a_client_came_to_is_a_name(everywhere: ApiServer) -> None:
    """127.0.0.2 stands for an address of the local network: it is nowhere in the settings."""
    base = f"http://127.0.0.2:{everywhere.address.port}"
    assert httpx.get(f"{base}/api/v1/mode", headers=BEARER).status_code == 200
    other = {**BEARER, "host": f"127.0.0.3:{everywhere.address.port}"}
    assert httpx.get(f"{base}/api/v1/mode", headers=other).status_code == 421


def test_a_browser_gets_preview_and_events_by_cookie(everywhere: ApiServer) -> None:
    with httpx.Client(base_url=f"http://127.0.0.1:{everywhere.address.port}", timeout=5) as browser:
        assert browser.get("/api/v1/preview.mjpg").status_code == 401
        assert browser.post("/login", data={"token": TOKEN}, follow_redirects=True).url.path == "/"
        for path, kind in (("preview.mjpg", "multipart/x-mixed-replace"), ("events", "text/event-stream")):
            with browser.stream("GET", f"/api/v1/{path}") as body:
                assert body.headers["content-type"].startswith(kind)
                assert next(body.iter_bytes())


def test_a_large_upload_is_refused_before_it_is_read(everywhere: ApiServer) -> None:
    with socket.create_connection(("127.0.0.1", everywhere.address.port), timeout=5) as client:
        head = f"POST /api/v1/environments HTTP/1.1\r\nHost: 127.0.0.1:{everywhere.address.port}\r\n"
        client.sendall(
            f"{head}Content-Type: multipart/form-data; boundary=x\r\nContent-Length: 60000000\r\n\r\n".encode()
        )
        assert client.recv(100).startswith(b"HTTP/1.1 401")


def test_it_is_in_no_log_and_no_answer(everywhere: ApiServer, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG), httpx.Client(base_url=f"http://127.0.0.1:{everywhere.address.port}") as client:
        said = [
            client.get(path, headers=BEARER).text for path in ("/api/v1/status", "/metrics", "/api/v1/openapi.json")
        ]
        said.append(client.post("/login", data={"token": TOKEN + "x"}).text)
        said.append(client.put("/api/v1/mode", json={"token": 1}, headers=BEARER).text)
    ours = [record.getMessage() for record in caplog.records if record.name.startswith(("relit", "uvicorn"))]
    assert TOKEN not in "".join([*said, *ours])


def test_a_server_that_others_can_reach_does_not_start_without_one() -> None:
    with pytest.raises(ConfigError, match="there is no token"):
        open_listener(ServerSettings(host="0.0.0.0", port=0))
