"""Turns every exception raised while a request is answered into an application/problem+json answer."""

from __future__ import annotations

import errno
import logging
import tempfile
from collections.abc import Sequence
from http import HTTPStatus
from pathlib import Path
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.routing import Match

from relit_camera.api.middleware.json_bodies import JSON_TYPE, json_body_type, meant_field
from relit_camera.api.middleware.same_origin import SECURITY_HEADERS
from relit_camera.api.problem_details import FieldProblem, problem_response, problem_response_from
from relit_camera.base.errors import RelitError
from relit_camera.base.storage.atomic_files import storage_error

log = logging.getLogger(__name__)

HTTP_METHODS = ("GET", "PUT", "PATCH", "POST", "DELETE")
REFUSED_BY_DISK = frozenset(
    {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES, errno.EPERM, errno.EIO}
)
OPENAPI_HINT = "GET /api/v1/openapi.json describes every operation"


def install_error_handlers(app: FastAPI) -> None:
    """Make `app` answer every error with application/problem+json."""
    app.exception_handler(RelitError)(_relit_error)
    app.exception_handler(RequestValidationError)(_validation_error)
    app.exception_handler(HTTPException)(_http_error)
    app.exception_handler(OSError)(_storage_error)
    app.exception_handler(Exception)(_unhandled_error)


async def _relit_error(request: Request, error: RelitError) -> Response:
    return problem_response_from(error)


async def _storage_error(request: Request, error: OSError) -> Response:
    """What the disk refused, and no store expected: a file that cannot be deleted, a full folder of temporary files."""
    if error.errno not in REFUSED_BY_DISK:
        raise error
    log.warning("%s %s: %s", request.method, request.url.path, error)
    return problem_response_from(storage_error(Path(str(error.filename or tempfile.gettempdir())), error))


async def _validation_error(request: Request, error: RequestValidationError) -> Response:
    details = error.errors()
    if any(detail["type"] == "json_invalid" for detail in details):
        return problem_response(HTTPStatus.BAD_REQUEST, "the body is not valid JSON", "send JSON")
    body_type = json_body_type(request.scope.get("route"))
    meant = [_meant(detail, body_type) for detail in details]
    fields = [_field_problem(detail, name) for detail, name in zip(details, meant, strict=True)]
    first = _field_problem(details[0], None)  # the cure has the offer
    more = f" (and {len(fields) - 1} more)" if len(fields) > 1 else ""
    what = f"{first.field}: {first.message}" if first.field else first.message
    cure = next((f"did you mean {name}?" for name in meant if name), "correct it and send it again")
    return problem_response(HTTPStatus.UNPROCESSABLE_ENTITY, what + more, cure, fields)


def _meant(detail: Any, body_type: Any) -> str | None:
    where, *path = detail["loc"]
    unknown = detail["type"] == "extra_forbidden" and where == "body" and bool(path)
    return meant_field(body_type, path) if unknown else None


def _field_problem(detail: Any, meant: str | None) -> FieldProblem:
    where, *path = detail["loc"]
    name = ".".join(map(str, path)) or (str(where) if where not in ("body", "query", "path") else "")
    if detail["type"] == "extra_forbidden":
        offer = f"; did you mean {meant}?" if meant else ""
        return FieldProblem(field=name, message=f"there is no such field{offer}")
    message = detail["msg"].removeprefix("Value error, ")
    value = detail.get("input")
    shown = f" (is {value!r:.60})" if isinstance(value, str | int | float | bool) else ""
    return FieldProblem(field=name, message=f"{message[:1].lower()}{message[1:]}{shown}")


async def _http_error(request: Request, error: HTTPException) -> Response:
    if isinstance(error.__cause__, OSError):  # while Starlette wrote a form's file to the folder of temporary files
        return await _storage_error(request, error.__cause__)
    if isinstance(error.__cause__, RelitError):  # of a middleware, while the body was read
        return problem_response_from(error.__cause__)
    path = request.url.path
    headers = dict(error.headers or {})
    if error.status_code == HTTPStatus.NOT_FOUND:
        return problem_response(HTTPStatus.NOT_FOUND, f"there is nothing at '{path}'", OPENAPI_HINT)
    if error.status_code == HTTPStatus.METHOD_NOT_ALLOWED:
        allowed = ", ".join(_allowed_methods(request)) or headers.get("Allow", "")
        what = f"{request.method} is not allowed at '{path}'"
        return problem_response(
            HTTPStatus.METHOD_NOT_ALLOWED, what, f"allowed are {allowed}", headers={"Allow": allowed}
        )
    cure = f"send it as {JSON_TYPE}" if error.status_code == HTTPStatus.UNSUPPORTED_MEDIA_TYPE else OPENAPI_HINT
    return problem_response(error.status_code, str(error.detail), cure, headers=headers)


def _allowed_methods(request: Request) -> Sequence[str]:
    routes = request.app.router.routes
    return [m for m in HTTP_METHODS if any(r.matches({**request.scope, "method": m})[0] is Match.FULL for r in routes)]


async def _unhandled_error(request: Request, error: Exception) -> Response:
    # The traceback goes to the log: the server raises the error again after this answer. This handler runs outside
    # the middleware, so it sets the headers itself.
    what = f"the program failed to answer {request.method} '{request.url.path}'"
    return problem_response(
        HTTPStatus.INTERNAL_SERVER_ERROR, what, "its log says why; please report it", headers=SECURITY_HEADERS
    )
