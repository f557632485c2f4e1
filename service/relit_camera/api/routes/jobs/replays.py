"""Routes of replays: recorded videos that are sent, and relit in a worker process as the present scene says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from http import HTTPStatus
from typing import Any

from fastapi import Request
from starlette.responses import FileResponse

from relit_camera.api.bodies.job_schemas import NameForm
from relit_camera.api.dependencies import ApiContextDep
from relit_camera.api.middleware.body_limits import MAX_FILM_BYTES
from relit_camera.api.openapi.api_router import api_router
from relit_camera.api.problem_details import error_responses
from relit_camera.api.streamed_forms import form_description, read_fields, receive_form
from relit_camera.base.config.look import StoredName
from relit_camera.base.errors import ConflictError
from relit_camera.base.storage.upload import Upload
from relit_camera.live.status.replay_status import ReplayStatus

VIDEO_RESPONSE: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "The relit video",
        "content": {"video/mp4": {"schema": {"type": "string", "format": "binary"}}},
    }
}

router = api_router("replays", "/replays")


@router.get("")
def list_replays(api: ApiContextDep) -> list[ReplayStatus]:
    """The relit videos, and one that runs, has failed or was canceled; the event `replay` tells each change."""
    return api.camera.replays.all()


@router.post(
    "",
    status_code=HTTPStatus.ACCEPTED,
    responses=error_responses(409, 413, 415, 422, 503, 507),
    openapi_extra=form_description(NameForm, "The video: .mp4, .mov, .m4v, .mkv, .webm or .avi."),
)
async def start_replay(api: ApiContextDep, request: Request) -> ReplayStatus:
    """Relight a video of up to 4 GiB, and of half of the free space, as the present scene says; `name` comes first.

    One at a time.
    """
    started: list[str] = []

    @contextmanager
    def open_file(fields: Mapping[str, str], file_name: str) -> Iterator[Upload]:
        name = read_fields(NameForm, fields).name
        if api.camera.film_capture.status().stage.is_running:
            raise ConflictError("a subject is made of a film", "wait for its end, or cancel it")
        with api.camera.replays.receive(name, file_name) as upload:
            yield upload
        started.append(name)

    await receive_form(request, open_file, MAX_FILM_BYTES)
    return api.camera.replays.status(started[0])


@router.get("/{name}", responses=error_responses(404, 422))
def get_replay(api: ApiContextDep, name: StoredName) -> ReplayStatus:
    """How far one replay is."""
    return api.camera.replays.status(name)


@router.get("/{name}/video", response_class=FileResponse, responses=VIDEO_RESPONSE | error_responses(404, 409, 422))
def get_replay_video(api: ApiContextDep, name: StoredName) -> FileResponse:
    """The relit video; a part of it where the request has a `Range`."""
    path = api.camera.replays.video(name)
    return FileResponse(path, media_type="video/mp4", filename=path.name, content_disposition_type="inline")


@router.delete("/{name}", status_code=HTTPStatus.NO_CONTENT, responses=error_responses(404, 422, 507))
def remove_replay(api: ApiContextDep, name: StoredName) -> None:
    """End a replay that runs, or delete its video."""
    api.camera.replays.remove(name)
