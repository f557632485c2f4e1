"""Refuses requests made by other web sites, and requests that name another host.

Any page on the web can make its visitor's browser send requests to 127.0.0.1 and to machines of the visitor's network.
Three checks prevent it:

- Host must be one of this server's names with its port: refuses a foreign name that resolves to this server's address
  (DNS rebinding);
- Origin of a changing request must be the panel's own (cross-site request forgery);
- Sec-Fetch-Site, where the browser sends it, must not be another site, except when a link to the panel is followed: so
  no other site's page can embed the preview.

Programs that are no browsers send neither Origin nor Sec-Fetch-Site and pass. The token is checked in
`token_authentication`.
"""

from __future__ import annotations

from dataclasses import dataclass
from http import HTTPStatus
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from relit_camera.api.problem_details import problem_response, problem_response_from
from relit_camera.base.config.settings import ServerSettings
from relit_camera.base.errors import ForbiddenError

LOOPBACK_HOSTS = frozenset({"127.0.0.1", "localhost", "::1"})
SAFE_METHODS = frozenset({"GET", "HEAD"})
DEFAULT_HTTP_PORT = 80
CONTENT_SECURITY_POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self' blob:",
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'self'",
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


@dataclass(frozen=True)
class ServerEndpoint:
    """The address and port at which a request arrived: the server's end of the connection."""

    address: str
    port: int | None


@dataclass(frozen=True)
class AllowedHosts:
    """The host names by which clients may reach the server.

    Attributes:
        hosts: names that are used with the server's own port.
        proxied: the entries of `server.names` as they are written: what browsers send through a reverse proxy.
    """

    hosts: frozenset[str] = LOOPBACK_HOSTS
    proxied: frozenset[str] = frozenset()

    @classmethod
    def of(cls, settings: ServerSettings) -> AllowedHosts:
        """The loopback names, the address that is listened on, and `server.names`."""
        bare = {name for name in settings.names if _split_netloc(name)[1] is None}
        return cls(LOOPBACK_HOSTS | {settings.host.lower(), *bare}, frozenset(settings.names))

    def allows_host(self, netloc: str, place: ServerEndpoint) -> bool:
        """Whether a Host header, `name:port`, names this server.

        The address at which the connection arrived is allowed too: a page under a foreign name cannot make a browser
        send it.
        """
        name, port = _split_netloc(netloc)
        known = name in self.hosts or (name is not None and name == place.address)
        return (known and (port or DEFAULT_HTTP_PORT) == place.port) or netloc.lower() in self.proxied

    def allows_origin(self, origin: str, place: ServerEndpoint) -> bool:
        """Whether an Origin header, `scheme://name:port`, is the panel's; https only behind a proxy."""
        scheme, separator, netloc = origin.partition("://")
        if not separator:
            return False
        return (
            netloc.lower() in self.proxied
            if scheme == "https"
            else scheme == "http" and self.allows_host(netloc, place)
        )


class SameOriginMiddleware:
    """ASGI middleware that refuses requests of other sites and adds the security headers to every answer."""

    def __init__(self, app: ASGIApp, names: AllowedHosts | None = None) -> None:
        self.app = app
        self.names = names or AllowedHosts()

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

        place = ServerEndpoint(*(scope.get("server") or ("", None)))
        refusal = rejection_for(scope["method"], Headers(scope=scope), place, self.names)
        await (refusal or self.app)(scope, receive, send_with_headers)


def rejection_for(method: str, headers: Headers, place: ServerEndpoint, names: AllowedHosts) -> Response | None:
    """The answer to a request that must not be served, or None for one that may."""
    if "content-length" in headers and "transfer-encoding" in headers:
        # RFC 9112, 6.3: who stands between may have taken another of the two for the body's end (request smuggling).
        what, cure = "the body's length is stated in two ways", "send Content-Length or Transfer-Encoding, not both"
        return problem_response(HTTPStatus.BAD_REQUEST, what, cure, headers={"Connection": "close"})
    host = headers.get("host", "")
    if not names.allows_host(host, place):
        cure = f"use http://127.0.0.1:{place.port}, or name it in server.names"
        return problem_response(HTTPStatus.MISDIRECTED_REQUEST, f"this server is not '{host}'", cure)
    origin = headers.get("origin")
    if origin is not None and method not in SAFE_METHODS and not names.allows_origin(origin, place):
        return problem_response_from(
            ForbiddenError(f"a page of '{origin}' may not change this camera", "use the camera's own panel")
        )
    site = headers.get("sec-fetch-site", "none")
    if site not in ("same-origin", "none") and not _is_navigation(method, headers):
        return problem_response_from(
            ForbiddenError("a page of another site may not use this camera", "use the camera's own panel")
        )
    return None


def _split_netloc(netloc: str) -> tuple[str | None, int | None]:
    """Name, in lower case and without an IPv6 address's brackets, and port; no name where it is not `name:port`."""
    try:
        parts = urlsplit(f"//{netloc}")
        port = parts.port
    except ValueError:
        return None, None
    return (parts.hostname, port) if parts.netloc == netloc and parts.username is None else (None, None)


def _is_navigation(method: str, headers: Headers) -> bool:
    return (
        method in SAFE_METHODS
        and headers.get("sec-fetch-mode") == "navigate"
        and (headers.get("sec-fetch-dest") == "document")
    )
