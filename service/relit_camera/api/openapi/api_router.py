"""What all operations of the API share: the prefix of their paths, and how a JSON body is read."""

from __future__ import annotations

from fastapi import APIRouter, Depends

from relit_camera.api.middleware.json_bodies import require_strict_json
from relit_camera.api.openapi.openapi_document import operation_id

API_PREFIX = "/api/v1"


def api_router(tag: str, prefix: str = "") -> APIRouter:
    """A router of operations below `API_PREFIX` and that prefix, which an application takes as they are.

    FastAPI's `include_router` would build every route anew, with another prefix, for each application: that takes a
    quarter of a second when the first request comes.
    """
    return APIRouter(
        prefix=f"{API_PREFIX}{prefix}",
        tags=[tag],
        dependencies=[Depends(require_strict_json)],
        generate_unique_id_function=operation_id,
    )
