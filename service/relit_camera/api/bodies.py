"""Small middleware about bodies: how long a request's may be, and that HEAD's answer has none."""

from __future__ import annotations

from http import HTTPStatus

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from relit_camera.api.problems import TooLargeError, problem_of

MAX_UPLOAD_BYTES = 64 << 20
MAX_FORM_BYTES = MAX_UPLOAD_BYTES + (1 << 16)
"""A file and the form around it."""
MAX_JSON_BYTES = 1 << 20
STREAMS = ("/api/v1/events", "/api/v1/preview.mjpg")
"""Answers that do not end, which HEAD would wait for."""


class BodyLimit:
    """ASGI middleware: 413 for a longer body, before it is read where its length is announced.

    Starlette's own limit answers in plain text where the operation reads no body; ours is always a problem.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        is_form = headers.get("content-type", "").startswith("multipart/form-data")
        limit = MAX_FORM_BYTES if is_form else MAX_JSON_BYTES
        announced = headers.get("content-length", "0")
        if announced.isdecimal() and int(announced) > limit:
            await problem_of(too_large(int(announced), limit))(scope, receive, send)
            return
        seen = 0

        async def receive_counted() -> Message:
            nonlocal seen
            message = await receive()
            seen += len(message.get("body", b""))
            if seen > limit:
                # FastAPI lets only this type through while it reads a body.
                raise HTTPException(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, too_large(seen, limit).what)
            return message

        await self.app(scope, receive_counted, send)


def too_large(size: int, limit: int) -> TooLargeError:
    """The error for a body of `size` bytes or more, where `limit` are taken."""
    return TooLargeError(
        f"the body has {size / 1e6:.1f} MB or more; {limit / 1e6:.0f} MB are taken", "send a smaller file"
    )


class HeadAsGet:
    """ASGI middleware: answers HEAD as GET without the body. FastAPI's routes know no HEAD of their own."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] != "http" or scope["method"] != "HEAD" or scope["path"] in STREAMS:
            await self.app(scope, receive, send)
            return

        async def send_without_body(message: Message) -> None:
            await send({**message, "body": b""} if message["type"] == "http.response.body" else message)

        await self.app({**scope, "method": "GET"}, receive, send_without_body)
