"""Builds the web application: routes, error handlers, panel, and the middleware in front of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fastapi import FastAPI
from starlette.responses import FileResponse, HTMLResponse
from starlette.staticfiles import StaticFiles

from relit_camera import __version__
from relit_camera.api.dependencies import create_context
from relit_camera.api.middleware.body_limits import BodyLimitMiddleware, HeadRequestMiddleware
from relit_camera.api.middleware.error_handlers import install_error_handlers
from relit_camera.api.middleware.same_origin import AllowedHosts, SameOriginMiddleware
from relit_camera.api.middleware.token_authentication import TokenAuthMiddleware
from relit_camera.api.middleware.upload_limits import UploadLimitMiddleware
from relit_camera.api.openapi.api_router import API_PREFIX
from relit_camera.api.openapi.openapi_document import openapi_document
from relit_camera.api.routes import (
    backgrounds,
    environments,
    lighting,
    mode_and_freeze,
    monitoring,
    presets,
    preview,
    server_sent_events,
    subjects,
    whole_scene,
)
from relit_camera.api.routes.jobs import captures, expression_captures, film_captures, replays
from relit_camera.api.routes.setup import framing_help, model_pulling, source_and_tracker, system_checks
from relit_camera.base.config.access_token import read_token
from relit_camera.base.config.settings import RelitSettings
from relit_camera.live.camera_control import CameraControl

PANEL_FOLDER = Path(__file__).with_name("panel")


def create_app(camera: CameraControl, settings: RelitSettings) -> FastAPI:
    """The API and the panel of a running camera.

    Raises:
        ConfigError: the token of the settings cannot be used (see `read_token`).
    """
    app = create_app_without_camera()
    app.state.context = create_context(camera, settings)
    token = read_token(settings.server)
    app.add_middleware(HeadRequestMiddleware)
    app.add_middleware(
        UploadLimitMiddleware,
        folder=settings.storage.data_dir,
        most_bytes=int(settings.storage.quota_gb * 1e9),
    )
    app.add_middleware(BodyLimitMiddleware)
    if token is not None:
        app.add_middleware(TokenAuthMiddleware, token=token)
    app.add_middleware(SameOriginMiddleware, names=AllowedHosts.of(settings.server))  # the one added last runs first
    return app


def create_app_without_camera() -> FastAPI:
    """The application without a camera: enough to describe it."""
    app = FastAPI(
        title="Relit Camera",
        summary="Change the light of the virtual camera while it runs.",
        description="Errors are RFC 9457 problems. Only GET and HEAD are without effect.",
        version=__version__,
        openapi_url=f"{API_PREFIX}/openapi.json",
        docs_url=None,  # FastAPI's pages load their scripts from other sites
        redoc_url=None,
    )
    for topic in (
        whole_scene,
        lighting,
        environments,
        backgrounds,
        mode_and_freeze,
        subjects,
        captures,
        expression_captures,
        film_captures,
        replays,
        presets,
        system_checks,
        source_and_tracker,
        model_pulling,
        framing_help,
        preview,
        server_sent_events,
        monitoring,
    ):
        app.router.routes += topic.router.routes
    app.router.routes += monitoring.probe_router.routes
    app.add_api_route("/", _panel_page, include_in_schema=False)
    app.add_api_route("/desk", _desk_page, include_in_schema=False)
    app.add_api_route("/film", _film_page, include_in_schema=False)
    app.mount("/panel", StaticFiles(directory=PANEL_FOLDER), "panel")
    install_error_handlers(app)
    app.openapi = lambda: _cached_openapi(app)  # type: ignore[method-assign]
    return app


def _panel_page() -> FileResponse:
    return FileResponse(PANEL_FOLDER / "index.html", media_type="text/html")


def _desk_page() -> HTMLResponse:
    return _capture_page("desk", "By the light of this screen")


def _film_page() -> HTMLResponse:
    return _capture_page("film", "Film yourself with a lamp")


def _capture_page(name: str, title: str) -> HTMLResponse:
    """The steps of a capture in the frame that all such pages have."""
    folder = PANEL_FOLDER / "capture"
    frame, steps = ((folder / f"{each}.html").read_text(encoding="utf-8") for each in ("frame", name))
    return HTMLResponse(frame.replace("{page}", name).replace("{title}", title).replace("{steps}", steps))


def _cached_openapi(app: FastAPI) -> dict[str, Any]:
    if app.openapi_schema is None:
        app.openapi_schema = openapi_document(app)
    return app.openapi_schema
