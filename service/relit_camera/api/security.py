"""Who may ask: this machine only, and no other web page.

A page anywhere on the web can make its visitor's browser send requests to 127.0.0.1. Three checks keep it out:

- the Host header must name this machine and our port, so that a foreign name that resolves to 127.0.0.1
  (DNS rebinding) is refused;
- the Origin of a change must be our own panel (cross-site request forgery);
- Sec-Fetch-Site, where the browser sends it, must not be another site, except for following a link to the panel:
  so nobody else's page can show the preview.

Programs that are no browsers send neither Origin nor Sec-Fetch-Site and are not hindered.
"""

from __future__ import annotations

from http import HTTPStatus
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from relit_camera.api.problems import ForbiddenError, problem, problem_of

LOOPBACK_NAMES = frozenset({"127.0.0.1", "localhost", "::1"})
SAFE_METHODS = frozenset({"GET", "HEAD"})
HTTP_PORT = 80
CONTENT_SECURITY_POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self' blob:",
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
)
SECURITY_HEADERS = {
    "Content-Security-Policy": CONTENT_SECURITY_POLICY,
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


class LocalOnly:
    """ASGI middleware: refuses requests from elsewhere and adds the security headers to every answer."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in SECURITY_HEADERS.items():
                    headers.setdefault(name, value)
                headers.setdefault("Cache-Control", "no-store")
            await send(message)

        refusal = refusal_of(scope["method"], Headers(scope=scope), (scope.get("server") or ("", None))[1])
        await (refusal or self.app)(scope, receive, send_with_headers)


def refusal_of(method: str, headers: Headers, port: int | None) -> Response | None:
    """The answer to a request that must not be served, or None for one that may."""
    host = headers.get("host", "")
    if not is_ours(host, port):
        cure = f"use http://127.0.0.1:{port}"
        return problem(HTTPStatus.MISDIRECTED_REQUEST, f"this server is not '{host}'", cure)
    origin = headers.get("origin")
    if origin is not None and method not in SAFE_METHODS and not _is_our_origin(origin, port):
        return problem_of(
            ForbiddenError(f"a page of '{origin}' may not change this camera", "use the camera's own panel")
        )
    site = headers.get("sec-fetch-site", "none")
    if site not in ("same-origin", "none") and not _follows_link(method, headers):
        return problem_of(
            ForbiddenError("a page of another site may not use this camera", "use the camera's own panel")
        )
    return None


def is_ours(netloc: str, port: int | None) -> bool:
    """Whether a Host header, `name:port`, names this machine and our port."""
    try:
        parts = urlsplit(f"//{netloc}")
        named = parts.port or HTTP_PORT
    except ValueError:
        return False
    return parts.netloc == netloc and parts.username is None and parts.hostname in LOOPBACK_NAMES and named == port


def _is_our_origin(origin: str, port: int | None) -> bool:
    scheme, separator, netloc = origin.partition("://")
    return scheme == "http" and bool(separator) and is_ours(netloc, port)


def _follows_link(method: str, headers: Headers) -> bool:
    return (
        method in SAFE_METHODS
        and headers.get("sec-fetch-mode") == "navigate"
        and (headers.get("sec-fetch-dest") == "document")
    )
