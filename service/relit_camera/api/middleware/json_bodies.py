"""JSON bodies of requests: they must say that they are JSON, and are read strictly, with an offer for each misspelling.

FastAPI reads what the settings' models take from YAML and from the environment, where "1" may stand for 1 and for true.
A program that sends JSON has types, and a wrong one is a mistake.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Iterable, Iterator, Sequence
from difflib import get_close_matches
from functools import lru_cache
from http import HTTPStatus
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from fastapi import Request
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute
from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails
from starlette.exceptions import HTTPException

from relit_camera.base.storage.named_files import TYPO_SIMILARITY

JSON_TYPE = "application/json"


async def require_strict_json(request: Request) -> None:
    """A dependency of all routes: checks the body of one that takes JSON.

    Raises:
        HTTPException: 415, the body is not said to be JSON.
        RequestValidationError: it is not what the route takes.
    """
    route = request.scope.get("route")
    if not isinstance(route, APIRoute) or json_body_type(route) is None:
        return
    body = await request.body()
    if not body:
        return  # FastAPI says whether one is needed
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind != JSON_TYPE and not (kind.startswith("application/") and kind.endswith("+json")):
        said = f"'{kind}'" if kind else "nothing"
        raise HTTPException(
            HTTPStatus.UNSUPPORTED_MEDIA_TYPE, f"the body's Content-Type says {said}; {JSON_TYPE} is taken"
        )
    # What is no JSON for pydantic, but is for FastAPI (half a surrogate pair), has a wrong value for the latter.
    try:
        _adapter(route.endpoint, route.dependant.body_params[0].name).validate_json(body, strict=True)
    except ValidationError as error:
        details = [
            {**detail, "loc": ("body", *detail["loc"])}
            for detail in error.errors(include_url=False)
            if detail["type"] != "json_invalid" and not _is_whole_number(detail)
        ]
        if details:
            raise RequestValidationError(details) from error


def _is_whole_number(detail: ErrorDetails) -> bool:
    """Whether an integer was refused that is written as 3.0: JSON has one type of numbers."""
    value = detail["input"]
    return detail["type"] == "int_type" and isinstance(value, float) and value.is_integer()


def json_body_type(route: object) -> Any:
    """The type of the JSON body that a route takes; None where it takes none, or a form."""
    if not isinstance(route, APIRoute) or route.body_field is None:
        return None
    parameters = route.dependant.body_params
    if len(parameters) != 1 or type(parameters[0].field_info).__name__ in ("Form", "File"):
        return None
    return _annotation(route.endpoint, parameters[0].name)


@lru_cache(maxsize=256)
def _annotation(endpoint: Callable[..., Any], parameter: str) -> Any:
    return get_type_hints(endpoint, include_extras=True)[parameter]


@lru_cache(maxsize=256)
def _adapter(endpoint: Callable[..., Any], parameter: str) -> TypeAdapter[Any]:
    return TypeAdapter(_annotation(endpoint, parameter))


def meant_field(body_type: Any, path: Sequence[object]) -> str | None:
    """The field that a person may have meant by an unknown one at `path` of a body; None if none is like it."""
    *parents, name = path
    known = {field for model in _models_at(body_type, parents) for field in model.model_fields}
    close = get_close_matches(str(name), known, 1, TYPO_SIMILARITY)
    return close[0] if close else None


def _models_at(annotation: Any, path: Sequence[object]) -> Iterator[type[BaseModel]]:
    """The models that the value at `path` of a value of this type may be of."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        if not path:
            yield annotation
            return
        if path[0] in annotation.model_fields:
            yield from _models_at(annotation.model_fields[str(path[0])].annotation, path[1:])
        if path[0] in _tags(annotation):  # the chosen member of a tagged union
            yield from _models_at(annotation, path[1:])
        return
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        yield from _models_at(arguments[0], path)
    elif origin in (Union, types.UnionType):
        yield from _models_of_any(arguments, path)
    elif origin in (tuple, list) and path and isinstance(path[0], int):
        yield from _models_of_any(arguments, path[1:])


def _models_of_any(annotations: Iterable[Any], path: Sequence[object]) -> Iterator[type[BaseModel]]:
    for annotation in annotations:
        yield from _models_at(annotation, path)


def _tags(model: type[BaseModel]) -> set[object]:
    kind = model.model_fields.get("kind")
    return set(get_args(kind.annotation)) if kind is not None and get_origin(kind.annotation) is Literal else set()
