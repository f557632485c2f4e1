"""Error answers as application/problem+json (RFC 9457): what is wrong, and what cures it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from http import HTTPStatus
from typing import Any

from pydantic import BaseModel, ConfigDict
from starlette.responses import Response

from relit_camera.base.errors import (
    ConflictError,
    DeviceError,
    ForbiddenError,
    InputError,
    NotFoundError,
    NotReadyError,
    PreconditionFailedError,
    RelitError,
    StorageError,
    TooLargeError,
    UnlitNotAllowedError,
)
from relit_camera.base.storage.folder_redaction import redact_folders

MEDIA_TYPE = "application/problem+json"


class FieldProblem(BaseModel):
    """One field of a request that is wrong."""

    model_config = ConfigDict(use_attribute_docstrings=True)

    field: str
    """Dotted path of the field, such as `lamps.0.kelvin`; empty for the body as a whole."""
    message: str
    """What is wrong with it."""


class Problem(BaseModel):
    """An error answer (RFC 9457)."""

    model_config = ConfigDict(use_attribute_docstrings=True)

    type: str
    """Names the kind of problem, such as `urn:relit-camera:problem:not-found`."""
    title: str
    """The kind of problem in words."""
    status: int
    """The HTTP status."""
    detail: str
    """`what` and `cure` in one sentence."""
    what: str
    """What is wrong."""
    cure: str = ""
    """What to do about it."""
    errors: list[FieldProblem] | None = None
    """Every wrong field, where fields are at fault."""


STATUS_BY_ERROR = {
    NotFoundError: HTTPStatus.NOT_FOUND,
    InputError: HTTPStatus.UNPROCESSABLE_ENTITY,
    StorageError: HTTPStatus.INSUFFICIENT_STORAGE,
    DeviceError: HTTPStatus.SERVICE_UNAVAILABLE,
    ConflictError: HTTPStatus.CONFLICT,
    PreconditionFailedError: HTTPStatus.PRECONDITION_FAILED,
    TooLargeError: HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
    ForbiddenError: HTTPStatus.FORBIDDEN,
    NotReadyError: HTTPStatus.SERVICE_UNAVAILABLE,
}

PROBLEM_TYPES = {
    400: ("unreadable", "The request cannot be read"),
    401: ("token-needed", "The token is needed"),
    403: ("refused", "Refused"),
    404: ("not-found", "Not found"),
    405: ("method-not-allowed", "Method not allowed"),
    409: ("conflict", "In conflict with what is there"),
    412: ("precondition-failed", "Changed meanwhile"),
    413: ("too-large", "Too large"),
    415: ("media-type", "Of a kind that is not taken"),
    421: ("wrong-host", "Wrong host"),
    422: ("invalid-input", "The input is at fault"),
    429: ("too-many", "Too many requests"),
    500: ("fault", "A fault of the program"),
    503: ("not-available", "Not available now"),
    507: ("not-stored", "Could not be stored"),
}
"""Status → the last part of the problem's type, and its title."""
UNLIT_NOT_ALLOWED = ("unlit-not-allowed", "Nobody has allowed the picture as filmed")
"""The same of a 409 that goes away once a person has confirmed it."""


def status_for_error(error: RelitError) -> int:
    """The HTTP status of an error: that of its nearest listed ancestor, else 500."""
    return next(
        (STATUS_BY_ERROR[kind] for kind in type(error).__mro__ if kind in STATUS_BY_ERROR),
        HTTPStatus.INTERNAL_SERVER_ERROR,
    )


def problem_response(
    status: int,
    what: str,
    cure: str = "",
    errors: Sequence[FieldProblem] | None = None,
    headers: Mapping[str, str] | None = None,
    kind: tuple[str, str] | None = None,
) -> Response:
    """The error answer of this status, with what is wrong and what cures it.

    `kind` is the last part of its type, and its title; those of `PROBLEM_TYPES` if not given.
    """
    slug, title = kind or PROBLEM_TYPES.get(status) or ("http", HTTPStatus(status).phrase)
    body = Problem(
        type=f"urn:relit-camera:problem:{slug}",
        title=title,
        status=status,
        detail=f"{what}; {cure}" if cure else what,
        what=what,
        cure=cure,
        errors=list(errors) if errors else None,
    )
    return Response(body.model_dump_json(exclude_none=True), status, headers, MEDIA_TYPE)


def problem_response_from(error: RelitError) -> Response:
    """The error answer for a `RelitError`, without the folders of this machine."""
    kind = UNLIT_NOT_ALLOWED if isinstance(error, UnlitNotAllowedError) else None
    return problem_response(status_for_error(error), redact_folders(error.what), redact_folders(error.cure), kind=kind)


def error_responses(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """The OpenAPI entries of the errors that an operation may answer with; `api.openapi` adds what the body is.

    With it as `model` here, FastAPI would make a validator for each of two hundred entries when the camera starts.
    """
    return {status: {"description": PROBLEM_TYPES[status][1]} for status in statuses}
