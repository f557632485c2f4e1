"""Builds the OpenAPI document of the API, with every error as application/problem+json."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from fastapi.routing import APIRoute

from relit_camera.api.problem_details import MEDIA_TYPE, PROBLEM_TYPES, Problem

TAGS = [
    {"name": "scene", "description": "Everything that is shown, in one step."},
    {"name": "lighting", "description": "The light that falls on the face."},
    {"name": "environments", "description": "Stored light from all sides."},
    {"name": "background", "description": "What is seen behind the person."},
    {"name": "control", "description": "Mode, freezing, neutral pose."},
    {"name": "subjects", "description": "Who is shown."},
    {"name": "replays", "description": "Recorded videos, relit."},
    {"name": "presets", "description": "Stored looks."},
    {"name": "setup", "description": "Checks, devices, source, tracker, models, and how to sit."},
    {"name": "preview", "description": "The published picture."},
    {"name": "status", "description": "How the camera is doing."},
    {"name": "probes", "description": "For supervisors and Prometheus."},
]
SCHEMA_REFERENCE = "#/components/schemas/{model}"
OTHER_ERRORS = "Any other error: 401 the token is needed, 403 another site, 421 wrong host, 500 a fault"


def operation_id(route: APIRoute) -> str:
    """The operationId of a route: the name of its function."""
    return route.name


def openapi_document(app: FastAPI) -> dict[str, Any]:
    """The description, with every error as application/problem+json."""
    document = get_openapi(
        title=app.title,
        version=app.version,
        summary=app.summary,
        description=app.description,
        routes=app.routes,
        tags=TAGS,
    )
    problem = Problem.model_json_schema(ref_template=SCHEMA_REFERENCE)
    schemas = document["components"]["schemas"] | problem.pop("$defs") | {"Problem": problem}
    document["components"]["schemas"] = dict(sorted(schemas.items()))
    document["components"]["securitySchemes"] = {
        "token": {"type": "http", "scheme": "bearer", "description": "Needed where the camera was given a token"}
    }
    document["security"] = [{}, {"token": []}]
    for operations in document["paths"].values():
        for operation in operations.values():
            answers = operation["responses"]
            for status in ("400", "413", "415") if "requestBody" in operation else ():
                answers.setdefault(status, {"description": PROBLEM_TYPES[int(status)][1]})
            answers["default"] = {"description": OTHER_ERRORS}
            for status, answer in answers.items():
                if status >= "400":
                    answer["content"] = {MEDIA_TYPE: {"schema": {"$ref": SCHEMA_REFERENCE.format(model="Problem")}}}
    return document
