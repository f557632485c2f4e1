"""Who may ask: no other web page, and only by a name that is ours.

A page anywhere on the web can make its visitor's browser send requests to 127.0.0.1, and to machines of the visitor's
network. Three checks keep it out:

- the Host header must be a name of ours with our port, so that a foreign name that resolves to our address
  (DNS rebinding) is refused;
- the Origin of a change must be our own panel (cross-site request forgery);
- Sec-Fetch-Site, where the browser sends it, must not be another site, except for following a link to the panel:
  so nobody else's page can show the preview.

Programs that are no browsers send neither Origin nor Sec-Fetch-Site and are not hindered. `access` asks for the token.
"""

from __future__ import annotations

from dataclasses import dataclass
from http import HTTPStatus
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from relit_camera.api.problems import ForbiddenError, problem, problem_of
from relit_camera.config.settings import ServerSettings

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
class Place:
    """Where a request arrived: the address and port of our end of its connection."""

    address: str
    port: int | None


@dataclass(frozen=True)
class OurNames:
    """The names by which clients may reach us.

    Attributes:
        hosts: names that come with our own port.
        proxied: `server.names` as they are written: what a browser names where something stands before us.
    """

    hosts: frozenset[str] = LOOPBACK_NAMES
    proxied: frozenset[str] = frozenset()

    @classmethod
    def of(cls, settings: ServerSettings) -> OurNames:
        """Loopback names, the address listened on, and the names given."""
        bare = {name for name in settings.names if _parts(name)[1] is None}
        return cls(LOOPBACK_NAMES | {settings.host.lower(), *bare}, frozenset(settings.names))

    def include(self, netloc: str, place: Place) -> bool:
        """Whether a Host header, `name:port`, is ours.

        The address that the connection came to is: a page of a foreign name cannot make a browser name it.
        """
        name, port = _parts(netloc)
        known = name in self.hosts or (name is not None and name == place.address)
        return (known and (port or HTTP_PORT) == place.port) or netloc.lower() in self.proxied

    def include_origin(self, origin: str, place: Place) -> bool:
        """Whether an Origin header, `scheme://name:port`, is our panel's; https only where it is proxied."""
        scheme, separator, netloc = origin.partition("://")
        if not separator:
            return False
        return netloc.lower() in self.proxied if scheme == "https" else scheme == "http" and self.include(netloc, place)


class OurPagesOnly:
    """ASGI middleware: refuses requests of other sites and adds the security headers to every answer."""

    def __init__(self, app: ASGIApp, names: OurNames | None = None) -> None:
        self.app = app
        self.names = names or OurNames()

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

        place = Place(*(scope.get("server") or ("", None)))
        refusal = refusal_of(scope["method"], Headers(scope=scope), place, self.names)
        await (refusal or self.app)(scope, receive, send_with_headers)


def refusal_of(method: str, headers: Headers, place: Place, names: OurNames) -> Response | None:
    """The answer to a request that must not be served, or None for one that may."""
    host = headers.get("host", "")
    if not names.include(host, place):
        cure = f"use http://127.0.0.1:{place.port}, or name it in server.names"
        return problem(HTTPStatus.MISDIRECTED_REQUEST, f"this server is not '{host}'", cure)
    origin = headers.get("origin")
    if origin is not None and method not in SAFE_METHODS and not names.include_origin(origin, place):
        return problem_of(
            ForbiddenError(f"a page of '{origin}' may not change this camera", "use the camera's own panel")
        )
    site = headers.get("sec-fetch-site", "none")
    if site not in ("same-origin", "none") and not _follows_link(method, headers):
        return problem_of(
            ForbiddenError("a page of another site may not use this camera", "use the camera's own panel")
        )
    return None


def _parts(netloc: str) -> tuple[str | None, int | None]:
    """Name, in lower case and without an IPv6 address's brackets, and port; no name where it is not `name:port`."""
    try:
        parts = urlsplit(f"//{netloc}")
        port = parts.port
    except ValueError:
        return None, None
    return (parts.hostname, port) if parts.netloc == netloc and parts.username is None else (None, None)


def _follows_link(method: str, headers: Headers) -> bool:
    return (
        method in SAFE_METHODS
        and headers.get("sec-fetch-mode") == "navigate"
        and (headers.get("sec-fetch-dest") == "document")
    )
