"""The application: routes, errors, panel, and the checks in front of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fastapi import APIRouter, FastAPI
from starlette.responses import FileResponse
from starlette.staticfiles import StaticFiles

from relit_camera import __version__
from relit_camera.api.access import TokenRequired
from relit_camera.api.bodies import BodyLimit, HeadAsGet
from relit_camera.api.context import make_context
from relit_camera.api.error_handlers import install_error_handlers
from relit_camera.api.openapi import openapi_document, operation_id
from relit_camera.api.routes import (
    backgrounds,
    environments,
    events,
    lighting,
    mode,
    presets,
    preview,
    status,
    subjects,
)
from relit_camera.api.security import OurNames, OurPagesOnly
from relit_camera.config.settings import RelitSettings
from relit_camera.config.token import read_token
from relit_camera.stream.control import CameraControl

PREFIX = "/api/v1"
PANEL = Path(__file__).with_name("panel")


def create_app(camera: CameraControl, settings: RelitSettings) -> FastAPI:
    """The API and the panel of a running camera.

    Raises:
        ConfigError: as `read_token`.
    """
    app = bare_app()
    app.state.context = make_context(camera, settings)
    token = read_token(settings.server)
    app.add_middleware(HeadAsGet)
    app.add_middleware(BodyLimit)
    if token is not None:
        app.add_middleware(TokenRequired, token=token)
    app.add_middleware(OurPagesOnly, names=OurNames.of(settings.server))  # the last is met first
    return app


def bare_app() -> FastAPI:
    """The application without a camera: enough to describe it."""
    app = FastAPI(
        title="Relit Camera",
        summary="Change the light of the virtual camera while it runs.",
        description="Errors are RFC 9457 problems. Only GET and HEAD are without effect.",
        version=__version__,
        openapi_url=f"{PREFIX}/openapi.json",
        docs_url=None,  # those pages load their scripts from elsewhere
        redoc_url=None,
        generate_unique_id_function=operation_id,
    )
    api = APIRouter(prefix=PREFIX)
    for topic in (lighting, environments, backgrounds, mode, subjects, presets, preview, events, status):
        api.include_router(topic.router)
    app.include_router(api)
    app.include_router(status.probes)
    app.add_api_route("/", _panel_page, include_in_schema=False)
    app.mount("/panel", StaticFiles(directory=PANEL), "panel")
    install_error_handlers(app)
    app.openapi = lambda: _described(app)  # type: ignore[method-assign]
    return app


def _panel_page() -> FileResponse:
    return FileResponse(PANEL / "index.html", media_type="text/html")


def _described(app: FastAPI) -> dict[str, Any]:
    if app.openapi_schema is None:
        app.openapi_schema = openapi_document(app)
    return app.openapi_schema
