"""Bodies of requests and answers: the longest that are accepted, uploaded files, and HEAD's answer, which has none."""

from __future__ import annotations

from typing import BinaryIO

from fastapi import UploadFile
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from relit_camera.api.middleware.bounded_body import answer_within
from relit_camera.base.errors import InputError, TooLargeError

MAX_UPLOAD_BYTES = 64 << 20
MAX_FORM_FIELDS_BYTES = 1 << 16
MAX_UPLOAD_FORM_BYTES = MAX_UPLOAD_BYTES + MAX_FORM_FIELDS_BYTES
"""A file and the form around it."""
MAX_JSON_BYTES = 1 << 20
MAX_SUBJECT_BYTES = 1 << 30
"""As large as one that the camera shows."""
MAX_FILM_BYTES = 4 << 30
"""A film or a video that is sent to be relit."""
STREAMED_FORMS = {
    "/api/v1/subjects": MAX_SUBJECT_BYTES,
    "/api/v1/captures/film": MAX_FILM_BYTES,
    "/api/v1/captures/expressions/video": MAX_FILM_BYTES,
    "/api/v1/replays": MAX_FILM_BYTES,
}
"""Path → bytes of the file, where a form's file is written to disk as it arrives (`api.streamed_forms`)."""
STREAMING_PATHS = ("/api/v1/events", "/api/v1/preview.mjpg")
"""Paths whose answers do not end: a HEAD request would wait for ever."""


class BodyLimitMiddleware:
    """ASGI middleware that answers 413 to a body that is too long, before reading it if its length is announced.

    Starlette's own limit answers in plain text where the operation reads no body; this one always answers with
    application/problem+json.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        is_form = headers.get("content-type", "").lower().startswith("multipart/form-data")
        file_limit = STREAMED_FORMS.get(scope["path"], MAX_UPLOAD_BYTES)
        limit = file_limit + MAX_FORM_FIELDS_BYTES if is_form else MAX_JSON_BYTES
        await answer_within(limit, lambda size: body_too_large(size, limit), self.app, scope, receive, send)


def body_too_large(size: int, limit: int) -> TooLargeError:
    """The error for a body of at least `size` bytes, where up to `limit` are accepted."""
    return TooLargeError(
        f"the body has {size / 1e6:.1f} MB or more; {limit / 1e6:.0f} MB are taken", "send a smaller file"
    )


class HeadRequestMiddleware:
    """ASGI middleware that answers HEAD like GET, without the body: FastAPI's routes do not answer HEAD."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] != "http" or scope["method"] != "HEAD" or scope["path"] in STREAMING_PATHS:
            await self.app(scope, receive, send)
            return

        async def send_without_body(message: Message) -> None:
            await send({**message, "body": b""} if message["type"] == "http.response.body" else message)

        await self.app({**scope, "method": "GET"}, receive, send_without_body)


def uploaded_file(file: UploadFile) -> BinaryIO:
    """The uploaded file of a multipart form, which may lie in the folder of temporary files.

    Raises:
        TooLargeError: more than 64 MiB.
        InputError: it is empty.
    """
    size = file.size or 0
    if size > MAX_UPLOAD_BYTES:
        raise body_too_large(size, MAX_UPLOAD_BYTES)
    if not size:
        raise InputError(f"the file '{file.filename}' is empty", "choose a picture file")
    return file.file
