"""Checks the token, where one is set: programs send it with each request, people enter it once at `/login`.

After the login the browser keeps a cookie, which it also sends for the preview's `<img>` and for events, where a page
can set no header. The cookie holds a random secret of this run, never the token; scripts cannot read it, and it is not
sent from other sites' pages.
"""

from __future__ import annotations

import asyncio
import hmac
import secrets
from http import HTTPStatus
from pathlib import Path
from urllib.parse import parse_qs

from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

from relit_camera.api.problem_details import problem_response

LOGIN_PATH = "/login"
PUBLIC_PATHS = frozenset({"/healthz", LOGIN_PATH, "/panel/panel.css", "/panel/icon.svg"})
"""Paths served without the token: the liveness probe, and the login page with its style and icon."""
SESSION_COOKIE = "relit_session"
MAX_LOGIN_FORM_BYTES = 4096
ERROR_PLACEHOLDER = "<!-- wrong -->"
WRONG_TOKEN_DELAY_S = 0.5
"""Wrong tokens are answered one after another, each after this long: so many can be tried, whoever tries them."""
MAX_WAITING = 16
"""Wrong tokens that wait for their answer; further ones are answered by 429 at once."""

_LOGIN_PAGE = Path(__file__).parents[1] / "panel" / "login.html"


class TokenAuthMiddleware:
    """ASGI middleware that answers requests without the token by 401, or by a redirect to the login page."""

    def __init__(self, app: ASGIApp, token: bytes) -> None:
        self.app = app
        self.token = token
        self.session = secrets.token_urlsafe(32).encode()
        self._answering = asyncio.Lock()
        self._waiting = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] == "http":
            answer = await self._answer(Request(scope, receive))
            if answer is not None:
                await answer(scope, receive, send)
                return
        await self.app(scope, receive, send)

    async def _answer(self, request: Request) -> Response | None:
        """The middleware's answer, or None for a request that may pass."""
        path = request.scope["path"]  # not the URL's: that is made of the Host header too
        if path == LOGIN_PATH:
            return await self._login(request)
        if path in PUBLIC_PATHS or self._knows_token(request.headers) or self._has_session(request):
            return None
        if "authorization" in request.headers and not await self._has_waited():
            return _too_many_wrong_tokens()
        if path in ("/", "/desk", "/film"):
            return RedirectResponse(LOGIN_PATH, HTTPStatus.SEE_OTHER)
        return problem_response(
            HTTPStatus.UNAUTHORIZED,
            "the camera's token is needed",
            f"send the header 'Authorization: Bearer TOKEN', or open {LOGIN_PATH} in a browser",
            headers={"WWW-Authenticate": "Bearer"},
        )

    async def _login(self, request: Request) -> Response:
        if request.method in ("GET", "HEAD"):
            return _login_page()
        if request.method != "POST":
            allowed = "GET, POST"
            what = f"{request.method} is not allowed at '{LOGIN_PATH}'"
            return problem_response(
                HTTPStatus.METHOD_NOT_ALLOWED, what, f"allowed are {allowed}", headers={"Allow": allowed}
            )
        if not hmac.compare_digest(await _token_in_form(request), self.token):
            return _login_page(wrong=True) if await self._has_waited() else _too_many_wrong_tokens()
        answer = RedirectResponse("/", HTTPStatus.SEE_OTHER)
        by_tls = request.headers.get("origin", "").startswith("https://")  # through a proxy that ends TLS
        answer.set_cookie(SESSION_COOKIE, self.session.decode(), secure=by_tls, httponly=True, samesite="strict")
        return answer

    async def _has_waited(self) -> bool:
        """Wait as long as somebody must who gave a wrong token. False, without waiting, where too many wait already."""
        if self._waiting == MAX_WAITING:
            return False
        self._waiting += 1
        try:
            async with self._answering:
                await asyncio.sleep(WRONG_TOKEN_DELAY_S)
        finally:
            self._waiting -= 1
        return True

    def _knows_token(self, headers: Headers) -> bool:
        scheme, _, given = headers.get("authorization", "").partition(" ")
        return scheme.lower() == "bearer" and hmac.compare_digest(given.strip().encode(), self.token)

    def _has_session(self, request: Request) -> bool:
        return hmac.compare_digest(request.cookies.get(SESSION_COOKIE, "").encode(), self.session)


def _too_many_wrong_tokens() -> Response:
    seconds = int(MAX_WAITING * WRONG_TOKEN_DELAY_S)
    return problem_response(
        HTTPStatus.TOO_MANY_REQUESTS,
        "too many wrong tokens are being tried",
        f"try again in {seconds} seconds",
        headers={"Retry-After": str(seconds)},
    )


def _login_page(wrong: bool = False) -> Response:
    text = _LOGIN_PAGE.read_text(encoding="utf-8")
    said = '<p role="alert">This is not the camera’s token.</p>' if wrong else ""
    return HTMLResponse(text.replace(ERROR_PLACEHOLDER, said), HTTPStatus.UNAUTHORIZED if wrong else HTTPStatus.OK)


async def _token_in_form(request: Request) -> bytes:
    """The field `token` of a form's body; empty where there is none, or the body is longer than any token's form."""
    body = b""
    async for chunk in request.stream():
        body += chunk
        if len(body) > MAX_LOGIN_FORM_BYTES:
            return b""
    fields = parse_qs(body.decode("latin-1"))
    return fields.get("token", [""])[0].strip().encode()
