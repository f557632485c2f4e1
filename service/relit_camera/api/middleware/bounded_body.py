"""A request's body of bounded length: refused before it is read where its length is announced, else as it arrives."""

from __future__ import annotations

from collections.abc import Callable

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from relit_camera.api.problem_details import problem_response_from, status_for_error
from relit_camera.base.errors import RelitError


async def answer_within(
    most_bytes: int, refusal: Callable[[int], RelitError], app: ASGIApp, scope: Scope, receive: Receive, send: Send
) -> None:
    """Let `app` answer an HTTP request, whose body it gets up to `most_bytes`.

    A longer body is answered with the error that `refusal` gives for the bytes announced or seen so far.
    """
    announced = Headers(scope=scope).get("content-length", "0")
    if announced.isdecimal() and int(announced) > most_bytes:
        await problem_response_from(refusal(int(announced)))(scope, receive, send)
        return
    seen = 0

    async def receive_counted() -> Message:
        nonlocal seen
        message = await receive()
        seen += len(message.get("body", b""))
        if seen > most_bytes:
            # The only type of exception that FastAPI passes on while it reads a body.
            error = refusal(seen)
            raise HTTPException(status_for_error(error), error.what) from error
        return message

    await app(scope, receive_counted, send)
