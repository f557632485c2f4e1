"""Turns every exception raised while a request is answered into an application/problem+json answer."""

from __future__ import annotations

from collections.abc import Sequence
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.routing import Match

from relit_camera.api.middleware.same_origin import SECURITY_HEADERS
from relit_camera.api.problem_details import FieldProblem, problem_response, problem_response_from
from relit_camera.base.errors import RelitError

HTTP_METHODS = ("GET", "PUT", "PATCH", "POST", "DELETE")
OPENAPI_HINT = "GET /api/v1/openapi.json describes every operation"


def install_error_handlers(app: FastAPI) -> None:
    """Make `app` answer every error with application/problem+json."""
    app.exception_handler(RelitError)(_relit_error)
    app.exception_handler(RequestValidationError)(_validation_error)
    app.exception_handler(HTTPException)(_http_error)
    app.exception_handler(Exception)(_unhandled_error)


async def _relit_error(request: Request, error: RelitError) -> Response:
    return problem_response_from(error)


async def _validation_error(request: Request, error: RequestValidationError) -> Response:
    details = error.errors()
    if any(detail["type"] == "json_invalid" for detail in details):
        return problem_response(HTTPStatus.BAD_REQUEST, "the body is not valid JSON", OPENAPI_HINT)
    fields = [_field_problem(detail) for detail in details]
    first = fields[0]
    more = f" (and {len(fields) - 1} more)" if len(fields) > 1 else ""
    what = f"{first.field}: {first.message}" if first.field else first.message
    return problem_response(HTTPStatus.UNPROCESSABLE_ENTITY, what + more, OPENAPI_HINT, fields)


def _field_problem(detail: Any) -> FieldProblem:
    where, *path = detail["loc"]
    name = ".".join(map(str, path)) or (str(where) if where not in ("body", "query", "path") else "")
    message = detail["msg"].removeprefix("Value error, ")
    value = detail.get("input")
    shown = f" (is {value!r:.60})" if isinstance(value, str | int | float | bool) else ""
    return FieldProblem(field=name, message=f"{message[:1].lower()}{message[1:]}{shown}")


async def _http_error(request: Request, error: HTTPException) -> Response:
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
    return problem_response(error.status_code, str(error.detail), OPENAPI_HINT, headers=headers)


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
